//! Remedies: what is told to do about a run is done in the simulator, and its sections pass or don't.

use headrace_coverage::Action;
use headrace_monitor::report::ReturnReport;

use super::{Injected, Intervened, Judged, hole_at_m, report};

/// How much more than the stretch is passed otherwise, m: heads sit apart along the hull.
const ROOM_M: f64 = 2.0;
/// How far a vehicle is rolled that hides the wall from its heads, degrees.
const ROLLED_DEG: f64 = 75.0;

/// A run with what was told to do about it, and whether that clears it.
#[derive(Debug, Clone)]
pub struct Remedied {
    /// What was told.
    pub told: ReturnReport,
    /// Holes of its sections then, by where they begin, m; infinite where there is none to be measured.
    pub then_m: Vec<[f64; 2]>,
    /// Whether all of its sections then meet the target.
    pub clears: bool,
}

/// Whether an action takes an injected cause away.
fn mends(action: Action, injected: &Injected) -> bool {
    match action {
        Action::FinerMode => matches!(injected, Injected::AngularStep { .. }),
        Action::LongerRange => matches!(injected, Injected::OutOfRange { .. }),
        Action::Middle => matches!(injected, Injected::Aside { .. } | Injected::Swing { .. }),
        Action::InPhase => matches!(injected, Injected::Phase { .. }),
        Action::Head => matches!(injected, Injected::HeadStalled { .. }),
        Action::HeadBack => matches!(injected, Injected::HeadSilent { .. }),
        Action::Position => matches!(injected, Injected::PositionLost { .. }),
        Action::Again => *injected == Injected::NotPassed,
        Action::HigherGain => matches!(injected, Injected::MissingReturns { .. }),
        Action::Slower | Action::OtherSide => false,
    }
}

/// Does what was told about each run of a dive that has failed sections to be explained.
pub fn remedies(dive: &Intervened) -> Vec<Remedied> {
    let of_run = |told: &ReturnReport| -> Vec<Judged> {
        dive.sections.iter().filter(|section| section.run == Some(told.run)).cloned().collect()
    };
    let runs = dive.report.way_home.iter().map(|told| (told, of_run(told)));
    runs.filter(|(_, sections)| !sections.is_empty())
        .map(|(told, sections)| remedy(dive, told, &sections))
        .collect()
}

fn remedy(dive: &Intervened, told: &ReturnReport, sections: &[Judged]) -> Remedied {
    let has = |action: Action| told.actions.contains(&action);
    let over_m = [told.to_m - ROOM_M, told.from_m + ROOM_M];
    let mended = |injected: &Injected| told.actions.iter().any(|action| mends(*action, injected));
    let turned_back = dive.drawn.injected.contains(&Injected::NotPassed);
    let again_deg = if has(Action::OtherSide) {
        Some(ROLLED_DEG)
    } else {
        (has(Action::Again) && !turned_back).then_some(0.0)
    };
    // Slower without a speed is the planned one, in other settings of the heads.
    let at_most_mps =
        if told.at_most_mps > 0.0 || !has(Action::Slower) { told.at_most_mps } else { dive.drawn.speed_mps };
    let then = report(&dive.drawn.changed(&mended, over_m, at_most_mps, again_deg), &|_| true);
    let then_m: Vec<[f64; 2]> =
        sections.iter().map(|section| [section.ends_m[0], hole_at_m(&then, section.ends_m[0])]).collect();
    let clears = then_m.iter().all(|[_, hole_m]| *hole_m <= dive.drawn.target_m);
    Remedied { told: told.clone(), then_m, clears }
}
