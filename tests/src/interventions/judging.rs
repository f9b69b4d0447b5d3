//! Judges the displayed causes of a dive by its simulations with and without each injected cause.

use headrace_coverage::{Cause, Evidence, Verdict};
use headrace_monitor::report::Report;
use headrace_monitor::section_row::SectionRow;

use super::draw::{Drawn, Injected, KINDS, START_M};
use crate::scenes;

/// Distance from the ends of the trajectory within which sections are ignored, m, because they always fail.
const END_M: f64 = 2.0;
/// Largest distance at which two failed sections belong to one stretch, m.
const JOIN_M: f64 = 0.5;

/// Largest ratio of diameter to target at which a hole counts as close to the target.
const CLOSE: f64 = 1.05;

/// Alternative sets of causes for a failed section, each set sorted. A displayed set is right if it equals one of these
/// sets.
pub type Right = Vec<Vec<Cause>>;

/// A failed section with true and displayed causes.
#[derive(Debug, Clone)]
pub struct Judged {
    /// Chainage of the section's start and end, m.
    pub ends_m: [f64; 2],
    /// Sets of causes that count as right.
    pub right: Right,
    /// Displayed causes, sorted.
    pub reported: Vec<Cause>,
    /// Number of the missed stretch (`run`) to which the section belongs.
    pub run: Option<u32>,
    /// Diameter of the section's hole, m.
    pub hole_m: f64,
    /// For each injected cause, the diameter of the hole if this cause is removed, m; infinite if the hole can't be
    /// measured.
    pub without_m: Vec<f64>,
    /// Evidence that the program reports for the displayed causes.
    pub evidence: Evidence,
}

impl Judged {
    /// Whether the displayed causes equal one of the right sets.
    pub fn is_right(&self) -> bool {
        self.right.contains(&self.reported)
    }

    /// Whether a single cause is displayed that is nearly right. Such a cause was injected, and without it the hole
    /// exceeds the target by at most 5 %.
    pub fn is_close(&self, injected: &[Injected], target_m: f64) -> bool {
        let alone = injected.iter().zip(&self.without_m).find(|(cause, _)| self.reported == [cause.cause()]);
        alone.is_some_and(|(_, hole_m)| *hole_m <= CLOSE * target_m)
    }
}

/// A drawn dive with its failed sections, and the true and displayed causes of these sections.
pub struct InterventionDive {
    /// The dive as drawn from its seed, with its final target.
    pub drawn: Drawn,
    /// Report of the dive with all injected causes.
    pub report: Report,
    /// Failed sections that the injected causes can explain.
    pub sections: Vec<Judged>,
}

/// A stretch: neighbouring failed sections that have at least one right set of causes in common.
pub struct Stretch<'a> {
    /// Sections of the stretch.
    pub sections: &'a [Judged],
    /// Sets of causes that are right for all sections of the stretch.
    pub right: Right,
}

impl Stretch<'_> {
    /// The set of causes that is displayed for more of the stretch's sections than any other set.
    pub fn reported(&self) -> &[Cause] {
        let count =
            |reported: &[Cause]| self.sections.iter().filter(|section| section.reported == reported).count();
        self.sections
            .iter()
            .map(|section| section.reported.as_slice())
            .max_by_key(|reported| count(reported))
            .unwrap_or(&[])
    }

    /// Number of missed stretches (`run`) that the program displays for the sections of this stretch.
    pub fn runs(&self) -> usize {
        let mut runs: Vec<u32> = self.sections.iter().filter_map(|section| section.run).collect();
        runs.sort_unstable();
        runs.dedup();
        runs.len()
    }
}

/// Report of a dive with the injected causes that `is_in` selects.
pub fn report(drawn: &Drawn, is_in: &dyn Fn(usize) -> bool) -> Report {
    let vehicle = drawn.vehicle(is_in);
    let scene = scenes::scene_from(&drawn.scene(is_in), &|_| Ok(vehicle.as_bytes().to_vec()));
    scenes::report(&scene)
}

