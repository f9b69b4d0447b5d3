use super::*;
use crate::advice_log::AdviceEntry;
use crate::dive_plan::missed::MissedList;
use crate::fixtures::{advice, situation};
use crate::messages::Doubts;
use headrace_coverage::{
    HoleFinder, Judging, MissingSamples, Reach, Request, RunChange, RunId, SampleStore, Sections, StoreLayout,
};
use headrace_fusion::filter::cable::CableDoubt;
use headrace_fusion::relative::Relative;
use headrace_fusion::{Fix, NoFix};
use headrace_geometry::frames::{Point3, Pose, Rot};
use headrace_geometry::tunnel::shapes;
use headrace_sampling::Target;
use headrace_sensor::reading::Reading;
use headrace_vehicle::{AlertTiming, LimitsConfig};

const AT: MonoNs = MonoNs(9_000_000_000);
const SETTINGS: PlanSettings =
    PlanSettings { end_m: 100.0, transit_mps: 0.2, planned_mps: 0.1, run_up_m: 0.5 };

/// Live state after an advice update with this position error between passes.
///
/// The target is half a metre, and the confidence is two standard deviations.
fn after(pass_error_m: f64, is_cable_doubted: bool, no_fix: Option<NoFix>) -> LiveState {
    let pose = Pose { position: Point3::new(12.5, 0.0, 3.0), attitude: Rot::identity() };
    let relative = Relative::along(pass_error_m);
    let fix = Fix { pose, speed_mps: 0.07, relative, revisit: relative, tie: 0, settled: 0 };
    let fix = no_fix.map_or(Ok(fix), Err);
    let cable = is_cable_doubted.then_some(CableDoubt { since: AT, from_m: 12.0, differs_m: 0.5, log: None });
    let doubts = Doubts { cable, setting: None, unverified_mounts: false, stand_s: 3, hung: 0 };
    let pose = fix.ok().map(|fix| fix.pose);
    let situation = Situation { pose, speed_mps: 0.07, pass_error_m, ..situation(None) };
    let placement = Placement::Update(Update { at: AT, situation, doubts, fix, sd: None });
    let placed = Placed { items: vec![PlacedItem { event: 0, placement }], ..Placed::default() };
    let standing = Standing {
        missed_from_m: None,
        metres: Metres::default(),
        unsure: None,
        passed: false,
        back_to_m: None,
        missed: MissedList::default(),
        observations: [None; crate::observations::MOST_OBSERVATIONS],
    };
    let found = Found { standings: vec![standing], runs: Vec::new(), notices: Vec::new() };
    let entry = AdviceEntry { at: AT, chainage_m: None, speed_mps: 0.07, advice: advice(&situation) };
    let advised = Advised { entries: vec![entry], ..Advised::default() };
    let list = AlertList::new(AlertTiming::default(), LimitsConfig::default(), 100);
    let live = LiveState::new(Target::new(0.5), 0, 0);
    let mut alerter = Alerter::new(list, &live, Vec::new(), SETTINGS, (0, false));
    alerter.tick(&placed, &found, &advised, MonoNs(9_050_000_000));
    alerter.state
}

/// The position is doubtful once two standard deviations exceed a fifth of the target.
#[test]
fn position_is_doubtful_if_the_pass_error_is_large_or_the_cable_counter_is_distrusted() {
    let spread = PositionState::Doubtful(PositionDoubt::Spread);
    let cable = PositionState::Doubtful(PositionDoubt::Cable);
    for (pass_error_m, is_cable_doubted, no_fix, expected) in [
        (0.0, false, None, PositionState::Ok),
        (0.049, false, None, PositionState::Ok),
        (0.051, false, None, spread),
        (0.3, false, None, spread),
        (0.049, true, None, cable),
        (0.051, true, None, cable),
        (0.0, false, Some(NoFix::Chainage), PositionState::None(NoFix::Chainage)),
    ] {
        let state = after(pass_error_m, is_cable_doubted, no_fix);
        assert_eq!(state.position, expected, "{pass_error_m}");
        let has_fix = no_fix.is_none();
        assert_eq!((state.chainage_m, state.speed_mps), (has_fix.then_some(12.5), has_fix.then_some(0.07)));
        assert_eq!((state.at, state.now, state.stand_s), (Some(AT), MonoNs(9_050_000_000), 3));
    }
}

const NOW: MonoNs = MonoNs(9_000_000_000);

