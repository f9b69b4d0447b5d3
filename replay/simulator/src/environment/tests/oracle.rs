//! An independent model of the simulated environment. It tests whether points are in water, and follows rays in small
//! steps.

use super::*;

/// Length of the model's steps along a ray, m.
const STEP_M: f64 = 2e-3;
/// Length over which the model follows rays, m.
pub(super) const FAR_M: f64 = 20.0;

/// A tunnel profile with a closed form for its wall.
#[derive(Clone, Copy)]
pub(super) enum Shape {
    Circle(f64),
    Rectangle(f64, f64),
    Trimmed(f64, f64),
}

/// A function that tests whether a point is in an object. The first argument is the point in the tunnel's frame. The
/// second is the same point as chainage, y and z.
pub(super) type Test = Box<dyn Fn(V3, V3) -> bool>;

pub(super) struct Oracle {
    pub(super) shape: Shape,
    /// Length, m, and signed curvature, 1/m, of each piece of the axis.
    pub(super) axis: Vec<(f64, f64)>,
    pub(super) stations: Vec<(f64, f64)>,
    /// Chainage, length, arc length, width and depth of each bulge, m.
    pub(super) bulges: Vec<[f64; 5]>,
    pub(super) hollows: Vec<Test>,
    pub(super) solids: Vec<Test>,
}

impl Shape {
    pub(super) fn profile(self) -> Profile {
        match self {
            Self::Circle(radius) => shapes::circle(radius),
            Self::Rectangle(width, height) => shapes::rectangle(width, height),
            Self::Trimmed(radius, base) => shapes::trimmed_circle(radius, base),
        }
        .unwrap()
    }

    fn reference_m(self) -> f64 {
        match self {
            Self::Circle(radius) => radius,
            Self::Rectangle(_, height) => height / 2.0,
            Self::Trimmed(radius, base) => math::sqrt(radius * radius - base * base / 4.0),
        }
    }

    /// Distance from the reference point to the wall in a direction, and the arc length of that wall point.
    fn wall(self, [dy, dz]: [f64; 2]) -> (f64, f64) {
        // Angle of a direction from straight down, growing to the left.
        let angle = math::wrap(math::atan2(dy, -dz), math::TAU);
        match self {
            Self::Circle(radius) => (radius, radius * angle),
            Self::Trimmed(radius, base) => {
                let height = self.reference_m();
                let corner = math::atan2(base / 2.0, height);
                let rest = radius * (math::TAU - 2.0 * corner) + base;
                if angle < corner {
                    (height / -dz, height * math::tan(angle))
                } else if angle > math::TAU - corner {
                    (height / -dz, rest + height * math::tan(angle))
                } else {
                    (radius, base / 2.0 + radius * (angle - corner))
                }
            }
            Self::Rectangle(width, height) => {
                let (a, b) = (width / 2.0 / dy.abs(), height / 2.0 / dz.abs());
                let range = a.min(b);
                let (y, z) = (range * dy, range * dz + height / 2.0);
                let perimeter = 2.0 * (width + height);
                let sigma = match (a < b, dy > 0.0, dz > 0.0) {
                    (true, true, _) => width / 2.0 + z,
                    (true, false, _) => perimeter - width / 2.0 - z,
                    (false, _, true) => width + height - y,
                    (false, _, false) => math::wrap(y, perimeter),
                };
                (range, sigma)
            }
        }
    }

    fn perimeter(self) -> f64 {
        self.wall([-1e-12, -1.0]).1
    }
}

impl Oracle {
    pub(super) fn new(shape: Shape) -> Self {
        Self {
            shape,
            axis: Vec::new(),
            stations: Vec::new(),
            bulges: Vec::new(),
            hollows: Vec::new(),
            solids: Vec::new(),
        }
    }

