//! Figures of a cell: verdicts and sigmas against the truth.

use headrace_geometry::math;
use headrace_monitor::report::AdviceReport;
use headrace_sensor::device::Sense;
use headrace_simulator::Scene;

use crate::field::rms;
use crate::truth::{JudgedDive, JudgedSection};

/// Kinds of sources that have innovations, by name.
pub const KINDS_OF_SOURCES: [(&str, Sense); 6] = [
    ("head", Sense::Head),
    ("ping", Sense::Echosounder),
    ("depth", Sense::Depth),
    ("imu", Sense::Inertial),
    ("tether", Sense::Tether),
    ("dvl", Sense::Velocity),
];
/// Beyond the target, sections at the ends of a dive have no neighbours on one side over so many metres: the length of the
/// hull, and the way to the next pass.
const END_M: f64 = 2.0;
/// A hole's centre is within its section where it is farther than this from the section's bounds, m.
const FLANK_M: f64 = 0.005;
/// A way that reaches into a section by no more than this isn't in it, m.
const TOUCH_M: f64 = 0.02;

/// A section that passed although its true hole is over the target.
#[derive(Debug, Clone)]
pub struct Falsely {
    /// Seed of the dive.
    pub seed: u64,
    /// Where the section begins, m.
    pub start_m: f64,
    /// Diameter of its hole as told, its standard deviation, and in truth, m.
    pub hole_m: [f64; 3],
    /// Where the hole is as told, chainage and clock.
    pub at: (f64, String),
    /// Returns that weren't taken for wall.
    pub doubtful: u32,
}

/// What came of the dives of a cell.
#[derive(Debug, Clone, Default)]
pub struct Figures {
    /// Dives.
    pub dives: u32,
    /// Sections, those at the ends included.
    pub sections: u32,
    /// Of them, D_true is over the target.
    pub over: u32,
    /// Of those, passed.
    pub passed_over: u32,
    /// Passed although D_true is over 1.1 times the target.
    pub passed_far: u32,
    /// Each of those that passed over the target.
    pub falsely: Vec<Falsely>,
    /// D_true is below 0.9 times the target.
    pub under: u32,
    /// Of those, failed.
    pub failed_under: u32,
    /// Metres away from the ends.
    pub inner_m: f64,
    /// Of them, passed, failed, can't say, open.
    pub verdicts_m: [f64; 4],
    /// Of them, D_true is within the target.
    pub passable_m: f64,
    /// Of each inner section with a bounded hole of its own: D less D_true and sigma, m.
    pub errors: Vec<[f64; 2]>,
    /// For each kind of source, measurements used and the sum of their normalised innovations squared.
    pub innovations: [(f64, f64); KINDS_OF_SOURCES.len()],
    /// Speeds advised away from the ends, m/s.
    pub advised_mps: Vec<f64>,
    /// Metres of the vehicle's way, and those of them that have a section in the report.
    pub way_m: [f64; 2],
}

impl Figures {
    /// Adds a dive from a chainage on, m.
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

    /// Adds the figures of other dives.
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
        let (passed, failed) = (section.report.verdict == "pass", section.report.verdict == "fail");
        let is = |condition: bool| u32::from(condition);
        let share = section.true_hole_m / target_m;
        self.sections += 1;
        self.over += is(share > 1.0);
        self.passed_over += is(passed && share > 1.0);
        self.passed_far += is(passed && share > 1.1);
        if passed && share > 1.0 {
            let report = &section.report;
            self.falsely.push(Falsely {
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
        let place = ["pass", "fail", "cannot_say", "open"].iter().position(|v| *v == section.report.verdict);
        if let Some(metres) = place.and_then(|place| self.verdicts_m.get_mut(place)) {
            *metres += length_m;
        }
        // A circle centred on a bound is the flank of a neighbour's hole: twice as far off as the place is.
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

    /// Metres of the way that are told: those of the loop's chainage that have a section.
    fn tell(&mut self, dive: &JudgedDive) {
        let section_m = dive.report.section_m;
        let [Some(first), Some(last)] = [dive.sections.first(), dive.sections.last()] else {
            self.way_m[0] += dive.truth.way_m[1] - dive.truth.way_m[0];
            return;
        };
        let from = math::floor_to_i64((dive.truth.way_m[0] - first.shift_m) / section_m);
        // A way that ends where a section begins isn't in it.
        let to = math::floor_to_i64((dive.truth.way_m[1] - last.shift_m - TOUCH_M) / section_m);
        let mut told: Vec<i64> = dive
            .sections
            .iter()
            .map(|section| math::round_to_i64(section.report.start_m / section_m))
            .collect();
        told.dedup();
        let told = told.iter().filter(|k| (from..=to).contains(k)).count();
        self.way_m[0] += (to - from + 1) as f64 * section_m;
        self.way_m[1] += told as f64 * section_m;
    }

    /// Share of the inner metres with a verdict, by its number: passed, failed, can't say, open.
    pub fn share(&self, verdict: usize) -> f64 {
        self.verdicts_m[verdict] / self.inner_m
    }

    /// Share of the inner metres with D_true within the target.
    pub fn passable(&self) -> f64 {
        self.passable_m / self.inner_m
    }

    /// Root mean square of the errors over their sigmas.
    pub fn ratio_rms(&self) -> f64 {
        if self.errors.is_empty() {
            f64::NAN
        } else {
            rms(self.errors.iter().map(|[error_m, sd_m]| error_m / sd_m))
        }
    }

    /// Share of errors within so many sigmas.
    pub fn within(&self, sigmas: f64) -> f64 {
        let within = self.errors.iter().filter(|[error_m, sd_m]| error_m.abs() <= sigmas * sd_m).count();
        within as f64 / self.errors.len() as f64
    }

    /// Root mean square of the errors, m.
    pub fn error_m(&self) -> f64 {
        rms(self.errors.iter().map(|[error_m, _]| *error_m))
    }

    /// Median of the sigmas, m.
    pub fn sd_m(&self) -> f64 {
        median(self.errors.iter().map(|[_, sd_m]| *sd_m))
    }

    /// Median of the speeds advised, m/s.
    pub fn advised_mps(&self) -> f64 {
        median(self.advised_mps.iter().copied())
    }

    /// Mean normalised innovation squared of a kind of sources, by its number.
    pub fn nis(&self, kind: usize) -> Option<f64> {
        let (used, sum) = self.innovations[kind];
        (used > 0.0).then(|| sum / used)
    }

    /// Passed although D_true is over the target, of those where it is.
    pub fn false_passes(&self) -> f64 {
        f64::from(self.passed_over) / f64::from(self.over.max(1))
    }

    /// Failed although D_true is below 0.9 times the target, of those where it is.
    pub fn false_fails(&self) -> f64 {
        f64::from(self.failed_under) / f64::from(self.under.max(1))
    }
}

/// The median; not a number of none.
fn median(of: impl Iterator<Item = f64>) -> f64 {
    let mut all: Vec<f64> = of.collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied().unwrap_or(f64::NAN)
}
