//! A straight line or arc of a tunnel profile: intersections with rays, and arc lengths on it.

use super::plane::{Yz, cross, dot, norm, sub};
use crate::math::{self, TAU};

/// Angle by which a hit may lie beyond an arc's end, rad. It leaves no gap between neighbouring elements.
pub(super) const ARC_SLACK_RAD: f64 = 1e-12;
/// Margin beyond which a ray's hit is clearly inside or outside the angle of an arc.
///
/// It is a difference of two cosines, those of the angles from the arc's middle to the hit and to the arc's end. It is
/// far larger than `ARC_SLACK_RAD` plus rounding.
const CLEAR: f64 = 1e-9;

/// Sine of the angle between a ray and an edge of the profile below which they count as parallel.
const PARALLEL: f64 = 1e-6;

/// One input piece of a profile. Pieces run counter-clockwise if y is drawn to the right and z up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Piece {
    /// A straight line to the given point.
    LineTo(Yz),
    /// An arc about `centre` through the angle `sweep_rad` > 0.
    ///
    /// The arc runs counter-clockwise, so it bulges outwards.
    Arc {
        /// Centre of the arc's circle.
        centre: Yz,
        /// Angle from the arc's start to its end, about the centre.
        sweep_rad: f64,
    },
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Element {
    pub(super) start: Yz,
    pub(super) end: Yz,
    pub(super) arc_m: f64,
    pub(super) length_m: f64,
    pub(super) shape: Shape,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Shape {
    Line,
    /// `middle` is the unit vector from the centre to the arc's middle. `cos_half` is the cosine of half the sweep
    /// angle.
    Arc {
        centre: Yz,
        radius_m: f64,
        from_rad: f64,
        sweep_rad: f64,
        middle: Yz,
        cos_half: f64,
    },
}

impl Element {
    /// Returns the ray parameter at which the ray leaves the profile through this element, if it does.
    pub(super) fn crossing(&self, origin: Yz, direction: Yz) -> Option<f64> {
        let (start, end) = (sub(self.start, origin), sub(self.end, origin));
        match self.shape {
            Shape::Line => {
                // A ray leaves the profile if the element's start is on its right and the element's end on its left.
                // Two elements compute the same product for their common vertex, so the ray hits exactly one of them.
                let (right, left) = (cross(direction, start), cross(direction, end));
                if !(right <= 0.0 && left > 0.0) {
                    return None;
                }
                let (along, apart) = (sub(self.end, self.start), left - right);
                let t = cross(start, along) / apart;
                let length2 = dot(direction, direction);
                // For a ray along the edge, both cross products are mere rounding errors. Clamping then keeps the exit
                // point on the edge.
                let t = if apart * apart < PARALLEL * PARALLEL * length2 * dot(along, along) {
                    let ends = [dot(start, direction) / length2, dot(end, direction) / length2];
                    t.clamp(ends[0].min(ends[1]), ends[0].max(ends[1]))
                } else {
                    t
                };
                (t >= 0.0).then_some(t)
            }
            Shape::Arc { centre, radius_m, from_rad, sweep_rad, middle, cos_half } => {
                let offset = sub(origin, centre);
                let a = dot(direction, direction);
                let b = dot(direction, offset);
                let c = dot(offset, offset) - radius_m * radius_m;
                let discriminant = b * b - a * c;
                if discriminant < 0.0 {
                    return None;
                }
                let root = math::sqrt(discriminant);
                let t = if b > 0.0 { -c / (b + root) } else { (root - b) / a };
                if t < 0.0 {
                    return None;
                }
                let hit = [offset[0] + t * direction[0], offset[1] + t * direction[1]];
                let lean = dot(hit, middle) / radius_m - cos_half;
                if lean.abs() > CLEAR {
                    return (lean > 0.0).then_some(t);
                }
                let turned = math::wrap(math::atan2(hit[1], hit[0]) - from_rad, TAU);
                let within = turned <= sweep_rad + ARC_SLACK_RAD || turned >= TAU - ARC_SLACK_RAD;
                within.then_some(t)
            }
        }
    }

    /// Arc length from the element's start to `point` on it.
    pub(super) fn along(&self, point: Yz) -> f64 {
        match self.shape {
            Shape::Line => norm(sub(point, self.start)),
            Shape::Arc { centre, radius_m, from_rad, sweep_rad, .. } => {
                let from_centre = sub(point, centre);
                let turned = math::wrap(math::atan2(from_centre[1], from_centre[0]) - from_rad, TAU);
                // A point outside the sweep counts as the start, at arc length zero.
                let turned = if turned > sweep_rad + ARC_SLACK_RAD { 0.0 } else { turned };
                radius_m * turned
            }
        }
    }

    pub(super) fn point_at(&self, along_m: f64) -> Yz {
        match self.shape {
            Shape::Line => {
                let share = along_m / self.length_m;
                let along = sub(self.end, self.start);
                [self.start[0] + share * along[0], self.start[1] + share * along[1]]
            }
            Shape::Arc { centre, radius_m, from_rad, .. } => {
                let (sin, cos) = math::sin_cos(from_rad + along_m / radius_m);
                [centre[0] + radius_m * cos, centre[1] + radius_m * sin]
            }
        }
    }

    pub(super) fn normal(&self, point: Yz) -> Yz {
        let outwards = match self.shape {
            Shape::Line => {
                let along = sub(self.end, self.start);
                [along[1], -along[0]]
            }
            Shape::Arc { centre, .. } => sub(point, centre),
        };
        let length = norm(outwards);
        [-outwards[0] / length, -outwards[1] / length]
    }

    /// Returns the angle that this element spans about `reference`; `None` if any part of it runs backwards.
    pub(super) fn angle_about(&self, reference: Yz) -> Option<f64> {
        let (start, end) = (sub(self.start, reference), sub(self.end, reference));
        match self.shape {
            Shape::Line => {
                let angle = math::atan2(cross(start, end), dot(start, end));
                (angle > 0.0).then_some(angle)
            }
            Shape::Arc { centre, radius_m, from_rad, sweep_rad, .. } => {
                // At the polar angle theta, the arc runs forwards if (centre - reference) . e(theta) + radius > 0. This
                // is checked at 256 angles.
                let shift = sub(centre, reference);
                let steps = 256;
                let mut angle = 0.0;
                let mut before = start;
                for step in 1..=steps {
                    let theta = from_rad + sweep_rad * f64::from(step) / f64::from(steps);
                    let (sin, cos) = math::sin_cos(theta);
                    if shift[0] * cos + shift[1] * sin + radius_m <= 0.0 {
                        return None;
                    }
                    let here = [shift[0] + radius_m * cos, shift[1] + radius_m * sin];
                    angle += math::atan2(cross(before, here), dot(before, here));
                    before = here;
                }
                Some(angle)
            }
        }
    }
}

/// Builds the element of a piece that starts at `start`.
pub(super) fn build(start: Yz, piece: Piece) -> Element {
    match piece {
        Piece::LineTo(end) => {
            Element { start, end, arc_m: 0.0, length_m: norm(sub(end, start)), shape: Shape::Line }
        }
        Piece::Arc { centre, sweep_rad } => {
            let from_centre = sub(start, centre);
            let radius_m = norm(from_centre);
            let from_rad = math::atan2(from_centre[1], from_centre[0]);
            let (sin, cos) = math::sin_cos(from_rad + sweep_rad);
            let end = [centre[0] + radius_m * cos, centre[1] + radius_m * sin];
            let (sin_middle, cos_middle) = math::sin_cos(from_rad + sweep_rad / 2.0);
            let middle = [cos_middle, sin_middle];
            let cos_half = math::cos(sweep_rad / 2.0);
            let shape = Shape::Arc { centre, radius_m, from_rad, sweep_rad, middle, cos_half };
            Element { start, end, arc_m: 0.0, length_m: radius_m * sweep_rad, shape }
        }
    }
}
