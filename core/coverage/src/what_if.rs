//! Verdicts of the same samples for other targets and section lengths.

use super::frontier::{Outlook, Reach, clear_of};
use super::hole::{Hole, HoleFinder};
use super::metres::Metres;
use super::section::{Section, Verdict};
use super::sections::{Sections, verdict};
use super::store::SampleStore;
use headrace_geometry::math;
use headrace_geometry::tunnel::Profile;

/// A section's hole, independent of the target.
#[derive(Debug, Clone, Copy)]
struct Measured {
    hole: Hole,
    sd_m: f64,
    /// The profile is wrong there, or there is no wall.
    doubtful: bool,
}

impl Measured {
    /// Of a section whose hole has been measured.
    fn of(section: &Section) -> Option<Self> {
        Some(Self { hole: section.hole?, sd_m: section.hole_sd_m, doubtful: section.doubt().is_some() })
    }
}

impl Sections {
    /// Metres by verdict for each target, for a given section length. The present length reuses the holes as last
    /// measured, which don't depend on the target once a dive has ended.
    pub fn what_if(
        &self,
        section_m: f64,
        targets_m: &[f64],
        outlook: &Outlook,
        (store, finder): (&SampleStore, &mut HoleFinder),
        profile: &Profile,
    ) -> Vec<Metres> {
        let measured = if (section_m - self.section_m()).abs() > 0.0 {
            self.measured_anew(section_m, outlook.way, store, finder, profile)
        } else {
            self.measured(outlook.way)
        };
        // Of what was judged in this dive nothing has to be asked again; where all was measured, the sections that are flagged already count, too.
        let is_own = |target_m: f64| {
            (section_m - self.section_m()).abs() <= 0.0 && (target_m - self.target_m()).abs() <= 0.0
        };
        let metres = |target_m: &f64| {
            if is_own(*target_m) {
                self.metres(outlook.way)
            } else {
                self.metres_of(&measured, section_m, *target_m, outlook)
            }
        };
        targets_m.iter().map(metres).collect()
    }

    /// Verdicts for another target, by section, of all whose hole has been measured: as [`Sections::what_if`] counts them.
    pub fn verdicts_at(&self, target_m: f64, outlook: &Outlook) -> impl Iterator<Item = (i64, Verdict)> {
        self.sections_of(outlook.way).filter_map(move |index| {
            Some((index, self.verdict_of(&Measured::of(self.get(index)?)?, target_m, outlook)))
        })
    }

    fn measured(&self, way: Option<Reach>) -> Vec<Measured> {
        self.sections_of(way).filter_map(|index| Measured::of(self.get(index)?)).collect()
    }

    fn measured_anew(
        &self,
        section_m: f64,
        way: Option<Reach>,
        store: &SampleStore,
        finder: &mut HoleFinder,
        profile: &Profile,
    ) -> Vec<Measured> {
        let sections = self.sections_of(way);
        let (first_m, end_m) = (self.bounds_m(sections.start).0, self.bounds_m(sections.end).0);
        let indexes = math::floor_to_i64(first_m / section_m)..-math::floor_to_i64(-end_m / section_m);
        let section = |index: i64| {
            let (from_m, to_m) = (index as f64 * section_m, (index + 1) as f64 * section_m);
            // Slightly inside, so that a common border is no overlap.
            let overlapped = self.index_of(from_m + 1e-9)..=self.index_of(to_m - 1e-9);
            let overlapped = || overlapped.clone().filter_map(|old| self.get(old));
            let first_visit = overlapped().map(|old| old.visits.first()).max().unwrap_or(0);
            let hole = finder.largest_since(store, from_m, to_m, first_visit);
            let wall_m = profile.point_at(hole.arc_m);
            let sd_m = |old: &Section| old.visits.sd_m(old.passage.pass_error.sd_m(wall_m));
            Measured {
                hole,
                sd_m: overlapped().map(sd_m).fold(0.0, f64::max),
                doubtful: overlapped().any(|old| old.doubt().is_some()),
            }
        };
        indexes.map(section).collect()
    }

    fn metres_of(&self, measured: &[Measured], section_m: f64, target_m: f64, outlook: &Outlook) -> Metres {
        let mut metres = Metres::default();
        for one in measured {
            metres.add(self.verdict_of(one, target_m, outlook), section_m);
        }
        metres
    }

