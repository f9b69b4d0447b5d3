//! What verdicts of several dives are worth, in the units of decisions.

use headrace_geometry::math;

use crate::dive::{JudgedDive, JudgedSection};
use crate::point::{Error, Interval, quantile};

/// Mean with its 95 % interval; of a single value that value.
pub(super) fn spread(values: &[f64]) -> Option<Interval> {
    Interval::mean(values).or_else(|| Interval::quartiles(values))
}

/// Root mean square; `None` of nothing.
pub(super) fn rms(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (mut count, mut sum) = (0.0, 0.0);
    for value in values {
        (count, sum) = (count + 1.0, sum + value * value);
    }
    (count > 0.0).then(|| math::sqrt(sum / count))
}

/// An error whose interval is that of values, one a dive; nothing of no values.
pub(super) fn error(name: &str, unit: &str, values: &[f64]) -> Option<Error> {
    Some(Error::new(name, unit, spread(values)?))
}

/// `|D - D_true|` of the sections whose hole is bounded, m.
pub(super) fn hole_errors_m(dive: &JudgedDive) -> Vec<f64> {
    let off = |section: &JudgedSection| {
        let hole_m = section.report.hole_m.filter(|_| section.report.hole_bounded)?;
        section.true_hole_m.is_finite().then(|| (hole_m - section.true_hole_m).abs())
    };
    dive.sections.iter().filter_map(off).collect()
}

/// D against D_true, and metres of 100 falsely passed, falsely failed, and not said; one dive a seed.
pub(super) fn verdict_errors(dives: &[JudgedDive]) -> Vec<Error> {
    let of_dives = |figure: &dyn Fn(&JudgedDive) -> Option<f64>| -> Vec<f64> {
        dives.iter().filter_map(figure).collect()
    };
    let share = |is: &'static dyn Fn(&JudgedSection, f64) -> bool| {
        of_dives(&|dive: &JudgedDive| {
            let looked_at = || dive.sections.iter().filter(|section| !section.report.not_inspected);
            let count = looked_at().count();
            let of_them = looked_at().filter(|section| is(section, dive.report.target_m)).count();
            (count > 0).then(|| 100.0 * of_them as f64 / count as f64)
        })
    };
    let verdict = |section: &JudgedSection, word: &str| section.report.verdict == word;
    let falsely_passed =
        share(&move |section, target_m| section.report.verdict == "pass" && section.true_hole_m > target_m);
    let falsely_failed =
        share(&move |section, target_m| section.report.verdict == "fail" && section.true_hole_m <= target_m);
    let not_said =
        share(&|section, _| section.report.verdict == "cannot_say" || section.report.verdict == "open");
    let over = |dive: &JudgedDive, passed: bool| {
        let target_m = dive.report.target_m;
        let is_over = |section: &&JudgedSection| section.true_hole_m > target_m;
        dive.sections.iter().filter(is_over).filter(|section| !passed || verdict(section, "pass")).count()
    };
    let of_over: usize = dives.iter().map(|dive| over(dive, false)).sum();
    let passed: usize = dives.iter().map(|dive| over(dive, true)).sum();
    let of_over = (of_over > 0).then(|| {
        let passed = Interval::exact(100.0 * passed as f64 / of_over as f64);
        Error::new("passed, of sections over the target", "%", passed)
    });
    let median_m = of_dives(&|dive| quantile(&hole_errors_m(dive), 0.5));
    let most_m = of_dives(&|dive| quantile(&hole_errors_m(dive), 0.95));
    [
        error("|D - D_true|, median", "m", &median_m),
        error("|D - D_true|, 95 %", "m", &most_m),
        error("falsely passed", "m in 100", &falsely_passed),
        error("falsely failed", "m in 100", &falsely_failed),
        error("not said", "m in 100", &not_said),
        of_over,
    ]
    .into_iter()
    .flatten()
    .collect()
}
