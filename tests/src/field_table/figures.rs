//! Figures of a cell of the field table: verdicts and standard deviations compared with the truth.

use headrace_coverage::Verdict;
use headrace_geometry::math;
use headrace_monitor::report::AdviceReport;
use headrace_sensor::device::Sense;
use headrace_simulator::Scene;

use crate::field::rms;
use crate::truth::{JudgedDive, JudgedSection};

/// Kinds of sensors whose readings have innovations in the filter, each with its name in the table.
pub const KINDS_OF_SOURCES: [(&str, Sense); 6] = [
    ("head", Sense::Head),
    ("ping", Sense::Echosounder),
    ("depth", Sense::Depth),
    ("imu", Sense::Inertial),
    ("tether", Sense::Tether),
    ("dvl", Sense::Velocity),
];
/// Length that is left out at each end of a dive, in addition to a length equal to the target, m. Sections there have
/// neighbours on one side only. The 2 m cover the length of the hull and the distance between passes.
const END_M: f64 = 2.0;
/// A hole belongs to a section if its centre is at least this far from both bounds of the section, m.
const FLANK_M: f64 = 0.005;
/// A section counts as entered if the vehicle drives at least this far into it, m.
const TOUCH_M: f64 = 0.02;

/// A section that passed although its true hole exceeds the target.
#[derive(Debug, Clone)]
pub struct FalsePass {
    /// Seed of the dive in which the section passed.
    pub seed: u64,
    /// Chainage of the section's start, m.
    pub start_m: f64,
    /// Diameter of the hole, m: reported value, its standard deviation, and true value.
    pub hole_m: [f64; 3],
    /// Reported position of the hole: chainage and clock position.
    pub at: (f64, String),
    /// Number of the section's returns that weren't accepted as wall.
    pub doubtful: u32,
}

/// Figures over all dives of a cell.
#[derive(Debug, Clone, Default)]
pub struct Figures {
    /// Number of dives of the cell.
    pub dives: u32,
    /// Number of sections, including sections at the ends of dives.
    pub sections: u32,
    /// Number of sections with a true hole D_true over the target.
    pub over: u32,
    /// Number of passed sections with a true hole D_true over the target.
    pub passed_over: u32,
    /// Number of passed sections with a true hole D_true over 1.1 times the target.
    pub passed_far: u32,
    /// List of the passed sections with a true hole D_true over the target.
    pub falsely: Vec<FalsePass>,
    /// Number of sections with a true hole D_true below 0.9 times the target.
    pub under: u32,
    /// Number of failed sections with a true hole D_true below 0.9 times the target.
    pub failed_under: u32,
    /// Total inner length, which excludes the ends of dives, m.
    pub inner_m: f64,
    /// Inner length by verdict, m, in this order: passed, failed, can't say, open.
    pub verdicts_m: [f64; 4],
    /// Inner length with a true hole D_true within the target, m.
    pub passable_m: f64,
    /// One pair for each inner section with a bounded hole: the hole D minus the true hole D_true, and the standard
    /// deviation of D, m. Sections whose hole is centred on their boundary are left out.
    pub errors: Vec<[f64; 2]>,
    /// For each kind of sensor: the number of measurements that the filter used, and the sum of their normalised
    /// innovations squared.
    pub innovations: [(f64, f64); KINDS_OF_SOURCES.len()],
    /// Advised speeds, without the speeds near the ends of dives, m/s.
    pub advised_mps: Vec<f64>,
    /// Length of the vehicle's trajectory, and length of the part for which the report has sections, m.
    pub way_m: [f64; 2],
}