    fn verdict_of(
        &self,
        Measured { hole, sd_m, doubtful }: &Measured,
        target_m: f64,
        outlook: &Outlook,
    ) -> Verdict {
        let error_m = self.confidence_sd() * sd_m;
        let clear_m = clear_of(outlook.to_come, hole.x_m).min(clear_of(outlook.not_passed, hole.x_m));
        match verdict(hole, error_m, target_m, clear_m) {
            Verdict::Pass if *doubtful => Verdict::CannotSay,
            said => said,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lacks::Lacks;
    use crate::passage::PassError;
    use crate::sections::{Judging, Request};
    use crate::store::{StoreLayout, WallSample};
    use headrace_fusion::relative::Relative;
    use headrace_geometry::time::MonoNs;
    use headrace_geometry::tunnel::shapes;

    /// A pipe with samples every 0.2 m but for 0.6 m from 5 m on, of which 3 m to 7 m are the way, judged in sections of a quarter of a metre.
    struct Seen {
        profile: Profile,
        store: SampleStore,
        finder: HoleFinder,
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
            let (sections, finder) = (Sections::new(0.25, 0.5, 0.0, 10.0), HoleFinder::default());
            let mut seen = Self { profile, store, finder, sections, outlook };
            for index in seen.sections.sections_of(seen.outlook.way) {
                let mut judging = Judging {
                    store: &seen.store,
                    lacks: &Lacks::default(),
                    finder: &mut seen.finder,
                    profile: &seen.profile,
                    tell: &mut |_, _| {},
                };
                seen.sections.judge(&Request::at(&seen.outlook)(index), &mut judging);
            }
            seen
        }

        /// Metres that pass, that fail, and of which neither can be said.
        fn metres(&mut self, section_m: f64, target_m: f64) -> [f64; 3] {
            let Self { profile, store, finder, sections, outlook } = self;
            let metres = sections.what_if(section_m, &[target_m], outlook, (store, finder), profile);
            assert_eq!((metres.len(), metres[0].open_m.abs() <= 0.0), (1, true));
            [metres[0].pass_m, metres[0].fail_m, metres[0].cannot_say_m]
        }
    }

    /// From 5 m to 5.6 m a circle has 0.63 m; centred at most a quarter of a metre beyond 5 m, 0.54 m.
    #[test]
    fn other_targets_and_sections_have_the_holes_that_are_in_them() {
        let mut seen = Seen::new();
        for (section_m, target_m, expected) in [
            // The way touches 17 sections of a quarter of a metre, to 7.25 m.
            (0.25, 0.5, [3.75, 0.5, 0.0]),
            (0.25, 0.6, [4.0, 0.25, 0.0]),
            (0.25, 0.7, [4.25, 0.0, 0.0]),
            (0.25, 0.2, [0.0, 4.25, 0.0]),
            // Those touch nine of half a metre, and five of a metre.
            (0.5, 0.5, [4.0, 0.5, 0.0]),
            (1.0, 0.5, [4.0, 1.0, 0.0]),
            (1.0, 0.7, [5.0, 0.0, 0.0]),
            (1.0, 0.2, [0.0, 5.0, 0.0]),
        ] {
            let found = seen.metres(section_m, target_m);
            assert!(
                found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9),
                "{section_m} {target_m}: {found:?}"
            );
        }
        let verdicts: Vec<_> = seen.sections.verdicts_at(0.6, &seen.outlook).collect();
        let expected = (12..29).map(|index| (index, if index == 21 { Verdict::Fail } else { Verdict::Pass }));
        assert_eq!(verdicts, expected.collect::<Vec<_>>());
    }

    /// What is unsure of a section is so of all that it touches: two standard deviations of 0.05 m, and a doubt.
    #[test]
    fn errors_and_doubts_are_those_of_the_sections_that_are_touched() {
        let mut seen = Seen::new();
        let error = PassError { relative: Relative::along(1.0), from_m: [0.0; 2] };
        let relative = Relative::along(0.05 / error.sd_m([0.0; 2]));
        // From 5.5 m to 5.75 m.
        seen.sections.get_mut(22).unwrap().passage.pass_error = PassError { relative, ..error };
        for (target_m, expected) in [
            (0.5, [4.0, 1.0, 0.0]),
            (0.55, [4.0, 0.0, 1.0]),
            (0.72, [4.0, 0.0, 1.0]),
            (0.74, [5.0, 0.0, 0.0]),
        ] {
            let found = seen.metres(1.0, target_m);
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{target_m}: {found:?}");
        }
        // From 3.75 m to 4 m: of two neighbours at a common border only the one that it lies in.
        seen.sections.get_mut(15).unwrap().suspect = true;
        let found = seen.metres(1.0, 0.74);
        assert!(found.iter().zip([4.0, 0.0, 1.0]).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}");
        let found = seen.metres(1.0, 0.2);
        assert!(
            found.iter().zip([0.0, 5.0, 0.0]).all(|(a, b)| (a - b).abs() < 1e-9),
            "a fail is one: {found:?}"
        );
    }
}
