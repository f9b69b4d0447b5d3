//! Deviation of the wall from the design profile, per section.

use serde::{Deserialize, Serialize};

use headrace_geometry::tunnel::{Profile, Yz};

/// Deviation of a section's samples from the design profile. Outward is positive.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Deviation {
    samples: u32,
    /// Number of samples that deviate by more than the contradiction limit.
    contradicting: u32,
    /// Number of contradicting samples that confirm the wall which another head has found.
    confirming: u32,
    sum_m: f64,
    /// Largest inward deviation, m; never above zero.
    inmost_m: f64,
    /// Largest outward deviation, m; never below zero.
    outmost_m: f64,
    /// Area between the reference point and the sampled wall (`swept_m2`), and area of the design profile over the same
    /// angles, m2.
    swept_m2: f64,
    design_m2: f64,
}

impl Deviation {
    /// Adds a sample at `point` with arc length `arc_m`.
    ///
    /// `before` is the same head's sample one step earlier, with its arc length. Deviation and arc length are both
    /// measured along the ray from the profile's reference point. `is_confirming` means that another head has found
    /// wall with the same deviation at the same place.
    pub fn add(
        &mut self,
        profile: &Profile,
        (point, arc_m): (Yz, f64),
        before: Option<(Yz, f64)>,
        (contradiction_m, is_confirming): (f64, bool),
    ) {
        let centre = profile.reference();
        let design = profile.point_at(arc_m);
        let off_m = off_m(profile, point, arc_m);
        self.samples += 1;
        let contradicts = off_m.abs() > contradiction_m;
        self.contradicting += u32::from(contradicts);
        self.confirming += u32::from(contradicts && is_confirming);
        self.sum_m += off_m;
        self.inmost_m = self.inmost_m.min(off_m);
        self.outmost_m = self.outmost_m.max(off_m);
        if let Some((last, last_arc_m)) = before {
            self.swept_m2 += triangle_m2(centre, last, point);
            self.design_m2 += triangle_m2(centre, profile.point_at(last_arc_m), design);
        }
    }

    /// Adds the deviations of another section's samples.
    pub fn merge(&mut self, other: &Self) {
        self.samples += other.samples;
        self.contradicting += other.contradicting;
        self.confirming += other.confirming;
        self.sum_m += other.sum_m;
        self.inmost_m = self.inmost_m.min(other.inmost_m);
        self.outmost_m = self.outmost_m.max(other.outmost_m);
        self.swept_m2 += other.swept_m2;
        self.design_m2 += other.design_m2;
    }

    /// Mean deviation, m; `None` without samples.
    pub fn mean_m(&self) -> Option<f64> {
        (self.samples > 0).then(|| self.sum_m / f64::from(self.samples))
    }

    /// Largest inward and outward deviation, m; `None` without samples.
    pub fn extremes_m(&self) -> Option<[f64; 2]> {
        (self.samples > 0).then_some([self.inmost_m, self.outmost_m])
    }

    /// Ratio of the swept cross-section area to the design's area; `None` without sweeps.
    pub fn area_ratio(&self) -> Option<f64> {
        (self.design_m2 > 0.0).then(|| self.swept_m2 / self.design_m2)
    }

    /// Whether most samples deviate from the design by more than the contradiction limit, and no other head confirms
    /// them.
    ///
    /// Then the profile, the position or the head may be wrong. A confirming sample counts for two: for itself, and for
    /// the earlier sample that it confirms.
    pub fn contradicts(&self) -> bool {
        2 * self.contradicting.saturating_sub(2 * self.confirming) > self.samples
    }
}

/// Outward deviation of a point from the design along the ray from the reference point, m.
///
/// `arc_m` is the point's arc length.
pub fn off_m(profile: &Profile, point: Yz, arc_m: f64) -> f64 {
    let centre = profile.reference();
    distance_m(centre, point) - distance_m(centre, profile.point_at(arc_m))
}