    /// Point and heading of the axis, summed piece by piece.
    pub(super) fn station(&self, s: f64) -> ([f64; 2], f64) {
        let (mut at, mut heading, mut rest) = ([0.0, 0.0], 0.0, s);
        for (length, curvature) in &self.axis {
            if rest <= 0.0 {
                break;
            }
            let part = rest.min(*length);
            // The chord of an arc follows from the sine of half the turn. The chord points along the heading at the
            // middle of the arc.
            let half = curvature * part / 2.0;
            let chord = if half == 0.0 { part } else { 2.0 * math::sin(half) / curvature };
            at[0] += chord * math::cos(heading + half);
            at[1] += chord * math::sin(heading + half);
            heading += 2.0 * half;
            rest -= part;
        }
        ([at[0] + rest * math::cos(heading), at[1] + rest * math::sin(heading)], heading)
    }

    /// Chainage and y of a point, by Newton's method from an estimate of the chainage.
    fn chart(&self, p: V3, guess: f64) -> V3 {
        if self.axis.is_empty() {
            return p;
        }
        let mut s = guess;
        for _ in 0..8 {
            let (at, heading) = self.station(s);
            let (cos, sin) = (math::cos(heading), math::sin(heading));
            let (dx, dy) = (p[0] - at[0], p[1] - at[1]);
            let (ahead, left) = (dx * cos + dy * sin, dy * cos - dx * sin);
            let curvature = (self.station(s + 1e-3).1 - self.station(s - 1e-3).1) / 2e-3;
            if ahead.abs() < 1e-12 {
                return [s, left, p[2]];
            }
            s += ahead / (1.0 - curvature * left);
        }
        let (at, heading) = self.station(s);
        [s, (p[1] - at[1]) * math::cos(heading) - (p[0] - at[0]) * math::sin(heading), p[2]]
    }

    /// Chainage and y of a point, searched without an estimate.
    pub(super) fn search(&self, p: V3) -> V3 {
        let distance = |s: &f64| {
            let (at, _) = self.station(*s);
            (at[0] - p[0]) * (at[0] - p[0]) + (at[1] - p[1]) * (at[1] - p[1])
        };
        let nearest = (-20..=120).map(f64::from).min_by(|a, b| distance(a).total_cmp(&distance(b)));
        self.chart(p, nearest.unwrap())
    }

    fn scale(&self, s: f64) -> f64 {
        let Some(first) = self.stations.first() else { return 1.0 };
        let mut scale = first.1;
        for pair in self.stations.windows(2) {
            let share = ((s - pair[0].0) / (pair[1].0 - pair[0].0)).clamp(0.0, 1.0);
            scale += share * (pair[1].1 - pair[0].1);
        }
        scale
    }

    fn in_tube(&self, [s, y, z]: V3) -> bool {
        let scale = self.scale(s);
        let (v, w) = (y, z - scale * self.shape.reference_m());
        let rho = math::sqrt(v * v + w * w);
        let (wall, sigma) = self.shape.wall([v / rho, w / rho]);
        let perimeter = self.shape.perimeter();
        let mut radius = wall * scale;
        for [at, length, middle, width, depth] in &self.bulges {
            let a = 2.0 * (s - at) / length;
            let b = 2.0 * math::wrap_signed(sigma - middle, perimeter) / width;
            if a.abs() < 1.0 && b.abs() < 1.0 {
                let (u, v) = (math::cos(a * math::PI / 2.0), math::cos(b * math::PI / 2.0));
                radius -= depth * u * u * v * v;
            }
        }
        rho < radius
    }

    pub(super) fn is_water(&self, p: V3, chart: V3) -> bool {
        (self.in_tube(chart) || self.hollows.iter().any(|test| test(p, chart)))
            && !self.solids.iter().any(|test| test(p, chart))
    }

    /// Range of the first point along the ray that is not in water. The search goes in steps of `step` from range
    /// `from` to `far`.
    pub(super) fn range(&self, ray: &Ray, from: f64, far: f64, step: f64) -> Option<f64> {
        let mut chart = self.search(ray.at(from));
        let mut t = from;
        while t < far {
            let next = t + step;
            let p = ray.at(next);
            chart = self.chart(p, chart[0]);
            // Far from the axis, the nearest point of the axis may jump between steps, so the nearest point is searched
            // without an estimate.
            if chart[1].abs() > 8.0 && !self.axis.is_empty() {
                chart = self.search(p);
            }
            if !self.is_water(p, chart) {
                let (mut below, mut above) = (t, next);
                for _ in 0..50 {
                    let middle = f64::midpoint(below, above);
                    let p = ray.at(middle);
                    if self.is_water(p, self.chart(p, chart[0])) { below = middle } else { above = middle }
                }
                return Some(above);
            }
            t = next;
        }
        None
    }

