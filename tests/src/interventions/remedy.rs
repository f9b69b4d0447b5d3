//! Remedies: what is told to do about a run is done in the simulator, and its sections pass or don't.

use headrace_coverage::Action;
use headrace_monitor::report::ReturnReport;

use super::{Injected, Intervened, Judged, report};

/// How much more than the stretch is passed otherwise, m: heads sit apart along the hull.
const ROOM_M: f64 = 2.0;
/// How far a vehicle is rolled that hides the wall from its heads, degrees.
const ROLLED_DEG: f64 = 75.0;

/// A run with what was told to do about it, and whether that clears it.
#[derive(Debug, Clone)]
pub struct Remedied {
    /// What was told.
    pub told: ReturnReport,
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
    let then = report(&dive.drawn.changed(&mended, over_m, told.at_most_mps, again_deg), &|_| true);
    let clears = sections.iter().all(|section| {
        let same = then.sections.iter().find(|other| (other.start_m - section.ends_m[0]).abs() < 1e-6);
        same.and_then(|same| same.hole_m).is_some_and(|hole_m| hole_m <= dive.drawn.target_m)
    });
    Remedied { told: told.clone(), clears }
}
