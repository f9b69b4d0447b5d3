//! Occlusion of a head's beam by the vehicle: neighbouring heads and the hull.

use super::head::{HeadSpec, MAX_HEADS};
use headrace_geometry::frames::{Body, Mount, Vec3, head_direction};
use headrace_geometry::math::{self, TAU};

/// Angular spacing of the rays that search for obstructions, radians (0.05 degrees). Narrower obstructions may be
/// missed.
const SEARCH_STEP_RAD: f64 = TAU / 7200.0;

/// A solid part of the vehicle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Obstacle {
    /// A box along the body's axes, m.
    Box {
        /// The corner with the smallest coordinates.
        least: Vec3<Body>,
        /// The corner with the largest coordinates.
        most: Vec3<Body>,
    },
    /// A cylinder with flat ends.
    Cylinder {
        /// Centre of the first end.
        from: Vec3<Body>,
        /// Vector from the first end's centre to the other end's centre, m.
        along: Vec3<Body>,
        /// Radius of the cylinder, m.
        radius_m: f64,
    },
}

/// A range of beam angles of a head, in the sensor's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AngleRange {
    /// Start angle of the range, radians, in [0, 2 pi).
    pub from_rad: f64,
    /// Size of the range, radians, up to 2 pi.
    pub size_rad: f64,
}

impl AngleRange {
    /// Whether the range contains an angle; the ends belong to the range.
    pub fn has(&self, angle_rad: f64) -> bool {
        math::wrap(angle_rad - self.from_rad, TAU) <= self.size_rad
    }

    /// Middle of the angle range, radians.
    pub fn middle_rad(&self) -> f64 {
        self.from_rad + self.size_rad / 2.0
    }

    /// Returns this range as angles in the body frame, for pictures. A head that is mounted straight measures these
    /// angles.
    ///
    /// 0 is down, and angles grow to the vehicle's left. The angles of a head that faces aft grow in the opposite
    /// sense.
    #[must_use]
    pub fn across_body(&self, mount: &Mount) -> Self {
        let across = |angle_rad: f64| {
            let direction = mount.rotation * head_direction(angle_rad);
            math::atan2(direction.y(), -direction.z())
        };
        let [from, middle] = [0.0, 0.5].map(|share| across(self.from_rad + share * self.size_rad));
        let half = math::wrap_signed(middle - from, TAU);
        let turns = if half < 0.0 { -1.0 } else { 1.0 };
        let first = if half < 0.0 { across(self.from_rad + self.size_rad) } else { from };
        let size_rad = match self.size_rad {
            whole if whole >= TAU => TAU,
            _ => math::wrap(turns * (across(self.from_rad + self.size_rad) - from), TAU),
        };
        Self { from_rad: math::wrap(first, TAU), size_rad }
    }
}

impl Obstacle {
    /// Returns the cylinder of a head's body.
    pub fn of_head(spec: &HeadSpec) -> Self {
        let along = |x_m| spec.mount.rotation * Vec3::new(x_m, 0.0, 0.0);
        Self::Cylinder {
            from: spec.mount.position + along(-spec.body.behind_m),
            along: along(spec.body.behind_m + spec.body.ahead_m),
            radius_m: spec.body.radius_m,
        }
    }

    /// Whether a point is inside a box.
    ///
    /// Always false for cylinders, because these represent heads, and heads may share a position.
    pub fn holds(&self, place: Vec3<Body>) -> bool {
        match self {
            Self::Box { least, most } => {
                let within = |((low, at), high): ((&f64, &f64), &f64)| low < at && at < high;
                least.0.iter().zip(place.0.iter()).zip(most.0.iter()).all(within)
            }
            Self::Cylinder { .. } => false,
        }
    }

    /// Whether a ray from outside meets the obstacle.
    ///
    /// A ray from inside does not meet the obstacle, so an obstacle around a head does not hide the wall from this
    /// head.
    pub fn stops(&self, from: Vec3<Body>, direction: Vec3<Body>) -> bool {
        self.enters_m(from, direction).is_some()
    }

    /// Distance at which a ray from outside meets the obstacle, in lengths of `direction`.
    ///
    /// The distance is in metres for a unit vector. `None` for a ray that misses the obstacle or begins inside.
    pub fn enters_m(&self, from: Vec3<Body>, direction: Vec3<Body>) -> Option<f64> {
        match self {
            Self::Box { least, most } => box_entered(*least, *most, from, direction),
            Self::Cylinder { from: base, along, radius_m } => {
                cylinder_entered(*base, *along, *radius_m, from, direction)
            }
        }
    }
}

