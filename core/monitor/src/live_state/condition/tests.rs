use super::*;
use crate::fixtures;
use crate::live_state::SensorState;
use headrace_coverage::Metres;
use headrace_geometry::time::MonoNs;
use headrace_sampling::Target;
use headrace_sampling::advice::Advice;

const fn at(seconds: u64) -> MonoNs {
    MonoNs(seconds * 1_000_000_000)
}

/// Test advice with this reason, largest speed and forecast spacing T.
fn advice(reason: Reason, v_max_mps: f64, t_m: f64) -> Advice {
    let none = fixtures::advice(&fixtures::situation(None));
    Advice { reason, v_max_mps, predicted_t_m: Some(t_m), will_exceed: t_m > 0.5, ..none }
}

/// Live state with two heads and another sensor. Their last readings came at 10 s. The speed and its limit
/// are 0.07 m/s.
pub(crate) fn state() -> LiveState {
    let mut heard = LiveState::new(Target::new(0.5), 0b11, 3).heard;
    heard[..3].fill(Some(at(10)));
    LiveState {
        now: at(10),
        at: Some(at(10)),
        position: PositionState::Ok,
        chainage_m: Some(1240.5),
        pass_sd_m: 0.02,
        speed_mps: Some(0.07),
        advice: Some(advice(Reason::HelixPitch, 0.07, 0.46)),
        metres: Metres { pass_m: 12.0, open_m: 1.5, ..Metres::default() },
        turning: 0b11,
        heard,
        ..LiveState::new(Target::new(0.5), 0b11, 3)
    }
}

#[test]
fn lamp_colour_follows_the_ratio_of_speed_to_v_max() {
    let driven = |speed_mps| LiveState { speed_mps: Some(speed_mps), ..state() };
    let shown = [0.05, 0.0713, 0.073, 0.11, -0.11].map(|mps| {
        let condition = driven(mps).condition();
        (condition.as_str(), condition.lamp())
    });
    assert_eq!(
        shown,
        [
            ("good", Lamp::Green),
            ("good", Lamp::Green),
            ("over", Lamp::Amber),
            ("too_fast", Lamp::Red),
            ("too_fast", Lamp::Red)
        ]
    );
}

/// Over wall that has passed, any speed is fine, unless the position is doubtful or sonar data are missing.
#[test]
fn any_speed_is_fine_over_wall_with_the_verdict_pass() {
    let back = LiveState { passed: true, speed_mps: Some(-0.3), ..state() };
    assert_eq!((back.condition(), back.condition().lamp()), (Condition::Passed, Lamp::Green));
    let coarse = LiveState { advice: Some(advice(Reason::AngularStep, 0.0, 0.9)), ..back };
    assert_eq!(coarse.condition(), Condition::Passed);
    let doubtful = LiveState { position: PositionState::Doubtful(PositionDoubt::Cable), ..back };
    assert_eq!(doubtful.condition(), Condition::TooFast);
    let mut mute = back;
    mute.heard[..2].fill(Some(at(7)));
    assert_eq!(mute.condition(), Condition::NoSonar);
}

/// The vehicle goes back, and passes a missed stretch again from the turning point on. It also covers wall on
/// its way back, if it is slow enough.
#[test]
fn any_speed_is_fine_on_the_way_back_to_a_missed_stretch() {
    let back = LiveState { back_to_m: Some(8.2), speed_mps: Some(-0.3), ..state() };
    assert_eq!((back.condition(), back.condition().lamp()), (Condition::GoingBack(8.2), Lamp::Green));
    assert_eq!(LiveState { speed_mps: Some(-0.05), ..back }.condition(), Condition::Good);
    let doubtful = LiveState { position: PositionState::Doubtful(PositionDoubt::Cable), ..back };
    assert_eq!(doubtful.condition(), Condition::TooFast);
    let coarse = LiveState { advice: Some(advice(Reason::AngularStep, 0.0, 0.9)), ..back };
    assert_eq!(coarse.condition(), Condition::GoingBack(8.2));
}

#[test]
fn turn_fails_condition_holds_only_while_the_forecast_exceeds_the_target() {
    let forecast = |t_m| Advice { will_exceed: true, ..advice(Reason::HelixPitch, 0.07, t_m) };
    let condition_at = |t_m| LiveState { advice: Some(forecast(t_m)), ..state() }.condition();
    assert_eq!([condition_at(0.6), condition_at(0.4)], [Condition::TurnFails, Condition::Good]);
}

