//! Intersects a ray with a box and with a triangle, without gaps between triangles.
//!
//! Source: S. Woop, C. Benthin, I. Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013. The side of the ray
//! on which an edge passes is the sign of a difference of two products. Rounding keeps the order of the products, and
//! swapping the ends of the edge changes only the sign. Two triangles with a common edge therefore agree on the side of
//! the ray, or both find zero, which counts as inside. No ray passes between the two triangles.

use headrace_geometry::math;

/// Relative size of a triangle's area, seen along the ray, below which rounding errors dominate. A triangle with such a
/// small area is a needle or is seen edge-on. The value is a few thousand times the relative rounding error of one
/// operation.
const THIN: f64 = 1e-12;
/// Factor that widens the interval of a box by more than its rounding error.
const WIDER: f64 = 1.0 + 1e-15;

/// Tells whether a ray crosses a triangle. The cases that are ambiguous have a value of their own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Crossing {
    Beside,
    Through,
    /// The ray passes through an edge or a corner, or along the face.
    Unclear,
}

/// A ray with precomputed values for intersections.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ray {
    origin: [f64; 3],
    inverse: [f64; 3],
    /// Numbers of the coordinate axes. The axis nearest to the ray's direction is last.
    axes: [usize; 3],
    /// Shear that makes the ray parallel to the last axis. The first two numbers are subtracted from the first two
    /// coordinates, per unit of the last coordinate. The third number is the scale of the last coordinate.
    shear: [f64; 3],
    far: f64,
}

/// A triangle seen along the ray, with twice the areas of the three parts into which the ray divides the triangle.
struct Parts {
    corners: [[f64; 3]; 3],
    areas: [f64; 3],
}

impl Ray {
    /// Prepares a ray from an origin and a direction of any length. The ray ends at `far` times the direction's length.
    ///
    /// If the direction is zero or not finite, the ray hits nothing.
    pub(super) fn new(origin: [f64; 3], direction: [f64; 3], far: f64) -> Self {
        let [x, y, z] = direction.map(f64::abs);
        let axes = if z >= x && z >= y {
            [0, 1, 2]
        } else if y >= x {
            [2, 0, 1]
        } else {
            [1, 2, 0]
        };
        let [u, v, w] = axes.map(|k| direction[k]);
        let shear = [u / w, v / w, 1.0 / w];
        Self { origin, inverse: direction.map(|d| 1.0 / d), axes, shear, far }
    }

    /// Lower bound of the range at which the ray enters a box; infinite if the ray misses the box.
    ///
    /// A NaN, which comes from zero times infinity, leaves the bound unchanged.
    pub(super) fn enters(&self, low: [f64; 3], high: [f64; 3]) -> f64 {
        let mut near = 0.0;
        let mut far = self.far;
        for k in 0..3 {
            let a = (low[k] - self.origin[k]) * self.inverse[k];
            let b = (high[k] - self.origin[k]) * self.inverse[k];
            let (first, last) = if a > b { (b, a) } else { (a, b) };
            if first > near {
                near = first;
            }
            if last < far {
                far = last;
            }
        }
        // The bound is less than the range of any hit in the box, even of a hit at range 0. If hits in two boxes have
        // equal ranges, both are therefore found.
        if near <= far * WIDER { near / WIDER / WIDER - f64::MIN_POSITIVE } else { f64::INFINITY }
    }

    fn parts(&self, triangle: [[f64; 3]; 3]) -> Parts {
        let [kx, ky, kz] = self.axes;
        let corners = triangle.map(|p| {
            let z = p[kz] - self.origin[kz];
            [p[kx] - self.origin[kx] - self.shear[0] * z, p[ky] - self.origin[ky] - self.shear[1] * z, z]
        });
        let [a, b, c] = corners;
        let area = |p: [f64; 3], q: [f64; 3]| p[0] * q[1] - p[1] * q[0];
        Parts { corners, areas: [area(b, c), area(c, a), area(a, b)] }
    }

    /// The range at which the ray hits a triangle, from either side. The edges belong to the triangle.
    pub(super) fn hits(&self, triangle: [[f64; 3]; 3]) -> Option<f64> {
        let parts = self.parts(triangle);
        let [u, v, w] = parts.areas;
        if !((u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0)) {
            return None;
        }
        let range = parts.depth()? * self.shear[2];
        (range >= 0.0 && range <= self.far).then_some(range)
    }

    /// Whether the ray crosses the interior of a triangle.
    pub(super) fn crosses(&self, triangle: [[f64; 3]; 3]) -> Crossing {
        let parts = self.parts(triangle);
        let [u, v, w] = parts.areas;
        let is_outside = (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0);
        if is_outside || parts.corners.iter().all(|p| p[2] * self.shear[2] < 0.0) {
            return Crossing::Beside;
        }
        if u == 0.0 || v == 0.0 || w == 0.0 {
            return Crossing::Unclear;
        }
        match parts.depth().map(|depth| depth * self.shear[2]) {
            Some(range) if range > 0.0 => Crossing::Through,
            Some(range) if range < 0.0 => Crossing::Beside,
            _ => Crossing::Unclear,
        }
    }
}

impl Parts {
    /// Coordinate along the last axis at which the ray meets the triangle's plane.
    fn depth(&self) -> Option<f64> {
        let [u, v, w] = self.areas;
        let [a, b, c] = self.corners;
        let whole = u + v + w;
        if whole == 0.0 {
            return None;
        }
        let largest = |p: &[f64; 3]| p[0].abs().max(p[1].abs());
        let wide = largest(&a).max(largest(&b)).max(largest(&c));
        let deep = wide.max(a[2].abs()).max(b[2].abs()).max(c[2].abs());
        if whole.abs() > THIN * wide * deep {
            return Some((u * a[2] + v * b[2] + w * c[2]) / whole);
        }
        // The triangle is seen as a line, so its computed areas are only rounding errors. The depth is therefore
        // computed from its longest side.
        let side = |p: [f64; 3], q: [f64; 3]| {
            let (x, y) = (q[0] - p[0], q[1] - p[1]);
            let square = x * x + y * y;
            let share = (-(p[0] * x + p[1] * y) / square).clamp(0.0, 1.0);
            (square, p[2] + share * (q[2] - p[2]))
        };
        let mut longest = side(a, b);
        for (p, q) in [(b, c), (c, a)] {
            let next = side(p, q);
            if next.0 > longest.0 {
                longest = next;
            }
        }
        Some(if longest.0 > 0.0 { longest.1 } else { a[2] })
    }
}

/// The unit normal of a triangle, on the side from which a ray with this `direction` comes. For a triangle without
/// area, the normal points against the ray.
pub(super) fn normal_against(triangle: [[f64; 3]; 3], direction: [f64; 3]) -> [f64; 3] {
    let [a, b, c] = triangle;
    let normal = cross(minus(b, a), minus(c, a));
    let length = math::sqrt(dot(normal, normal));
    if length > 0.0 {
        let length = if dot(normal, direction) > 0.0 { -length } else { length };
        normal.map(|n| n / length)
    } else {
        direction.map(|d| -d)
    }
}

fn minus(p: [f64; 3], q: [f64; 3]) -> [f64; 3] {
    [p[0] - q[0], p[1] - q[1], p[2] - q[2]]
}

fn dot(p: [f64; 3], q: [f64; 3]) -> f64 {
    p[0] * q[0] + p[1] * q[1] + p[2] * q[2]
}

fn cross(p: [f64; 3], q: [f64; 3]) -> [f64; 3] {
    [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]]
}