fn box_entered(least: Vec3<Body>, most: Vec3<Body>, from: Vec3<Body>, direction: Vec3<Body>) -> Option<f64> {
    let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
    let axes = least.0.iter().zip(most.0.iter()).zip(from.0.iter().zip(direction.0.iter()));
    for ((low, high), (at, towards)) in axes {
        if *towards == 0.0 {
            if at <= low || at >= high {
                return None;
            }
            continue;
        }
        let (a, b) = ((low - at) / towards, (high - at) / towards);
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    (enter > 0.0 && enter < leave).then_some(enter)
}

fn cylinder_entered(
    base: Vec3<Body>,
    along: Vec3<Body>,
    radius_m: f64,
    from: Vec3<Body>,
    direction: Vec3<Body>,
) -> Option<f64> {
    let length_m = along.norm();
    if radius_m <= 0.0 || length_m <= 0.0 {
        return None;
    }
    let axis = along.scaled(1.0 / length_m).0;
    let (offset, direction) = ((from + -base).0, direction.0);
    let (height, climb) = (offset.dot(&axis), direction.dot(&axis));
    let (across, drift) = (offset - axis * height, direction - axis * climb);
    // First, the part of the ray inside an infinitely long cylinder is found. Then, this part is limited to the
    // cylinder's ends.
    let (a, b) = (drift.dot(&drift), across.dot(&drift));
    let c = across.dot(&across) - radius_m * radius_m;
    let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
    if a > 0.0 {
        let discriminant = b * b - a * c;
        if discriminant <= 0.0 {
            return None;
        }
        let root = math::sqrt(discriminant);
        (enter, leave) = ((-b - root) / a, (-b + root) / a);
    } else if c >= 0.0 {
        return None;
    }
    if climb == 0.0 {
        if height <= 0.0 || height >= length_m {
            return None;
        }
    } else {
        let (first, second) = (-height / climb, (length_m - height) / climb);
        enter = enter.max(first.min(second));
        leave = leave.min(first.max(second));
    }
    (enter > 0.0 && enter < leave).then_some(enter)
}

/// Returns the angles at which obstacles hide the wall from a head, in ascending order.
///
/// Edges are exact to 1e-12 rad. The beam is idealised as a ray. A real beam is also weakened within half of its
/// width on either side of these angles.
pub fn hidden_angles(mount: &Mount, obstacles: &[Obstacle]) -> Vec<AngleRange> {
    let hidden = |angle_rad: f64| {
        let direction = mount.rotation * head_direction(angle_rad);
        obstacles.iter().any(|obstacle| obstacle.stops(mount.position, direction))
    };
    let count = math::round_to_i64(TAU / SEARCH_STEP_RAD);
    let at = |k: i64| k as f64 * SEARCH_STEP_RAD;
    let Some(first_clear) = (0..count).find(|k| !hidden(at(*k))) else {
        return vec![AngleRange { from_rad: 0.0, size_rad: TAU }];
    };
    let mut found = Vec::new();
    let mut began = None;
    let mut before = false;
    for k in first_clear + 1..=first_clear + count {
        let now = hidden(at(k));
        if now != before {
            let edge = edge_rad(&hidden, at(k - 1), at(k));
            match began.take() {
                None => began = Some(edge),
                Some(from) => {
                    found.push(AngleRange { from_rad: math::wrap(from, TAU), size_rad: edge - from });
                }
            }
        }
        before = now;
    }
    found.sort_by(|a, b| a.from_rad.total_cmp(&b.from_rad));
    found
}

/// Finds the edge of a hidden range between two angles by bisection.
fn edge_rad(hidden: &impl Fn(f64) -> bool, from_rad: f64, to_rad: f64) -> f64 {
    let (mut low, mut high) = (from_rad, to_rad);
    let at_low = hidden(low);
    while high - low > 1e-13 * (1.0 + high.abs()) {
        let middle = f64::midpoint(low, high);
        if hidden(middle) == at_low {
            low = middle;
        } else {
            high = middle;
        }
    }
    f64::midpoint(low, high)
}

/// Returns for each head the angles at which other heads or the hull hide the wall.
///
/// A neighbour whose axis runs through the head hides nothing, because such heads are treated as being at one position.
pub fn hidden_by_vehicle(heads: &[HeadSpec], hull: &[Obstacle]) -> Vec<Vec<AngleRange>> {
    heads
        .iter()
        .take(MAX_HEADS)
        .enumerate()
        .map(|(number, head)| {
            let others = heads.iter().enumerate().filter(|(other, _)| *other != number);
            let obstacles: Vec<Obstacle> =
                others.map(|(_, other)| Obstacle::of_head(other)).chain(hull.iter().copied()).collect();
            hidden_angles(&head.mount, &obstacles)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures;

    fn head(position: [f64; 3], aft: bool) -> HeadSpec {
        fixtures::head(position, aft, 0.04)
    }

    /// A point on a side of the box counts as outside, and so does a point that is inside in only two of three
    /// coordinates.
    ///
    /// Cylinders contain no point.
    #[test]
    fn box_contains_points_inside_all_its_sides() {
        let hull = Obstacle::Box { least: Vec3::new(-1.0, -0.3, -0.2), most: Vec3::new(0.5, 0.3, 0.2) };
        let holds = |at: [f64; 3]| hull.holds(Vec3::new(at[0], at[1], at[2]));
        assert!(holds([0.0, 0.0, 0.0]) && holds([0.49, -0.29, 0.19]));
        for (axis, [low, high]) in [[-1.0, 0.5], [-0.3, 0.3], [-0.2, 0.2]].into_iter().enumerate() {
            for beyond in [low, high, 2.0 * low, 2.0 * high] {
                let mut at = [0.0; 3];
                at[axis] = beyond;
                assert!(!holds(at), "{at:?}");
            }
        }
        assert!(!Obstacle::of_head(&head([0.0; 3], false)).holds(Vec3::zero()));
    }

    #[test]
    fn side_by_side_heads_hide_an_angle_from_each_other() {
        let pair = [head([0.5, 0.15, 0.0], false), head([0.5, -0.15, 0.0], false)];
        let hidden = hidden_by_vehicle(&pair, &[]);
        for (ranges, middle_deg) in hidden.iter().zip([270.0, 90.0]) {
            assert_eq!(ranges.len(), 1);
            // The tangent to a cylinder of radius r at a distance g is asin(r / g) off the direction to its axis.
            let expected = 2.0 * math::asin(0.04 / 0.3);
            assert!((ranges[0].size_rad - expected).abs() < 1e-11, "{}", ranges[0].size_rad.to_degrees());
            assert!((ranges[0].middle_rad().to_degrees() - middle_deg).abs() < 1e-9);
            assert!((ranges[0].size_rad.to_degrees() - 15.1).abs() < 0.3);
        }
    }

    #[test]
    fn each_head_occludes_its_neighbours_beams_in_any_orientation() {
        for aft in [false, true] {
            let pair = [head([0.5, 0.15, 0.0], aft), head([0.5, -0.15, 0.0], aft)];
            // The left head's hidden range lies to the right, at 270 degrees. The right head's hidden range lies to
            // the left.
            for ((ranges, spec), middle_deg) in
                hidden_by_vehicle(&pair, &[]).iter().zip(&pair).zip([270.0, 90.0])
            {
                let across = ranges[0].across_body(&spec.mount);
                assert!((across.middle_rad().to_degrees() - middle_deg).abs() < 1e-9, "{across:?}");
                assert!((across.size_rad - ranges[0].size_rad).abs() < 1e-9);
            }
        }
        let mount = head([0.0; 3], true).mount;
        // Angles of an aft-facing head are mirrored: its quarter turn that begins at 10 degrees becomes a quarter turn
        // that ends at -10 degrees.
        let quarter = AngleRange { from_rad: 10_f64.to_radians(), size_rad: TAU / 4.0 }.across_body(&mount);
        assert!((quarter.from_rad.to_degrees() - 260.0).abs() < 1e-9, "{quarter:?}");
        assert!(quarter.has(300_f64.to_radians()) && !quarter.has(355_f64.to_radians()));
    }

    #[test]
    fn heads_in_line_or_at_one_position_hide_nothing() {
        let apart = [head([0.551, 0.1, 0.0], false), head([-0.551, -0.1, 0.0], true)];
        assert!(hidden_by_vehicle(&apart, &[]).iter().all(Vec::is_empty));
        let together = [head([0.0; 3], false), head([0.0; 3], false)];
        assert!(hidden_by_vehicle(&together, &[]).iter().all(Vec::is_empty));
        // The heads are back to back. Each body extends 0.2 m behind its beam, so the bodies overlap along the hull.
        let near = [head([0.1, 0.1, 0.0], false), head([-0.05, -0.1, 0.0], true)];
        assert!(hidden_by_vehicle(&near, &[]).iter().all(|ranges| ranges.len() == 1));
    }

    #[test]
    fn hull_below_hides_the_floor_across_the_angle_seam() {
        let hull = Obstacle::Box { least: Vec3::new(-1.0, -0.2, -0.5), most: Vec3::new(1.0, 0.2, -0.1) };
        let hidden = hidden_angles(&head([0.0; 3], false).mount, &[hull]);
        assert_eq!(hidden.len(), 1);
        let expected = 2.0 * math::atan2(0.2, 0.1);
        assert!((hidden[0].size_rad - expected).abs() < 1e-11);
        assert!(hidden[0].has(0.0) && hidden[0].has(TAU - 0.1) && !hidden[0].has(math::PI));
    }

    #[test]
    fn ray_from_outside_enters_at_its_first_contact() {
        let x = Vec3::new(1.0, 0.0, 0.0);
        let hull = Obstacle::Box { least: Vec3::new(2.0, -1.0, -1.0), most: Vec3::new(3.0, 1.0, 1.0) };
        assert_eq!(hull.enters_m(Vec3::zero(), x), Some(2.0));
        assert_eq!(hull.enters_m(Vec3::zero(), x.scaled(-1.0)), None);
        assert_eq!(hull.enters_m(Vec3::new(2.5, 0.0, 0.0), x), None);
        let post = Obstacle::Cylinder {
            from: Vec3::new(2.0, 0.0, -1.0),
            along: Vec3::new(0.0, 0.0, 2.0),
            radius_m: 0.5,
        };
        assert_eq!(post.enters_m(Vec3::zero(), x), Some(1.5));
        assert_eq!(post.enters_m(Vec3::new(2.0, 0.0, 4.0), Vec3::new(0.0, 0.0, -1.0)), Some(3.0));
        assert_eq!(post.enters_m(Vec3::new(2.0, 0.0, 0.0), x), None);
    }

    #[test]
    fn box_around_a_head_hides_no_angle_but_tube_around_it_hides_all_angles() {
        let around = Obstacle::Box { least: Vec3::new(-1.0, -1.0, -1.0), most: Vec3::new(1.0, 1.0, 1.0) };
        assert!(hidden_angles(&head([0.0; 3], false).mount, &[around]).is_empty());
        let ring: Vec<Obstacle> = (0..4)
            .map(|k| {
                let (sine, cosine) = math::sin_cos(f64::from(k) * math::FRAC_PI_2);
                Obstacle::Cylinder {
                    from: Vec3::new(-1.0, sine, cosine),
                    along: Vec3::new(2.0, 0.0, 0.0),
                    radius_m: 0.9,
                }
            })
            .collect();
        assert_eq!(
            hidden_angles(&head([0.0; 3], false).mount, &ring),
            [AngleRange { from_rad: 0.0, size_rad: TAU }]
        );
    }

    #[test]
    fn cylinder_hits_agree_with_points_along_the_ray() {
        let cylinder = Obstacle::Cylinder {
            from: Vec3::new(0.3, 0.2, -0.4),
            along: Vec3::new(0.2, -0.1, 0.5),
            radius_m: 0.15,
        };
        let axis = Vec3::<Body>::new(0.2, -0.1, 0.5);
        let inside = |p: Vec3<Body>| {
            let offset = p + -Vec3::new(0.3, 0.2, -0.4);
            let height = offset.0.dot(&axis.0) / axis.norm();
            (offset.0 - axis.0 * (height / axis.norm())).norm() < 0.15 && (0.0..axis.norm()).contains(&height)
        };
        let mut met = 0;
        for k in 0..4000 {
            let (a, b) = (f64::from(k) * 0.618, f64::from(k) * 0.377);
            let ((sa, ca), (sb, cb)) = (math::sin_cos(a), math::sin_cos(b));
            let direction = Vec3::new(ca * cb, sa * cb, sb);
            let marched = (0..4000).any(|i| inside(direction.scaled(f64::from(i) * 5e-4)));
            let stops = cylinder.stops(Vec3::zero(), direction);
            if let Some(enters_m) = cylinder.enters_m(Vec3::zero(), direction) {
                assert!(!inside(direction.scaled(enters_m - 1e-9)), "direction {direction:?}");
                assert!(inside(direction.scaled(enters_m + 1e-9)) || !marched, "direction {direction:?}");
            }
            // The reference result comes from points at small steps along the ray, so it may miss a cylinder that the
            // ray only grazes.
            assert!(stops || !marched, "direction {direction:?}");
            met += i32::from(stops && marched) - i32::from(stops && !marched);
        }
        assert!(met > 80, "{met}");
    }
}