impl Figures {
    /// Adds the figures of a dive, from the chainage `from_m` on.
    pub fn add(&mut self, dive: &JudgedDive, scene: &Scene, from_m: f64) {
        self.dives += 1;
        let target_m = dive.report.target_m;
        let end_m = END_M + target_m;
        let [from_m, to_m] = [from_m.max(dive.truth.way_m[0]), dive.truth.way_m[1]];
        let [first_m, last_m] = [from_m + end_m, to_m - end_m];
        for section in &dive.sections {
            let [start_m, end_m] =
                [section.report.start_m, section.report.end_m].map(|x_m| x_m + section.shift_m);
            if end_m > from_m {
                self.judge(section, target_m, scene.seed);
            }
            if start_m >= first_m && end_m <= last_m {
                self.weigh(section, target_m);
            }
        }
        let heard =
            |entry: &&AdviceReport| entry.chainage_m.is_some_and(|x_m| (first_m..last_m).contains(&x_m));
        self.advised_mps.extend(dive.report.advice.iter().filter(heard).map(|entry| entry.v_max_mps));
        self.innovate(dive, scene);
        self.tell(dive);
    }

    /// Adds the figures of other dives of the same cell.
    pub fn join(&mut self, other: &Self) {
        self.dives += other.dives;
        self.sections += other.sections;
        self.over += other.over;
        self.passed_over += other.passed_over;
        self.passed_far += other.passed_far;
        self.falsely.extend(other.falsely.iter().cloned());
        self.under += other.under;
        self.failed_under += other.failed_under;
        self.inner_m += other.inner_m;
        self.passable_m += other.passable_m;
        let add =
            |sums: &mut [f64], more: &[f64]| sums.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
        add(&mut self.verdicts_m, &other.verdicts_m);
        add(&mut self.way_m, &other.way_m);
        for ((used, sum), (more_used, more)) in self.innovations.iter_mut().zip(other.innovations) {
            *used += more_used;
            *sum += more;
        }
        self.errors.extend(&other.errors);
        self.advised_mps.extend(&other.advised_mps);
    }

    fn judge(&mut self, section: &JudgedSection, target_m: f64, seed: u64) {
        let (passed, failed) =
            (section.report.verdict == Verdict::Pass, section.report.verdict == Verdict::Fail);
        let is = |condition: bool| u32::from(condition);
        let share = section.true_hole_m / target_m;
        self.sections += 1;
        self.over += is(share > 1.0);
        self.passed_over += is(passed && share > 1.0);
        self.passed_far += is(passed && share > 1.1);
        if passed && share > 1.0 {
            let report = &section.report;
            self.falsely.push(FalsePass {
                seed,
                start_m: report.start_m,
                hole_m: [report.hole_m.unwrap_or(f64::NAN), report.hole_sd_m, section.true_hole_m],
                at: (report.hole_x_m.unwrap_or(f64::NAN), report.hole_clock.clone().unwrap_or_default()),
                doubtful: report.doubtful_returns,
            });
        }
        self.under += is(share < 0.9);
        self.failed_under += is(failed && share < 0.9);
    }

    fn weigh(&mut self, section: &JudgedSection, target_m: f64) {
        let length_m = section.report.end_m - section.report.start_m;
        self.inner_m += length_m;
        if section.true_hole_m <= target_m {
            self.passable_m += length_m;
        }
        let verdicts = [Verdict::Pass, Verdict::Fail, Verdict::CannotSay, Verdict::Open];
        let place = verdicts.iter().position(|verdict| *verdict == section.report.verdict);
        if let Some(metres) = place.and_then(|place| self.verdicts_m.get_mut(place)) {
            *metres += length_m;
        }
        // A circle that is centred on a section's boundary is part of the neighbouring section's hole. The hole must
        // not count twice.
        let is_own = section
            .report
            .hole_x_m
            .is_some_and(|x_m| (x_m - section.report.start_m).min(section.report.end_m - x_m) > FLANK_M);
        if let Some(hole_m) = section.report.hole_m.filter(|_| section.report.hole_bounded && is_own)
            && section.true_hole_m.is_finite()
        {
            self.errors.push([hole_m - section.true_hole_m, section.report.hole_sd_m]);
        }
    }

