//! The tunnel's axis in plan view: a sequence of straight pieces and arcs.
//!
//! Chainage is the arc length along the axis. The axis is smooth, bends no tighter than [`Axis::parse`] allows and
//! turns by no more than half a turn between any two points. Three properties follow. The axis never comes near itself.
//! Each point of the tunnel has exactly one nearest point of the axis. Chainage is monotonic along a straight line
//! through the tunnel.

use headrace_config::{ConfigError, Section};
use headrace_geometry::frames::{Point3, Tunnel};
use headrace_geometry::math::{self, PI};
use headrace_geometry::tunnel::Yz;

/// Minimum radius of a bend, in multiples of the tunnel's half-width.
pub(super) const LEAST_RADIUS_HALF_WIDTHS: f64 = 2.0;
/// Largest angle between any two headings of the axis.
const LARGEST_TURN_RAD: f64 = PI * (1.0 + 1e-12);

/// The tunnel's axis, horizontal at z = 0. It continues straight before chainage 0 and beyond the last piece.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Pieces of the axis, without gaps, from -infinity to +infinity of chainage.
    pieces: Vec<Piece>,
}

/// A straight piece or an arc of the tunnel's axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Piece {
    /// Chainage of the start of the piece, m.
    pub(super) from_m: f64,
    /// Chainage of the end of the piece, m.
    pub(super) to_m: f64,
    /// Chainage of the point `at`, m: an end of a straight piece, or the middle of an arc.
    anchor_m: f64,
    at: Yz,
    heading_rad: f64,
    tangent: Yz,
    /// Curvature, 1/m: zero for a straight piece, positive for a bend to the left.
    curvature_pm: f64,
}

/// A point of the axis. It defines the plane through this point, perpendicular to the axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Station {
    /// The point of the axis, in plan view, m.
    pub(super) at: Yz,
    /// Direction of the axis at the point, a unit vector.
    pub(super) tangent: Yz,
}

impl Axis {
    /// A straight axis along x.
    pub fn straight() -> Self {
        let piece = Piece::new(0.0, [0.0, 0.0], 0.0, f64::INFINITY, 0.0);
        Self { pieces: vec![Piece { from_m: f64::NEG_INFINITY, ..piece }] }
    }

    /// Reads the `[[tunnel.axis]]` tables for a tunnel that extends `half_width_m` to the sides.
    ///
    /// Errors: a key is missing, unknown or out of range; a bend is too tight, or turns the axis back.
    pub(super) fn parse(sections: Vec<Section<'_>>, half_width_m: f64) -> Result<Self, ConfigError> {
        let mut axis = Self::straight();
        let (mut most_left, mut most_right) = (0.0_f64, 0.0_f64);
        for section in sections {
            let (length_m, curvature_pm) = parse_piece(&section, half_width_m)?;
            axis.append(length_m, curvature_pm);
            let heading = axis.pieces.last().map_or(0.0, |piece| piece.heading_rad);
            (most_left, most_right) = (most_left.max(heading), most_right.min(heading));
            if most_left - most_right > LARGEST_TURN_RAD {
                let problem = "turns the axis by more than 180 degrees from an earlier heading; \
                               it could meet itself";
                return Err(section.invalid("turn_deg", problem));
            }
            section.finish()?;
        }
        Ok(axis)
    }

    /// Appends a piece to the axis, which then continues straight.
    fn append(&mut self, length_m: f64, curvature_pm: f64) {
        let Some(last) = self.pieces.pop() else { return };
        let (at, heading_rad) = (last.at, last.heading_rad);
        let start_m = last.anchor_m;
        if last.from_m < start_m {
            self.pieces.push(Piece { to_m: start_m, ..last });
        }
        let piece = Piece::new(start_m, at, heading_rad, length_m, curvature_pm);
        let end_m = start_m + length_m;
        let end = piece.station(end_m).at;
        self.pieces.push(piece);
        let heading_rad = heading_rad + curvature_pm * length_m;
        self.pieces.push(Piece::new(end_m, end, heading_rad, f64::INFINITY, 0.0));
    }

