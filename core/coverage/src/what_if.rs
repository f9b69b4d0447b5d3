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
