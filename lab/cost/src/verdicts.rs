//! Errors of a judging method, in quantities that matter to a survey: the hole diameter, and the lengths falsely
//! passed, falsely failed, or not judged.

use crate::point::{Error, Interval, quantile};
use headrace_coverage::Verdict;
use headrace_oracle::dive::{JudgedDive, JudgedSection};

/// Length that is left out at each end of a dive, in addition to a length equal to the target, m.
///
/// Sections near the ends have neighbours on one side only. The length is the sum of the hull's length and the distance
/// to the next pass.
pub const END_M: f64 = 2.0;

/// A section as judged by a method, with its true hole.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Judged {
    /// Length of the section, m.
    pub length_m: f64,
    /// Hole diameter D as judged, m; `None` if D is unknown, or only bounded from below.
    pub hole_m: Option<f64>,
    /// Whether the section's hole is within the target; `None` if the verdict is undecided.
    pub passes: Option<bool>,
    /// D_true: the true diameter of the section's largest hole, m.
    pub true_hole_m: f64,
}

impl Judged {
    /// The section as judged in the report.
    pub fn of(section: &JudgedSection) -> Self {
        Self {
            length_m: section.report.end_m - section.report.start_m,
            hole_m: section.report.hole_m.filter(|_| section.report.hole_bounded),
            passes: match section.report.verdict {
                Verdict::Pass => Some(true),
                Verdict::Fail => Some(false),
                _ => None,
            },
            true_hole_m: section.true_hole_m,
        }
    }
}

/// The sections of a dive, except those near its ends.
pub fn inner(dive: &JudgedDive) -> impl Iterator<Item = &JudgedSection> {
    let end_m = END_M + dive.report.target_m;
    let [least_m, most_m] = dive.truth.way_m;
    dive.sections.iter().filter(move |section| {
        let [from_m, to_m] = [section.report.start_m, section.report.end_m].map(|x_m| x_m + section.shift_m);
        from_m >= least_m + end_m && to_m <= most_m - end_m
    })
}

/// The errors of a setting, from the sections of each of its dives.
///
/// The errors are the 95th percentile and the median of the hole error |D - D_true|; the metres per 100 m falsely
/// passed, falsely failed and undecided; and the share of sections over the target that pass. Each value is the median
/// over the dives, with the least and the largest as bounds. A dive without the sections that an error needs is left
/// out.
pub fn errors(dives: &[Vec<Judged>], target_m: f64) -> Vec<Error> {
    let off_m = |dive: &Vec<Judged>| -> Vec<f64> {
        let off = |judged: &Judged| Some((judged.hole_m? - judged.true_hole_m).abs());
        dive.iter().filter_map(off).filter(|off_m| off_m.is_finite()).collect()
    };
    let is_over = |judged: &Judged| judged.true_hole_m > target_m;
    let in_100 = |dive: &Vec<Judged>, is: &dyn Fn(&Judged) -> bool| {
        let sum = |is: &dyn Fn(&Judged) -> bool| -> f64 {
            dive.iter()
                .filter(|judged| is(judged))
                .map(|judged| judged.length_m)
                .fold(0.0, |all, one| all + one)
        };
        let all_m = sum(&|_| true);
        (all_m > 0.0).then(|| 100.0 * sum(is) / all_m)
    };
    let falsely_passed = |judged: &Judged| judged.passes == Some(true) && is_over(judged);
    let falsely_failed = |judged: &Judged| judged.passes == Some(false) && !is_over(judged);
    let all = |of: &dyn Fn(&Vec<Judged>) -> Option<f64>| dives.iter().filter_map(of).collect::<Vec<f64>>();
    let over = |dive: &Vec<Judged>| dive.iter().filter(|judged| is_over(judged)).copied().collect::<Vec<_>>();
    let figures = [
        ("abs(D - D_true), 95th percentile", "m", all(&|dive| quantile(&off_m(dive), 0.95))),
        ("abs(D - D_true), median", "m", all(&|dive| quantile(&off_m(dive), 0.5))),
        ("falsely passed in 100 m", "m", all(&|dive| in_100(dive, &falsely_passed))),
        ("falsely failed in 100 m", "m", all(&|dive| in_100(dive, &falsely_failed))),
        ("not said in 100 m", "m", all(&|dive| in_100(dive, &|judged| judged.passes.is_none()))),
        ("passed of those over the target", "%", all(&|dive| in_100(&over(dive), &falsely_passed))),
    ];
    let error = |(name, unit, values): (&str, &str, Vec<f64>)| {
        let [low, middle, high] = [0.0, 0.5, 1.0].map(|share| quantile(&values, share));
        Some(Error::new(name, unit, Interval { low: low?, middle: middle?, high: high? }))
    };
    figures.into_iter().filter_map(error).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judged(hole_m: f64, passes: Option<bool>, true_hole_m: f64) -> Judged {
        Judged { length_m: 0.25, hole_m: Some(hole_m), passes, true_hole_m }
    }

    #[test]
    fn verdict_errors_equal_the_errors_planted_in_the_test_data() {
        let dive = vec![
            judged(0.4, Some(true), 0.4),
            judged(0.4, Some(true), 0.6),
            judged(0.6, Some(false), 0.5),
            judged(0.6, None, 0.7),
        ];
        let found = errors(&[dive], 0.5);
        let middle: Vec<f64> =
            found.iter().map(|error| (error.interval.middle * 1e9).round() * 1e-9).collect();
        // The errors are 0, 0.2, 0.1 and 0.1 m; the four sections are a metre long together.
        assert_eq!(middle, [0.185, 0.1, 25.0, 25.0, 25.0, 50.0]);
    }

    #[test]
    fn dive_without_sections_gives_no_error_figures() {
        assert!(errors(&[Vec::new()], 0.5).is_empty());
    }
}