    fn innovate(&mut self, dive: &JudgedDive, scene: &Scene) {
        for (source, facts) in dive.report.sources.iter().zip(&scene.facts().sensors) {
            let kind = KINDS_OF_SOURCES.iter().position(|(_, sense)| *sense == facts.sense);
            if let (Some(kind), Some(navigation)) = (kind, &source.navigation)
                && let Some(nis) = navigation.nis
            {
                let (used, sum) = &mut self.innovations[kind];
                *used += navigation.used as f64;
                *sum += nis * navigation.used as f64;
            }
        }
    }

    /// Adds the length of the trajectory, and the length of the part for which the report has sections.
    fn tell(&mut self, dive: &JudgedDive) {
        let section_m = dive.report.section_m;
        let [Some(first), Some(last)] = [dive.sections.first(), dive.sections.last()] else {
            self.way_m[0] += dive.truth.way_m[1] - dive.truth.way_m[0];
            return;
        };
        let from = math::floor_to_i64((dive.truth.way_m[0] - first.shift_m) / section_m);
        // A section that begins where the trajectory ends isn't entered.
        let to = math::floor_to_i64((dive.truth.way_m[1] - last.shift_m - TOUCH_M) / section_m);
        let mut reported: Vec<i64> = dive
            .sections
            .iter()
            .map(|section| math::round_to_i64(section.report.start_m / section_m))
            .collect();
        reported.dedup();
        let reported = reported.iter().filter(|k| (from..=to).contains(k)).count();
        self.way_m[0] += (to - from + 1) as f64 * section_m;
        self.way_m[1] += reported as f64 * section_m;
    }

    /// Fraction of the inner length with this verdict: 0 passed, 1 failed, 2 can't say, 3 open.
    pub fn share(&self, verdict: usize) -> f64 {
        self.verdicts_m[verdict] / self.inner_m
    }

    /// Fraction of the inner length with a true hole D_true within the target, 0 to 1.
    pub fn passable(&self) -> f64 {
        self.passable_m / self.inner_m
    }

    /// Root mean square of the errors of the hole diameter D, each divided by its standard deviation.
    pub fn ratio_rms(&self) -> f64 {
        if self.errors.is_empty() {
            f64::NAN
        } else {
            rms(self.errors.iter().map(|[error_m, sd_m]| error_m / sd_m))
        }
    }

    /// Fraction of the errors of the hole diameter D that are within `sigmas` standard deviations.
    pub fn within(&self, sigmas: f64) -> f64 {
        let within = self.errors.iter().filter(|[error_m, sd_m]| error_m.abs() <= sigmas * sd_m).count();
        within as f64 / self.errors.len() as f64
    }

    /// Root mean square of the errors of the hole diameter D, m.
    pub fn error_m(&self) -> f64 {
        rms(self.errors.iter().map(|[error_m, _]| *error_m))
    }

    /// Median of the reported standard deviations of the hole diameter D, m.
    pub fn sd_m(&self) -> f64 {
        median(self.errors.iter().map(|[_, sd_m]| *sd_m))
    }

    /// Median of the advised speeds, m/s.
    pub fn advised_mps(&self) -> f64 {
        median(self.advised_mps.iter().copied())
    }

    /// Mean normalised innovation squared of one kind of sensor, given by its index in [`KINDS_OF_SOURCES`].
    pub fn nis(&self, kind: usize) -> Option<f64> {
        let (used, sum) = self.innovations[kind];
        (used > 0.0).then(|| sum / used)
    }

    /// Fraction of false passes: passed sections among those with a true hole D_true over the target.
    pub fn false_passes(&self) -> f64 {
        f64::from(self.passed_over) / f64::from(self.over.max(1))
    }

    /// Fraction of false fails: failed sections among those with a true hole D_true below 0.9 times the target.
    pub fn false_fails(&self) -> f64 {
        f64::from(self.failed_under) / f64::from(self.under.max(1))
    }
}

/// Median of the values; NaN without values.
fn median(of: impl Iterator<Item = f64>) -> f64 {
    let mut all: Vec<f64> = of.collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied().unwrap_or(f64::NAN)
}