/// Draws a dive and simulates it with and without each of its injected causes.
pub fn intervene(seed: u64, kinds: &[usize]) -> InterventionDive {
    let mut drawn = Drawn::of(seed, kinds);
    let without_all = report(&drawn, &|_| false);
    let inner_m = [START_M + END_M, drawn.end_m - 0.25];
    let is_inner = |section: &&SectionRow| section.start_m >= inner_m[0] && section.end_m <= inner_m[1];
    let holes_m = without_all.sections.iter().filter(is_inner).filter_map(|section| section.hole_m);
    drawn.target_m = drawn.margin * holes_m.fold(0.0, f64::max);
    // The target may still be changed here, because holes don't depend on it. All later reports use the new target for
    // their verdicts.
    let all = report(&drawn, &|_| true);
    let without: Vec<Report> = match kinds {
        [_, _] => (0..2).map(|k| report(&drawn, &|other| other != k)).collect(),
        _ => vec![without_all.clone()],
    };
    let run_of = |at_m: f64| {
        let has = |run: &&headrace_monitor::report::RunReport| {
            run.merged_into.is_none() && run.cleared_s.is_none() && (run.start_m..run.end_m).contains(&at_m)
        };
        all.runs.iter().filter(has).map(|run| run.id).collect::<Vec<_>>()
    };
    let mut sections = Vec::new();
    for section in all.sections.iter().filter(is_inner) {
        let Some(evidence) = section.cause.as_ref().filter(|_| section.verdict == Verdict::Fail) else {
            continue;
        };
        let hole_m = |report: &Report| hole_at_m(report, section.start_m);
        let without_m: Vec<f64> = without.iter().map(hole_m).collect();
        let passes = |report: &Report| hole_m(report) <= drawn.target_m;
        let Some(right) =
            right(&drawn, &without.iter().map(passes).collect::<Vec<_>>(), passes(&without_all))
        else {
            continue;
        };
        let reported = reported(evidence);
        let runs = run_of(f64::midpoint(section.start_m, section.end_m));
        let of_cause = |id: &&u32| all.runs[**id as usize].cause == evidence.cause;
        let run = runs.iter().find(of_cause).or(runs.first()).copied();
        sections.push(Judged {
            ends_m: [section.start_m, section.end_m],
            right,
            reported,
            run,
            hole_m: section.hole_m.unwrap_or(0.0),
            without_m,
            evidence: *evidence,
        });
    }
    InterventionDive { drawn, report: all, sections }
}

/// Diameter of the hole in the section that begins at `start_m`, m; infinite if it can't be measured.
pub(super) fn hole_at_m(report: &Report, start_m: f64) -> f64 {
    let same = report.sections.iter().find(|other| (other.start_m - start_m).abs() < 1e-6);
    same.and_then(|same| same.hole_m).unwrap_or(f64::INFINITY)
}

/// Displayed causes in a section's evidence, sorted.
fn reported(evidence: &Evidence) -> Vec<Cause> {
    evidence.causes.iter().collect()
}

/// Sets of causes that count as right for a section; `None` if the section fails even without all injected causes.
pub(super) fn right(drawn: &Drawn, alone: &[bool], together: bool) -> Option<Right> {
    if !together {
        return None;
    }
    let cause = |k: usize| drawn.injected[k].cause();
    let single: Right =
        alone.iter().enumerate().filter(|(_, passes)| **passes).map(|(k, _)| vec![cause(k)]).collect();
    if !single.is_empty() {
        return Some(single);
    }
    let mut both: Vec<Cause> = (0..drawn.injected.len()).map(cause).collect();
    both.sort_by_key(|cause| *cause as usize);
    Some(vec![both])
}

impl InterventionDive {
    /// Stretches of the failed sections.
    pub fn stretches(&self) -> Vec<Stretch<'_>> {
        let mut stretches: Vec<Stretch<'_>> = Vec::new();
        let mut from = 0;
        for k in 0..self.sections.len() {
            let section = &self.sections[k];
            let near = k > from && section.ends_m[0] - self.sections[k - 1].ends_m[1] <= JOIN_M + 1e-9;
            let common: Right = match stretches.last().filter(|_| near) {
                Some(before) => {
                    before.right.iter().filter(|set| section.right.contains(set)).cloned().collect()
                }
                None => Right::new(),
            };
            if let (false, Some(last)) = (common.is_empty(), stretches.last_mut()) {
                *last = Stretch { sections: &self.sections[from..=k], right: common };
            } else {
                from = k;
                stretches.push(Stretch { sections: &self.sections[k..=k], right: section.right.clone() });
            }
        }
        stretches
    }
}

/// Kinds of causes in the dive with this seed. Dives with even seeds have one cause, all others have two. Consecutive
/// dives take the causes in turn.
pub fn kinds(seed: u64) -> Vec<usize> {
    let number = usize::try_from(seed).unwrap();
    if number.is_multiple_of(2) {
        return vec![number / 2 % KINDS.len()];
    }
    // Dives with two causes take all pairs of causes in turn.
    let pairs: Vec<[usize; 2]> =
        (0..KINDS.len()).flat_map(|a| (a + 1..KINDS.len()).map(move |b| [a, b])).collect();
    pairs[number / 2 * 17 % pairs.len()].to_vec()
}