#[test]
fn condition_is_not_good_if_the_forecast_may_exceed_the_target() {
    let forecast = |may_exceed, will_exceed| Advice {
        may_exceed,
        will_exceed,
        ..advice(Reason::HelixPitch, 0.07, if will_exceed { 0.6 } else { 0.48 })
    };
    let driven = |advice, speed_mps| {
        LiveState { advice: Some(advice), speed_mps: Some(speed_mps), ..state() }.condition()
    };
    assert_eq!(driven(forecast(true, false), 0.06), Condition::TurnUnsure);
    assert_eq!(driven(forecast(false, false), 0.06), Condition::Good);
    assert_eq!(driven(forecast(true, true), 0.06), Condition::TurnFails, "the graver condition of the two");
    assert_eq!(
        driven(forecast(true, false), 0.07),
        Condition::Good,
        "no better speed is known than the present one"
    );
    assert_eq!(driven(forecast(true, false), 0.072), Condition::Over, "exceeding the limit is the reason");
    assert_eq!(Condition::TurnUnsure.lamp(), Lamp::Amber);
}

#[test]
fn missing_data_takes_precedence_over_doubtful_data() {
    let doubtful = LiveState { position: PositionState::Doubtful(PositionDoubt::Cable), ..state() };
    assert_eq!(doubtful.condition(), Condition::CannotSay(PositionDoubt::Cable));
    assert_eq!(LiveState { speed_mps: Some(0.11), ..doubtful }.condition(), Condition::TooFast);
    let coarse = LiveState { advice: Some(advice(Reason::AngularStep, 0.0, 0.9)), ..state() };
    assert_eq!(coarse.condition(), Condition::NoSpeed);
    let mut mute = doubtful;
    mute.heard[..2].fill(Some(at(7)));
    assert_eq!(mute.condition(), Condition::NoSonar);
    let lost = LiveState { position: PositionState::None(NoFix::Chainage), ..mute };
    assert_eq!(lost.condition(), Condition::NoPosition(NoFix::Chainage));
    let old = LiveState { now: at(42), ..lost };
    assert_eq!(old.condition(), Condition::Old(DurNs(32_000_000_000)));
    assert_eq!(LiveState { at: None, ..old }.condition(), Condition::NoData);
}

#[test]
fn live_state_becomes_stale_as_ticks_continue_without_data() {
    let after = |ms: u64| LiveState { now: MonoNs(at(10).0 + ms * 1_000_000), ..state() };
    assert_eq!([after(2000), after(2001)].map(|state| state.is_old()), [false, true]);
    assert_eq!(
        [after(2000), after(2001)].map(|state| state.sensor(0)),
        [SensorState::Ok, SensorState::Silent]
    );
    assert_eq!(after(30_000).age().map(DurNs::as_secs_f64), Some(30.0));
    assert_eq!(LiveState { now: at(9), ..state() }.age(), Some(DurNs(0)), "the clock was set back");
}

#[test]
fn readings_decide_whether_a_sensor_is_ok_stalled_or_silent() {
    let mut state = state();
    state.heard[2] = None;
    state.turning = 0b01;
    let all = [0, 1, 2].map(|source| state.sensor(source));
    assert_eq!(all, [SensorState::Ok, SensorState::Stalled, SensorState::Never]);
    assert_eq!(state.silent().collect::<Vec<_>>(), [2]);
}

/// Heads are up to half a metre before or behind the origin. Coverage counts as long as a head can be inside
/// the tunnel.
#[test]
fn condition_is_outside_the_tunnel_only_if_no_head_can_be_inside() {
    let at = |x_m: f64| LiveState { chainage_m: Some(x_m), length_m: 100.0, heads_reach_m: 0.5, ..state() };
    let shown = [-0.6, -0.4, 50.0, 100.4, 100.6].map(|x_m| at(x_m).condition());
    let [before, inside @ .., beyond] = shown;
    assert_eq!([before, beyond], [Condition::Outside(0.0), Condition::Outside(100.0)]);
    assert_eq!(inside, [Condition::Good; 3]);
    assert_eq!((beyond.as_str(), beyond.lamp()), ("outside", Lamp::Amber));
    // A doubtful position takes precedence over being outside the tunnel.
    let unsure = LiveState { position: PositionState::Doubtful(PositionDoubt::Cable), ..at(100.6) };
    assert_eq!(unsure.condition(), Condition::CannotSay(PositionDoubt::Cable));
}