fn distance_m(a: Yz, b: Yz) -> f64 {
    headrace_geometry::math::hypot(b[0] - a[0], b[1] - a[1])
}

/// Unsigned area of the triangle of three points, m2.
fn triangle_m2([y, z]: Yz, a: Yz, b: Yz) -> f64 {
    ((a[0] - y) * (b[1] - z) - (a[1] - z) * (b[0] - y)).abs() / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_geometry::math::{self, TAU};
    use headrace_geometry::tunnel::shapes;

    /// Deviations of one turn of `samples` samples at radius `true_m`. The design is a circle with a radius of 3 m.
    fn turned(true_m: f64, samples: u32) -> Deviation {
        let profile = shapes::circle(3.0).unwrap();
        let [y, z] = profile.reference();
        let mut deviation = Deviation::default();
        let mut before = None;
        for k in 0..=samples {
            let angle = TAU * f64::from(k) / f64::from(samples);
            let point = [y + true_m * math::sin(angle), z - true_m * math::cos(angle)];
            let at = (point, profile.arc_of(point));
            deviation.add(&profile, at, before, (0.5, false));
            before = Some(at);
        }
        deviation
    }

    #[test]
    fn circle_wider_than_the_profile_deviates_equally_all_round() {
        let deviation = turned(3.2, 400);
        assert!((deviation.mean_m().unwrap() - 0.2).abs() < 1e-9);
        let [inmost_m, outmost_m] = deviation.extremes_m().unwrap();
        assert!(inmost_m.abs() < 1e-9 && (outmost_m - 0.2).abs() < 1e-9);
        assert!((deviation.area_ratio().unwrap() - (3.2_f64 / 3.0) * (3.2 / 3.0)).abs() < 1e-9);
        assert!(!deviation.contradicts());
    }

    #[test]
    fn section_contradicts_the_profile_if_most_samples_exceed_the_limit() {
        assert!(turned(3.6, 100).contradicts() && turned(2.4, 100).contradicts());
        let mut rock = turned(3.0, 100);
        let profile = shapes::circle(3.0).unwrap();
        let point = [0.0, 1.0];
        for _ in 0..40 {
            rock.add(&profile, (point, profile.arc_of(point)), None, (0.5, false));
        }
        assert!(!rock.contradicts(), "a heap on the floor doesn't contradict the profile");
        assert!((rock.extremes_m().unwrap()[0] + 1.0).abs() < 1e-9);
    }

    /// The wall lies 0.6 m outside the design. Another head confirms all samples except the first `alone` samples.
    #[test]
    fn wall_that_another_head_confirms_does_not_contradict_the_profile() {
        let profile = shapes::circle(3.0).unwrap();
        let contradicts = |alone: u32| {
            let mut deviation = Deviation::default();
            for k in 0..100 {
                let at = ([3.6, 3.0], profile.arc_of([3.6, 3.0]));
                deviation.add(&profile, at, None, (0.5, k >= alone));
            }
            deviation.contradicts()
        };
        assert_eq!([50, 75, 76, 100].map(contradicts), [false, false, true, true]);
        let whole = |split: u32| {
            let [mut first, mut second] = [Deviation::default(); 2];
            for k in 0..100 {
                let off_m = f64::from(k) / 50.0 - 1.0;
                let at = ([3.0 + off_m, 3.0], profile.arc_of([3.0 + off_m, 3.0]));
                if k < split { &mut first } else { &mut second }.add(&profile, at, None, (0.5, false));
            }
            first.merge(&second);
            (first.contradicts(), first.extremes_m(), first.mean_m().map(|mean_m| (mean_m * 1e9).round()))
        };
        assert_eq!(whole(37), whole(100), "merging parts gives the whole");
    }

    #[test]
    fn deviation_without_samples_is_none() {
        let deviation = Deviation::default();
        assert_eq!((deviation.mean_m(), deviation.extremes_m(), deviation.area_ratio()), (None, None, None));
        assert!(!deviation.contradicts());
    }
}