    /// Compares thousands of rays with this model. Returns the number of rays that hit each feature.
    ///
    /// Two differences are allowed. The model's steps of 2 mm may miss an object that a ray grazes, but smaller steps
    /// must then find the object. The environment may miss a graze that is shorter than its own smallest step.
    pub(super) fn compare(
        &self,
        environment: &Environment,
        seed: u64,
        rays: usize,
        s: [f64; 2],
    ) -> Vec<usize> {
        let mut lcg = Lcg(seed);
        let mut met = vec![0; environment.features().len()];
        let (mut cast_rays, mut odd_normals) = (0, 0);
        while cast_rays < rays {
            let place = environment
                .axis()
                .place(lcg.between(s[0], s[1]), [lcg.between(-8.0, 8.0), lcg.between(-2.0, 9.0)]);
            let origin = [place.x(), place.y(), place.z()];
            let water = self.is_water(origin, self.search(origin));
            assert_eq!(environment.is_water(place), water, "water at {place:?}");
            if !water {
                assert!(
                    cast(environment, origin, lcg.direction()).is_none(),
                    "a ray from the rock at {place:?}"
                );
                continue;
            }
            cast_rays += 1;
            let ray = Ray { origin, direction: lcg.direction() };
            let found = environment.cast(place, to_vec(ray.direction), FAR_M);
            self.check(&ray, found.map(|hit| hit.range_m));
            assert_eq!(
                environment.range_m(place, to_vec(ray.direction), FAR_M).map(f64::to_bits),
                found.map(|hit| hit.range_m.to_bits())
            );
            let Some(hit) = found else { continue };
            if let What::Feature(number) = hit.what {
                met[usize::from(number)] += 1;
            }
            assert!((hit.normal.norm() - 1.0).abs() < 1e-9, "{hit:?}");
            odd_normals += usize::from(!self.is_normal(&hit));
        }
        assert!(odd_normals * 50 <= rays, "{odd_normals} of {rays} normals do not separate water from rock");
        met
    }

    fn is_normal(&self, hit: &Hit) -> bool {
        let at = |by: f64| {
            let p = hit.point + hit.normal.scaled(by);
            let p = [p.x(), p.y(), p.z()];
            self.is_water(p, self.search(p))
        };
        at(1e-4) && !at(-1e-4)
    }

    fn check(&self, ray: &Ray, found: Option<f64>) {
        let wanted = self.range(ray, 0.0, FAR_M, STEP_M).filter(|range| *range <= FAR_M);
        let (found, wanted) = (found.unwrap_or(FAR_M), wanted.unwrap_or(FAR_M));
        if (found - wanted).abs() < 1e-6 {
            return;
        }
        if found < wanted {
            let closer = self.range(ray, (found - 1e-3).max(0.0), found + 1e-3, 1e-6);
            let missed = closer.map_or(f64::INFINITY, |range| (range - found).abs());
            assert!(missed < 2e-6, "{ray:?}: found {found}, wanted {wanted}, closer {closer:?}");
        } else {
            let p = ray.at(wanted + 1.5e-4);
            let again = self.is_water(p, self.search(p));
            assert!(again, "{ray:?}: found {found}, wanted {wanted}");
        }
    }
}

/// Returns a function that tests whether a point of a straight tunnel is in a box with sides along the axes.
pub(super) fn upright(least: V3, most: V3) -> Test {
    Box::new(move |p, _| (0..3).all(|k| (least[k]..=most[k]).contains(&p[k])))
}

/// Returns a function that tests whether a point is in an ellipsoid with its axes along x, y and z.
pub(super) fn ellipsoid(centre: V3, half: V3) -> Test {
    Box::new(move |p, _| {
        (0..3).map(|k| (p[k] - centre[k]) * (p[k] - centre[k]) / half[k] / half[k]).sum::<f64>() < 1.0
    })
}
