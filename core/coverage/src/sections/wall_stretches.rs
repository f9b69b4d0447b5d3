//! Stretches of wall that are farther from the design than roughness explains.

use super::section_table::Sections;
use crate::deviation::Deviation;
use crate::frontier::Reach;
use headrace_geometry::math;

/// Least mean deviation of a stretch as a share of the equivalent radius. It is below 4.5 %, the deviation of a tunnel
/// that is 5 % wider than its design, with its floor at the design's height.
const LEAST_SHARE: f64 = 0.04;

/// A stretch of wall whose mean deviation from the design is at least 4 % of the equivalent radius.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallStretch {
    /// Index of the stretch's first section.
    pub from: i64,
    /// Index after the stretch's last section.
    pub to: i64,
    /// Mean deviation of the stretch's samples, m; outward is positive.
    pub mean_m: f64,
    /// Largest inward deviation, m; never above zero.
    pub inmost_m: f64,
    /// Largest outward deviation, m; never below zero.
    pub outmost_m: f64,
}

/// Sections that deviate to the same side and are near each other, together with the sections between them.
struct Candidate {
    from: i64,
    to: i64,
    deviation: Deviation,
}

impl Candidate {
    fn is_outside(&self) -> bool {
        self.deviation.mean_m().is_some_and(|mean_m| mean_m > 0.0)
    }

    /// Returns the stretch if it is at least as long as the target, and if its mean deviation is at least `least_m`.
    ///
    /// The mean includes the sections between those that deviate.
    fn stretch(&self, sections: &Sections, least_m: f64) -> Option<WallStretch> {
        let length_m = (self.to - self.from) as f64 * sections.section_m();
        let (mean_m, [inmost_m, outmost_m]) = self
            .deviation
            .mean_m()
            .zip(self.deviation.extremes_m())
            .filter(|(mean_m, _)| mean_m.abs() >= least_m)?;
        let is_long = length_m >= sections.target().max_hole_m;
        is_long.then_some(WallStretch { from: self.from, to: self.to, mean_m, inmost_m, outmost_m })
    }
}

impl Sections {
    /// Returns the stretches of wall that are off the design, within `extent`, for instance the coverage extent.
    ///
    /// A stretch is at least as long as the target T. Sections at most T apart form one stretch, because a single turn
    /// of a slow head is spread over several sections.
    ///
    /// Allocates: the list. Called only at the end of a dive.
    pub fn wall_stretches(&self, extent: Option<Reach>, perimeter_m: f64) -> Vec<WallStretch> {
        let least_m = LEAST_SHARE * perimeter_m / math::TAU;
        let apart = math::floor_to_i64(self.target().max_hole_m / self.section_m());
        let mut all: Vec<Candidate> = Vec::new();
        let mut between = Deviation::default();
        for index in self.sections_of(extent) {
            let Some(deviation) = self.get(index).map(|section| section.deviation) else { continue };
            let Some(mean_m) = deviation.mean_m().filter(|mean_m| mean_m.abs() >= least_m) else {
                between.merge(&deviation);
                continue;
            };
            let joins =
                |last: &&mut Candidate| index - last.to <= apart && last.is_outside() == (mean_m > 0.0);
            if let Some(last) = all.last_mut().filter(joins) {
                last.to = index + 1;
                last.deviation.merge(&between);
                last.deviation.merge(&deviation);
            } else {
                all.push(Candidate { from: index, to: index + 1, deviation });
            }
            between = Deviation::default();
        }
        all.iter().filter_map(|candidate| candidate.stretch(self, least_m)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_geometry::tunnel::shapes;
    use headrace_sampling::Target;

    /// Returns start, end and mean deviation of each stretch, m, in a circular tunnel of 3 m radius. `off_m` are the
    /// deviations of its sections of 0.25 m. The limit is a mean deviation of 0.12 m.
    fn stretches(target_m: f64, off_m: &[f64]) -> Vec<[f64; 3]> {
        let profile = shapes::circle(3.0).unwrap();
        let mut sections = Sections::new(0.25, Target::new(target_m), 0.0, 10.0);
        let [_, z] = profile.reference();
        for (index, off_m) in (0..).zip(off_m) {
            let point = [3.0 + off_m, z];
            let at = (point, profile.arc_of(point));
            sections.get_mut(index).unwrap().deviation.add(&profile, at, None, (0.5, false));
        }
        let extent = Some(Reach { from_m: 0.0, to_m: 9.9 });
        let bounds = |stretch: &WallStretch| [stretch.from, stretch.to].map(|index| 0.25 * index as f64);
        let found = sections.wall_stretches(extent, profile.perimeter_m());
        found.iter().map(|stretch| [bounds(stretch)[0], bounds(stretch)[1], stretch.mean_m]).collect()
    }

    #[track_caller]
    fn assert_near(found: &[[f64; 3]], expected: &[[f64; 3]]) {
        assert_eq!(found.len(), expected.len(), "{found:?}");
        let is_near = |(a, b): (&[f64; 3], &[f64; 3])| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9);
        assert!(found.iter().zip(expected).all(is_near), "{found:?}");
    }

    #[test]
    fn neighbouring_sections_off_the_design_to_one_side_form_a_stretch() {
        assert_near(
            &stretches(0.5, &[0.0, 0.3, 0.2, 0.1, 0.0, -0.2, -0.4]),
            &[[0.25, 0.75, 0.25], [1.25, 1.75, -0.3]],
        );
        assert_near(&stretches(0.5, &[0.3, 0.3, -0.3, -0.3]), &[[0.0, 0.5, 0.3], [0.5, 1.0, -0.3]]);
        assert_near(&stretches(0.5, &[0.11; 8]), &[]);
    }

    #[test]
    fn stretch_shorter_than_the_target_is_left_out() {
        assert_near(&stretches(0.5, &[0.0, 0.4, 0.0]), &[]);
        assert_near(&stretches(0.5, &[0.0, 0.4, 0.4]), &[[0.25, 0.75, 0.4]]);
    }

    /// A slow head sees only a part of the wall in each section. The mean deviation of the stretch is that of all these
    /// parts. The first and the last section of the stretch deviate.
    #[test]
    fn sections_of_one_slow_turn_form_a_stretch_if_their_mean_deviates() {
        let ditch = [0.0, 0.6, 0.0, 0.0, 0.6, 0.0, 0.0, 0.6, 0.0];
        assert_near(&stretches(1.5, &ditch), &[[0.25, 2.0, 1.8 / 7.0]]);
        let boulders = [0.0, 0.2, 0.0, 0.0, 0.0, 0.2, 0.0, 0.0, 0.0, 0.2, 0.0];
        assert_near(&stretches(1.5, &boulders), &[]);
    }
}
