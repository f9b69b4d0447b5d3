//! Runs a dive through the filter and compares the estimate with the truth.

use std::collections::VecDeque;
use std::fmt::Write as _;

use headrace_fusion::filter::FilterNavigation;
use headrace_fusion::stuck_sensor::StuckSensor;
use headrace_fusion::{Navigation as _, Times};
use headrace_geometry::frames::Vec3;
use headrace_sensor::reading::Reading;

use crate::world::{Dive, Recipe, VELOCITY_LOG, seconds, sensor};

/// Settling times of the estimate, s. Absolute errors are checked after `SETTLED_S`, and errors between passes after
/// `COMPARED_S`.
const SETTLED_S: f64 = 10.0;
const COMPARED_S: f64 = 20.0;
/// Time between two passes of the heads over the same position, s.
const PASS_S: f64 = 2.2;
/// Errors of the estimate that exceed this many standard deviations must be reported.
const FAR_SDS: f64 = 5.0;
/// Largest value of twice the standard deviation between head passes, m. Above it, the loop reports a doubtful
/// position.
///
/// It is a fifth of a coverage target of 1 m.
const DOUBTFUL_M: f64 = 0.2;

/// Statistics of the filter's errors in a dive.
#[derive(Debug, Clone, Default)]
pub(crate) struct Tally {
    /// Number of epochs (`epochs`), of epochs with a fix (`fixes`), and of fixes within two standard deviations of the
    /// truth (`within`).
    pub(crate) epochs: u64,
    pub(crate) fixes: u64,
    pub(crate) within: u64,
    /// Number of epochs in which the position is doubtful or unknown.
    pub(crate) unsure: u64,
    /// Number of epochs with an unreported error of over five standard deviations (`silent`), and time of the first
    /// one, s.
    pub(crate) silent: u64,
    pub(crate) first_silent_s: Option<f64>,
    /// Largest chainage errors, in standard deviations: absolute (`worst`), and between head passes (`worst_pass`).
    pub(crate) worst: f64,
    pub(crate) worst_pass: f64,
    /// Largest errors of chainage and speed while there is a fix, m and m/s.
    pub(crate) error_m: f64,
    pub(crate) speed_off_mps: f64,
}

/// Returns the ratio of two counts, both added up over all dives.
pub(crate) fn share(of: &[&Tally], counts: impl Fn(&Tally) -> [u64; 2]) -> f64 {
    let sums = of.iter().map(|tally| counts(tally)).fold([0, 0], |[a, b], [c, d]| [a + c, b + d]);
    sums[0] as f64 / sums[1].max(1) as f64
}

/// Runs a dive, and writes a CSV to `trace` if given.
///
/// Columns: time, error, standard deviation, speed, true speed, standard deviation between passes, and whether a
/// doubt is reported.
pub(crate) fn run(recipe: Recipe, mut trace: Option<&mut String>) -> Tally {
    let dive = Dive::new(recipe);
    let mut nav = FilterNavigation::new(dive.profile.clone(), dive.site, recipe.settings());
    let (mut tally, mut last, mut errors) = (Tally::default(), None, VecDeque::new());
    // As in the loop, the filter does not get the repeated readings of a stuck inertial unit or velocity log.
    let mut stuck = [(StuckSensor::default(), false); VELOCITY_LOG + 1];
    for (valid, source, reading) in dive.events() {
        let (stuck, hangs) = &mut stuck[source];
        if let Reading::AngularRate(vector) | Reading::VelocityOverGround(vector) = reading {
            *hangs = stuck.hangs(valid, vector);
        }
        if *hangs {
            continue;
        }
        nav.update(source, &sensor(source), Times { received: valid, valid }, &reading);
        let now = nav.running().map(|running| running.at);
        if now.is_some_and(|now| seconds(now) >= SETTLED_S) && now != last {
            tally.look(&dive, &nav, &mut errors, &mut trace);
        }
        last = now;
    }
    tally
}

impl Tally {
    fn look(
        &mut self,
        dive: &Dive,
        nav: &FilterNavigation,
        errors: &mut VecDeque<(f64, f64, u32)>,
        trace: &mut Option<&mut String>,
    ) {
        let running = nav.running().unwrap();
        let t = seconds(running.at);
        self.epochs += 1;
        let Ok(fix) = nav.fix(running.at) else {
            self.unsure += 1;
            return;
        };
        self.fixes += 1;
        let sd_m = running.pose_sd().along_m;
        let error_m = fix.pose.position.x() - dive.chainage_m(t);
        let speed_mps = (dive.chainage_m(t + 0.05) - dive.chainage_m(t - 0.05)) / 0.1;
        let pass_sd_m = fix.relative.sd_m(Vec3::zero());
        let is_reported = nav.cable_doubt().is_some() || 2.0 * pass_sd_m > DOUBTFUL_M;
        errors.push_back((t, error_m, fix.tie));
        while errors.front().is_some_and(|(then, ..)| t - then > PASS_S) {
            errors.pop_front();
        }
        let before = errors.front().filter(|(.., tie)| *tie == fix.tie && t > COMPARED_S);
        let pass = before.map_or(0.0, |(_, before_m, _)| (error_m - before_m).abs() / pass_sd_m);
        self.within += u64::from(error_m.abs() <= 2.0 * sd_m);
        self.unsure += u64::from(is_reported);
        self.worst = self.worst.max(error_m.abs() / sd_m);
        self.worst_pass = self.worst_pass.max(pass);
        self.error_m = self.error_m.max(error_m.abs());
        self.speed_off_mps = self.speed_off_mps.max((fix.speed_mps - speed_mps).abs());
        if pass.max(error_m.abs() / sd_m) > FAR_SDS && !is_reported {
            self.silent += 1;
            self.first_silent_s.get_or_insert(t);
        }
        if let Some(trace) = trace {
            let speeds = format!("{},{speed_mps}", fix.speed_mps);
            writeln!(trace, "{t},{error_m},{sd_m},{speeds},{pass_sd_m},{}", u8::from(is_reported)).unwrap();
        }
    }
}
