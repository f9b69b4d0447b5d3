//! Verdicts on the holes of a dive for another target than the dive's own.

use super::frontier::{Outlook, clear_of};
use super::hole::Hole;
use super::section::{Section, Verdict};
use super::sections::{Sections, verdict};
use headrace_sampling::Target;

/// Inputs for the verdict on a section's hole that don't depend on the target.
#[derive(Debug, Clone, Copy)]
struct Measured {
    hole: Hole,
    sd_m: f64,
    /// Whether the profile is wrong in this section, or there is no wall.
    doubtful: bool,
}

impl Measured {
    /// Inputs for the verdict on a section with a measured hole.
    fn of(section: &Section) -> Option<Self> {
        Some(Self { hole: section.hole?, sd_m: section.hole_sd_m, doubtful: section.doubt().is_some() })
    }
}

impl Sections {
    /// Returns the index of each section with a measured hole, and its verdict for another target.
    ///
    /// The dive's own target still decides which visits count and which sections are settled. Only a replay with the
    /// other target gives the verdicts that the dive would have reported.
    pub fn verdicts_at(&self, target_m: f64, outlook: &Outlook) -> impl Iterator<Item = (i64, Verdict)> {
        let target = Target { max_hole_m: target_m, ..self.target() };
        self.sections_of(outlook.way).filter_map(move |index| {
            Some((index, verdict_of(&Measured::of(self.get(index)?)?, target, outlook)))
        })
    }
}

fn verdict_of(measured: &Measured, target: Target, outlook: &Outlook) -> Verdict {
    let Measured { hole, sd_m, doubtful } = *measured;
    let clear_m = clear_of(outlook.to_come, hole.x_m).min(clear_of(outlook.not_passed, hole.x_m));
    match verdict(&hole, sd_m, target, clear_m) {
        Verdict::Pass if doubtful => Verdict::CannotSay,
        said => said,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frontier::Reach;
    use crate::hole::HoleFinder;
    use crate::missing_samples::MissingSamples;
    use crate::sections::{Judging, Request};
    use crate::store::{SampleStore, StoreLayout, WallSample};
    use headrace_geometry::time::MonoNs;
    use headrace_geometry::tunnel::shapes;

    /// Sections of a pipe with samples every 0.2 m, except from 5 m to 5.6 m.
    ///
    /// The coverage extent is 3 m to 7 m. Sections are a quarter of a metre long.
    struct Seen {
        sections: Sections,
        outlook: Outlook,
    }

    impl Seen {
        fn new() -> Self {
            let profile = shapes::circle(3.0).unwrap();
            let perimeter_m = profile.perimeter_m();
            let layout = StoreLayout { perimeter_m, from_m: 0.0, to_m: 10.0, cell_m: 0.25, capacity: 20_000 };
            let mut store = SampleStore::new(layout);
            for (i, k) in
                (10..=41).filter(|i| !(27..29).contains(i)).flat_map(|i| (0..94).map(move |k| (i, k)))
            {
                let (x_m, arc_m) = (0.2 * f64::from(i) - 0.2, perimeter_m / 94.0 * f64::from(k));
                store.insert(WallSample { x_m, arc_m, head: 0, step_m: None, visit: 0 }).unwrap();
            }
            let outlook = Outlook {
                at: MonoNs(0),
                way: Some(Reach { from_m: 3.0, to_m: 7.0 }),
                swept_by_all: None,
                none_alive: false,
                to_come: None,
                not_passed: None,
                through: None,
                still_zone: None,
            };
            let mut finder = HoleFinder::default();
            let mut seen = Self { sections: Sections::new(0.25, Target::new(0.5), 0.0, 10.0), outlook };
            for index in seen.sections.sections_of(seen.outlook.way) {
                let mut judging = Judging {
                    store: &store,
                    missing_samples: &MissingSamples::default(),
                    finder: &mut finder,
                    profile: &profile,
                    tell: &mut |_, _| {},
                };
                seen.sections.judge(&Request::at(&seen.outlook)(index), &mut judging);
            }
            seen
        }
    }

    /// The largest circle in the stretch without samples, from 5 m to 5.6 m, measures 0.63 m.
    ///
    /// The largest one with its centre between 5 m and 5.25 m measures 0.54 m.
    #[test]
    fn verdicts_for_another_target_use_the_measured_holes() {
        let seen = Seen::new();
        for (target_m, failing) in [(0.5, 20..22), (0.6, 21..22), (0.7, 0..0), (0.2, 12..29)] {
            let verdicts: Vec<_> = seen.sections.verdicts_at(target_m, &seen.outlook).collect();
            let verdict = |index: &i64| if failing.contains(index) { Verdict::Fail } else { Verdict::Pass };
            let expected: Vec<_> = (12..29).map(|index| (index, verdict(&index))).collect();
            assert_eq!(verdicts, expected, "{target_m}");
        }
    }

    /// The allowance for the position error is two standard deviations, each 0.05 m.
    #[test]
    fn verdict_for_another_target_respects_position_error_and_doubtful_samples() {
        let mut seen = Seen::new();
        let of = |seen: &Seen, index: i64, target_m: f64| {
            seen.sections.verdicts_at(target_m, &seen.outlook).find(|(at, _)| *at == index).unwrap().1
        };
        let hole_m = seen.sections.get(15).unwrap().hole.unwrap().diameter_m;
        seen.sections.get_mut(15).unwrap().hole_sd_m = 0.05;
        for (more_m, expected) in [
            (-0.11, Verdict::Fail),
            (-0.09, Verdict::CannotSay),
            (0.09, Verdict::CannotSay),
            (0.11, Verdict::Pass),
        ] {
            assert_eq!(of(&seen, 15, hole_m + more_m), expected, "{more_m}");
        }
        seen.sections.get_mut(15).unwrap().suspect = true;
        assert_eq!(of(&seen, 15, hole_m + 0.11), Verdict::CannotSay);
        assert_eq!(of(&seen, 15, hole_m - 0.11), Verdict::Fail, "a fail stays a fail");
    }
}