    /// Whether the tunnel's axis has no bend.
    pub fn is_straight(&self) -> bool {
        self.pieces.len() == 1 || self.pieces.iter().all(|piece| piece.curvature_pm == 0.0)
    }

    /// Converts the point `[y, z]` (y left, z up, m) of the cross-section at `chainage_m` to the tunnel's frame.
    pub fn place(&self, chainage_m: f64, [y, z]: Yz) -> Point3<Tunnel> {
        let Station { at, tangent } = self.station(chainage_m);
        Point3::new(at[0] - y * tangent[1], at[1] + y * tangent[0], z)
    }

    /// Heading of the axis at `chainage_m`, radians from x, positive to the left.
    pub fn heading_rad(&self, chainage_m: f64) -> f64 {
        let (_, piece) = self.piece_at(chainage_m);
        piece.heading_rad + piece.curvature_pm * (chainage_m - piece.anchor_m)
    }

    /// Converts a point to its chainage, and to y and z relative to the nearest point of the axis, m.
    pub fn chart(&self, point: Point3<Tunnel>) -> [f64; 3] {
        let (_, chainage_m, y) = self.locate([point.x(), point.y()]);
        [chainage_m, y, point.z()]
    }

    /// Number of the piece nearest to a point, the point's chainage, m, and its distance to the left of the axis, m.
    pub(super) fn locate(&self, plan: Yz) -> (usize, f64, f64) {
        let mut nearest = (0, 0.0, 0.0);
        let mut least = f64::INFINITY;
        for (number, piece) in self.pieces.iter().enumerate() {
            if self.pieces.len() > 1 && piece.is_beyond(plan, least) {
                continue;
            }
            let (chainage_m, y) = piece.chart(plan);
            // Beyond the end of a piece, the distance to this end is added, so that every point has a nearest piece.
            let missed = (piece.from_m - chainage_m).max(chainage_m - piece.to_m).max(0.0);
            let distance = y.abs() + missed;
            if distance < least {
                least = distance;
                nearest = (number, chainage_m, y);
            }
        }
        nearest
    }

    /// The pieces of the axis in order of chainage.
    pub(super) fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    /// Number of the axis piece at `chainage_m`, and the piece.
    pub(super) fn piece_at(&self, chainage_m: f64) -> (usize, &Piece) {
        let after = self.pieces.partition_point(|piece| piece.from_m <= chainage_m).max(1);
        let number = after.min(self.pieces.len()) - 1;
        (number, &self.pieces[number])
    }

    /// Point and direction of the axis at `chainage_m`.
    pub(super) fn station(&self, chainage_m: f64) -> Station {
        self.piece_at(chainage_m).1.station(chainage_m)
    }

    /// Absolute curvature of the axis in its tightest bend, 1/m.
    pub(super) fn largest_curvature_pm(&self) -> f64 {
        self.pieces.iter().map(|piece| piece.curvature_pm.abs()).fold(0.0, f64::max)
    }
}

impl Piece {
    fn new(from_m: f64, at: Yz, heading_rad: f64, length_m: f64, curvature_pm: f64) -> Self {
        let start = Self {
            from_m,
            to_m: from_m + length_m,
            anchor_m: from_m,
            at,
            heading_rad,
            tangent: direction(heading_rad),
            curvature_pm,
        };
        if curvature_pm == 0.0 {
            return start;
        }
        // Angles about the centre of an arc are measured from the middle of the arc, so that they stay within a quarter
        // turn, far from the wrap at half a turn.
        let anchor_m = from_m + length_m / 2.0;
        let heading_rad = heading_rad + curvature_pm * length_m / 2.0;
        let Station { at, tangent } = start.station(anchor_m);
        Self { anchor_m, at, heading_rad, tangent, ..start }
    }

    /// Curvature of the piece, positive to the left, 1/m.
    pub(super) fn curvature_pm(&self) -> f64 {
        self.curvature_pm
    }

