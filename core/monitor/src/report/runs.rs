//! Missed stretches in the report, and the stretches to pass again.

use serde::Serialize;

use crate::pilot_text::CauseFigures;
use crate::run::Loop;
use crate::source::SourceInfo;
use headrace_coverage::{Action, Again, Cause, Run, RunId, Runs, Sections, Verdict};
use headrace_sensor::device::{SensorInfo, SensorKind};

/// A missed stretch: neighbouring sections that are flagged as missed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RunReport {
    /// Number of the stretch, which never changes.
    pub id: u32,
    /// Main cause: the cause that applies to most sections of the stretch.
    pub cause: Cause,
    /// All causes of the stretch's sections: the main cause first, then the other causes by frequency.
    pub causes: Vec<Cause>,
    /// Figures for the causes that the text names. The figures for a cause come from a section with this cause.
    #[serde(skip)]
    pub figures: Option<CauseFigures>,
    /// Source ids of the heads that were silent in the section with the largest hole, or in the section that
    /// represents silence as a cause.
    pub silent_sources: Vec<String>,
    /// Beginning of the missed stretch, m.
    pub start_m: f64,
    /// End of the missed stretch, m.
    pub end_m: f64,
    /// Length of the stretch's sections that fail at present, m.
    pub failed_m: f64,
    /// Diameter of the stretch's largest hole, m. For a cleared stretch, the diameter before it was cleared.
    pub hole_m: f64,
    /// Chainage of the largest hole's centre, m.
    pub hole_x_m: f64,
    /// Clock position of the hole's centre, looking along the tunnel.
    pub hole_clock: String,
    /// Dive time at which the stretch was first flagged, seconds.
    pub raised_s: f64,
    /// Dive time at which the stretch was cleared or merged into another one, seconds; `None` before.
    pub cleared_s: Option<f64>,
    /// Number of the stretch into which this stretch was merged.
    pub merged_into: Option<u32>,
}

/// A stretch that the vehicle should pass again.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReturnReport {
    /// Number of the missed stretch.
    pub run: u32,
    /// Chainage of the stretch's far end, m.
    pub from_m: f64,
    /// Chainage of the stretch's near end, m.
    pub to_m: f64,
    /// Chainage to which the vehicle's origin has to go back, m.
    ///
    /// On the way from there, all heads pass the whole stretch.
    pub back_to_m: f64,
    /// Action against the stretch's main cause.
    pub action: Action,
    /// All actions against the stretch's causes, in the order of the causes.
    pub actions: Vec<Action>,
    /// Maximum speed for passing the stretch again, m/s.
    ///
    /// It is the planned speed if that meets the target, and zero if no speed in this mode meets it.
    pub at_most_mps: f64,
    /// Duration of passing the stretch at `at_most_mps`, seconds. It includes a second pass if the vehicle has to roll
    /// to each side.
    pub takes_s: Option<f64>,
}

pub(super) fn run_reports(dive: &Loop) -> Vec<RunReport> {
    let (sections, profile) = (&dive.view().coverage().sections, &dive.mission().profile);
    let (heads, clock) = (head_ids(dive), dive.view().clock());
    let bounds = |run: &Run| (sections.bounds_m(run.from).0, sections.bounds_m(run.to - 1).1);
    (0..)
        .zip(sections.runs().all())
        .map(|(id, run)| {
            let ((start_m, end_m), (_, hole)) = (bounds(run), run.worst);
            let figures = CauseFigures::of_run(sections, run);
            let silent = figures.iter().flat_map(|figures| figures.silent_heads.iter());
            RunReport {
                id,
                cause: run.cause,
                causes: run.causes(),
                figures,
                silent_sources: silent.filter_map(|head| heads.get(head).cloned()).collect(),
                start_m,
                end_m,
                failed_m: failed_m(sections, run),
                hole_m: hole.diameter_m,
                hole_x_m: hole.x_m,
                hole_clock: profile.clock(hole.arc_m),
                raised_s: clock.seconds(run.raised),
                cleared_s: run.cleared.map(|at| clock.seconds(at)),
                merged_into: run.merged_into.map(|id| id.0),
            }
        })
        .collect()
}

/// Length of a missed stretch's sections that fail at present, m.
///
/// A section may keep its flag although it no longer fails. Such a section doesn't count.
fn failed_m(sections: &Sections, run: &Run) -> f64 {
    let fails = |index: &i64| sections.get(*index).is_some_and(|section| section.verdict == Verdict::Fail);
    (run.from..run.to).filter(fails).count() as f64 * sections.section_m()
}

/// Source ids of the heads, by number of the head.
fn head_ids(dive: &Loop) -> Vec<String> {
    let is_head = |(_, sensor): &(&SourceInfo, SensorInfo)| sensor.kind == SensorKind::Head;
    dive.sources().iter().zip(dive.sensors()).filter(is_head).map(|(source, _)| source.id.clone()).collect()
}

/// Stretches to pass again according to the present verdicts. These are all missed stretches that are not cleared yet,
/// from the far end to the portal.
pub fn go_back(sections: &Sections) -> Vec<ReturnReport> {
    let runs: &Runs = sections.runs();
    let open = (0..).map(RunId).zip(runs.all()).filter(|(_, run)| run.is_open());
    let mut stops: Vec<ReturnReport> = open.map(|(id, run)| stop(sections, id, run)).collect();
    stops.sort_by(|a, b| b.from_m.total_cmp(&a.from_m));
    stops
}

fn stop(sections: &Sections, id: RunId, run: &Run) -> ReturnReport {
    let (to_m, from_m) = (sections.bounds_m(run.from).0, sections.bounds_m(run.to - 1).1);
    let Again { at_most_mps, is_beyond_speed } = run.again();
    let actions = Action::against(run.causes(), is_beyond_speed);
    let times = if actions.contains(&Action::OtherSide) { 2.0 } else { 1.0 };
    let takes_s = (at_most_mps > 0.0).then(|| times * (from_m - to_m) / at_most_mps);
    let back_to_m = sections.back_to_m(to_m);
    ReturnReport {
        run: id.0,
        from_m,
        to_m,
        back_to_m,
        action: actions.first().copied().unwrap_or(Action::Again),
        actions,
        at_most_mps,
        takes_s,
    }
}