/// Missed stretch that consists of a single section without samples. It is flagged at the event with
/// the index `event` or, if `at_update` is true, at the advice update before that event.
fn run(event: usize, at_update: bool) -> RunInput {
    let profile = shapes::circle(3.0).unwrap();
    let perimeter_m = profile.perimeter_m();
    let layout = StoreLayout { perimeter_m, from_m: 0.0, to_m: 20.0, cell_m: 0.25, capacity: 100 };
    let mut sections = Sections::new(0.25, Target::new(0.5), 0.0, 20.0);
    let mut changed: Option<(RunId, RunChange)> = None;
    let request = Request {
        section: 4,
        at: NOW,
        swept_by_all: None,
        none_alive: false,
        to_come: Some(Reach { from_m: 19.0, to_m: f64::INFINITY }),
        not_passed: None,
        ended: None,
        only_fails: false,
    };
    let mut judging = Judging {
        store: &SampleStore::new(layout),
        missing_samples: &MissingSamples::default(),
        finder: &mut HoleFinder::default(),
        profile: &profile,
        tell: &mut |id, change| changed = Some((id, change)),
    };
    sections.judge(&request, &mut judging);
    RunInput::of((event, at_update), NOW, changed.unwrap(), &sections).unwrap()
}

/// Alerter with its inputs in one tick: a changed missed stretch, a command that acknowledges all
/// alerts, and ten events, each with one reading.
struct Bench {
    alerter: Alerter,
    run: RunInput,
    command: ReceivedCommand,
    events: Vec<Event>,
}

impl Bench {
    fn new(run: RunInput, command_before: usize) -> Self {
        let event = |k: u64| Event {
            source: SourceId(2),
            received: MonoNs(k),
            valid_at: MonoNs(k),
            reading: Reading::AngularRate(headrace_geometry::frames::Vec3::zero()),
        };
        let command = Command::Acknowledge { alert: 0, by: crate::console::Who::default() };
        let list = AlertList::new(AlertTiming::default(), LimitsConfig::default(), 100);
        Self {
            alerter: Alerter::new(
                list,
                &LiveState::new(Target::new(0.5), 0, 3),
                Vec::new(),
                SETTINGS,
                (1, false),
            ),
            run,
            command: ReceivedCommand { before: command_before, before_unread: 0, at: NOW, command },
            events: (0..10).map(event).collect(),
        }
    }

    /// Applies the inputs up to the advice update before event number `update`, or all inputs of the tick if `None`.
    ///
    /// Returns the number of alerts raised, the number of acknowledged alerts, the number of commands without effect,
    /// and the last reading's time.
    fn until(&mut self, update: Option<usize>) -> (u32, usize, u64, Option<u64>) {
        let Self { alerter, run, command, events } = self;
        let (runs, commands) = (core::slice::from_ref(run), core::slice::from_ref(command));
        let mut inputs = Inputs { runs, commands, events, unread: &[], taken: Taken::default() };
        match update {
            Some(event) => alerter.take_before(event, &mut inputs),
            None => alerter.take_rest(&mut inputs),
        }
        let acknowledged = alerter.list.iter().filter(|alert| alert.acknowledged.is_some()).count();
        let heard = alerter.state.heard.get(2).copied().flatten().map(|at| at.0);
        (alerter.list.raised(), acknowledged, alerter.without_effect, heard)
    }
}

#[test]
fn command_is_applied_before_the_results_of_the_next_event() {
    for (before, acknowledged) in [(4, 0), (5, 0), (6, 1), (9, 1)] {
        let found = Bench::new(run(5, false), before).until(None);
        assert_eq!(found, (1, acknowledged, 1 - acknowledged as u64, Some(9)), "{before}");
    }
}

#[test]
fn alerter_update_applies_only_inputs_before_the_update() {
    let at = |run: RunInput, command_before: usize, update: usize| {
        Bench::new(run, command_before).until(Some(update))
    };
    assert_eq!(at(run(4, false), 9, 5), (1, 0, 0, Some(4)));
    assert_eq!(at(run(5, false), 9, 5), (0, 0, 0, Some(4)), "that event comes after the update");
    assert_eq!(at(run(5, true), 9, 5), (1, 0, 0, Some(4)), "at the update itself");
    assert_eq!(at(run(6, true), 9, 5), (0, 0, 0, Some(4)));
    assert_eq!(at(run(9, false), 5, 5), (0, 0, 1, Some(4)), "the command comes just before the update");
    assert_eq!(at(run(9, false), 6, 5), (0, 0, 0, Some(4)), "the command comes after the update");
    assert_eq!(at(run(2, false), 4, 5), (1, 1, 0, Some(4)));
    assert_eq!(at(run(2, false), 4, 0), (0, 0, 0, None));
}