    /// Point and direction at `chainage_m`, also beyond the ends of the piece.
    pub(super) fn station(&self, chainage_m: f64) -> Station {
        let along_m = chainage_m - self.anchor_m;
        let [tx, ty] = self.tangent;
        if self.curvature_pm == 0.0 {
            return Station {
                at: [self.at[0] + along_m * tx, self.at[1] + along_m * ty],
                tangent: self.tangent,
            };
        }
        let turned_rad = along_m * self.curvature_pm;
        let (sin, cos) = math::sin_cos(turned_rad);
        // `1 - cos` is computed from half the angle, because the direct form loses digits in a wide bend.
        let half = math::sin(turned_rad / 2.0);
        let (ahead, left) = (sin / self.curvature_pm, 2.0 * half * half / self.curvature_pm);
        Station {
            at: [self.at[0] + ahead * tx - left * ty, self.at[1] + ahead * ty + left * tx],
            tangent: [tx * cos - ty * sin, ty * cos + tx * sin],
        }
    }

    /// Distance of a point to the left of the axis, m.
    pub(super) fn left_of(&self, plan: Yz) -> f64 {
        let (ahead, left) = self.relative(plan);
        if self.curvature_pm == 0.0 {
            return left;
        }
        let radius_m = 1.0 / self.curvature_pm;
        // With a positive radius the centre is to the left of the axis. The distance to the axis is the radius minus
        // the distance to the centre.
        radius_m - radius_m.signum() * math::sqrt(ahead * ahead + (radius_m - left) * (radius_m - left))
    }

    /// Chainage of a point, and its distance to the left of the axis, m.
    pub(super) fn chart(&self, plan: Yz) -> (f64, f64) {
        let (ahead, left) = self.relative(plan);
        if self.curvature_pm == 0.0 {
            return (self.anchor_m + ahead, left);
        }
        let radius_m = 1.0 / self.curvature_pm;
        let turned = math::atan2(ahead, (radius_m - left) * radius_m.signum());
        (self.anchor_m + radius_m.abs() * turned, self.left_of(plan))
    }

    /// Whether this piece is certainly farther than `least_m` from the point `plan`.
    fn is_beyond(&self, plan: Yz, least_m: f64) -> bool {
        let (ahead, left) = self.relative(plan);
        let reach_m = least_m + (self.to_m - self.anchor_m).max(self.anchor_m - self.from_m);
        ahead * ahead + left * left > reach_m * reach_m
    }

    fn relative(&self, plan: Yz) -> (f64, f64) {
        let (dx, dy) = (plan[0] - self.at[0], plan[1] - self.at[1]);
        let [tx, ty] = self.tangent;
        (dx * tx + dy * ty, dy * tx - dx * ty)
    }
}

fn direction(heading_rad: f64) -> Yz {
    let (sin, cos) = math::sin_cos(heading_rad);
    [cos, sin]
}

/// Reads the length, m, and the curvature, 1/m, of one piece.
fn parse_piece(section: &Section<'_>, half_width_m: f64) -> Result<(f64, f64), ConfigError> {
    let length_m = section.number("length_m", 0.01..=1.0e5)?;
    let radius_m = section.number("radius_m", 0.1..=1.0e5)?;
    let turn_deg = section.number("turn_deg", -180.0..=180.0)?;
    let Some(radius_m) = radius_m else {
        if turn_deg.is_some() {
            return Err(section.invalid("turn_deg", "needs radius_m: only an arc has a turn"));
        }
        return Ok((section.required("length_m", length_m)?, 0.0));
    };
    if length_m.is_some() {
        let problem = "cannot be combined with radius_m; an arc's length follows from radius_m and turn_deg";
        return Err(section.invalid("length_m", problem));
    }
    let turn_deg = section.required("turn_deg", turn_deg)?;
    if turn_deg.abs() < 0.01 {
        return Err(section.invalid("turn_deg", "must be at least 0.01 degrees either way"));
    }
    let least_m = LEAST_RADIUS_HALF_WIDTHS * half_width_m;
    if radius_m < least_m {
        let problem = format!("must be at least {least_m:.3} m, the tunnel's width");
        return Err(section.invalid("radius_m", &problem));
    }
    Ok((radius_m * turn_deg.abs().to_radians(), turn_deg.signum() / radius_m))
}
