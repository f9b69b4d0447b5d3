//! Simulates the displayed remedy of each missed stretch, to find out whether the sections of the stretch then pass.

use headrace_coverage::Action;
use headrace_monitor::report::ReturnReport;

use super::draw::Injected;
use super::judging::{InterventionDive, Judged, hole_at_m, report};

/// Length added at either end of a stretch that is passed again, m, because heads are mounted at different places along
/// the hull.
const ROOM_M: f64 = 2.0;
/// Roll angle for the second pass of a vehicle that hides part of the wall from its own heads, degrees.
const ROLLED_DEG: f64 = 75.0;

/// A missed stretch with its displayed remedy, and the result of simulating the remedy.
#[derive(Debug, Clone)]
pub struct Remedied {
    /// Remedy that the program displays for the missed stretch.
    pub reported: ReturnReport,
    /// For each section of the stretch: its start, and its hole diameter after the remedy, m. The diameter is infinite
    /// if it can't be measured.
    pub then_m: Vec<[f64; 2]>,
    /// Whether all sections of the stretch meet the target after the remedy.
    pub clears: bool,
}

/// Whether a displayed action removes an injected cause.
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

/// Simulates the displayed remedy of each missed stretch. Skips missed stretches in which injected causes explain no
/// section.
pub fn remedies(dive: &InterventionDive) -> Vec<Remedied> {
    let of_run = |reported: &ReturnReport| -> Vec<Judged> {
        dive.sections.iter().filter(|section| section.run == Some(reported.run)).cloned().collect()
    };
    let runs = dive.report.go_back.iter().map(|reported| (reported, of_run(reported)));
    runs.filter(|(_, sections)| !sections.is_empty())
        .map(|(reported, sections)| remedy(dive, reported, &sections))
        .collect()
}

fn remedy(dive: &InterventionDive, reported: &ReturnReport, sections: &[Judged]) -> Remedied {
    let has = |action: Action| reported.actions.contains(&action);
    let over_m = [reported.to_m - ROOM_M, reported.from_m + ROOM_M];
    let mended = |injected: &Injected| reported.actions.iter().any(|action| mends(*action, injected));
    let turned_back = dive.drawn.injected.contains(&Injected::NotPassed);
    let again_deg = if has(Action::OtherSide) {
        Some(ROLLED_DEG)
    } else {
        (has(Action::Again) && !turned_back).then_some(0.0)
    };
    // If the action "slower" has no speed, the remedy's other settings of the heads are enough at the planned speed.
    let at_most_mps = if reported.at_most_mps > 0.0 || !has(Action::Slower) {
        reported.at_most_mps
    } else {
        dive.drawn.speed_mps
    };
    let then = report(&dive.drawn.changed(&mended, over_m, at_most_mps, again_deg), &|_| true);
    let then_m: Vec<[f64; 2]> =
        sections.iter().map(|section| [section.ends_m[0], hole_at_m(&then, section.ends_m[0])]).collect();
    let clears = then_m.iter().all(|[_, hole_m]| *hole_m <= dive.drawn.target_m);
    Remedied { reported: reported.clone(), then_m, clears }
}
