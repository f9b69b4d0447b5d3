use super::*;
use crate::alert_list::{AdviceUpdate, AlertList, AlertOutputs, Figures, Occurrences};
use crate::fixtures::armed;
use crate::head_descriptions::tests::two;
use crate::live_state::{ActiveObservation, PositionState, test_state};
use crate::observations::ObservedKind;
use crate::result_stream::ResultStream;
use crate::unsure_stretch::UnsureStretch;
use headrace_coverage::{Driven, Unsure};
use headrace_fusion::NoFix;
use headrace_geometry::time::MonoNs;
use headrace_geometry::tunnel::shapes;
use headrace_vehicle::{AlertTiming, LimitsConfig};

fn status(state: &LiveState) -> PilotLine {
    let profile = shapes::circle(3.0).unwrap();
    status_line(state, &profile, &two(), &|source| ["sonar_0", "sonar_1", "tether"][source].to_owned())
}

/// Live states that together show every part of the status line.
fn states() -> Vec<LiveState> {
    let good = test_state();
    let speed = |mps: f64| {
        let mut state = good;
        state.speed_mps = Some(mps);
        state
    };
    let mut one_silent = good;
    one_silent.heard[1] = Some(MonoNs(0));
    let mut mute = one_silent;
    mute.heard[0] = None;
    vec![
        good,
        speed(0.073),
        LiveState { metres: Metres { fail_m: 7.25, ..good.metres }, ..speed(0.11) },
        one_silent,
        mute,
        LiveState { position: PositionState::Doubtful(PositionDoubt::Cable), ..good },
        LiveState { position: PositionState::Doubtful(PositionDoubt::Spread), pass_sd_m: 0.15, ..good },
        LiveState {
            position: PositionState::Doubtful(PositionDoubt::Spread),
            pass_sd_m: 0.15,
            stand_s: 24,
            ..good
        },
        LiveState {
            position: PositionState::None(NoFix::Section),
            chainage_m: None,
            speed_mps: None,
            ..good
        },
        LiveState { now: MonoNs(42_000_000_000), ..good },
        LiveState { now: MonoNs(400_000_000_000), ..good },
        LiveState { at: None, chainage_m: None, heard: [None; 64], ..good },
    ]
}

#[test]
fn status_line_cut_to_60_columns_keeps_problem_and_action() {
    let lines = |columns: usize| states().iter().map(|state| status(state).cut(columns)).collect::<Vec<_>>();
    let narrow = lines(60);
    assert!(narrow.iter().all(|line| line.chars().count() <= 60));
    for (line, state) in narrow.iter().zip(states()) {
        let whole = status(&state);
        let problem = whole.what[0].split(": ").next().unwrap();
        assert!(line.contains(problem) && line.ends_with(&whole.action), "{line}");
    }
    insta::assert_snapshot!(narrow.join("\n"));
    insta::assert_snapshot!(lines(200).join("\n"));
}

fn stretch(why: Unsure) -> UnsureStretch {
    UnsureStretch {
        why,
        from_m: 1240.5,
        to_m: 1246.25,
        metres_m: 5.75,
        hole_m: 0.486,
        hole_sd_m: 0.04,
        hole_error_m: 0.08,
        driven: Driven::default(),
        is_mostly_error: false,
    }
}

/// A lower speed isn't always better: below their planned speed, heads run out of phase.
#[test]
fn remedy_for_an_unsure_stretch_depends_on_speed_and_phase() {
    let helps = |speed_mps: f64, fits_mps: f64, is_uneven: bool| {
        let driven = Driven { speed_mps, fits_mps, is_uneven, is_short: false };
        helps_text(&UnsureStretch { driven, ..stretch(Unsure::Position) })
    };
    let surer = "pass it again with a more certain position";
    assert_eq!(helps(0.2, 0.1, false), format!("at most 0.10 m/s, or {surer}"));
    assert_eq!(helps(0.2, 0.1, true), format!("at most 0.10 m/s, or {surer}"));
    assert_eq!(helps(0.09, 0.1, true), format!("at 0.10 m/s, or {surer}"));
    assert_eq!(helps(0.09, 0.1, false), surer, "faster won't help");
    assert_eq!(helps(0.1, 0.1, true), surer, "driven as advised");
    assert_eq!(helps(0.1, 0.0, true), surer, "no speed is known");
    assert_eq!(helps(0.0, 0.1, true), surer, "never driven");
    let driven = Driven { speed_mps: 0.2, fits_mps: 0.1, is_uneven: false, is_short: false };
    let lost = UnsureStretch { is_mostly_error: true, driven, ..stretch(Unsure::Position) };
    assert_eq!(helps_text(&lost), surer, "the error matters more");
    let short = Driven { is_short: true, ..driven };
    let silent = UnsureStretch { driven: short, ..stretch(Unsure::Position) };
    assert_eq!(
        helps_text(&silent),
        "pass it again slower, or with the silent head restored",
        "the speeds apply to all heads"
    );
}

#[test]
fn unsure_stretch_is_shown_with_reason_and_remedy() {
    let profile = shapes::circle(3.0).unwrap();
    let mut text = String::new();
    for why in Unsure::ALL {
        let message = if why == Unsure::NotInspected {
            LiveMessage::NotInspected(stretch(why))
        } else {
            LiveMessage::CannotSay(stretch(why))
        };
        let lines = message_line(&message, &profile, &two()).broken(60);
        assert!(lines.iter().all(|line| line.chars().count() <= 60), "{lines:#?}");
        text.push_str(&lines.join("\n"));
        text.push('\n');
    }
    insta::assert_snapshot!(text);
}

/// Alert for an observation, as raised at the first advice update.
fn raised(kind: ObservedKind) -> ListedAlertJson {
    let mut state = test_state();
    let occurrences = Occurrences { count: 3, first_m: 12.5, worst_m: 0.4 };
    state.observations[0] = Some(ActiveObservation { kind, source: None, occurrences });
    let mut list = AlertList::new(AlertTiming::default(), LimitsConfig::default(), 0);
    let mut to = AlertOutputs { notices: &mut Vec::new(), stream: &mut ResultStream::default() };
    list.update(
        &AdviceUpdate { at: MonoNs(1), state: &state, setting: None, unverified_mounts: false },
        &mut to,
    );
    let alert = list.iter().find(|alert| matches!(alert.figures, Figures::Deviation(_))).unwrap();
    alert.json(&armed().view().surroundings(), MonoNs(1))
}

#[test]
fn observation_has_a_line_when_its_alert_is_raised() {
    let alert = raised(ObservedKind::OutsideTunnel);
    let found = (alert.occurrences, alert.first_m, alert.worst_m, alert.setting.as_ref());
    assert_eq!(found, (Some(3), Some(12.5), Some(0.4), None));
    let number = alert.number;
    let message = |change: AlertChange| LiveMessage::AlertChange { change, alert: Box::new(alert.clone()) };
    assert!(message(AlertChange::Raised).adds_line() && !message(AlertChange::Rectified).adds_line());
    let line = message_line(&message(AlertChange::Raised), &shapes::circle(3.0).unwrap(), &two());
    let text = "raised: 0+012.50: samples 0.40 m outside the tunnel: check the tether's zero";
    assert_eq!((line.place, line.what), (format!("ALERT {number}"), vec![text.to_owned()]));
}

#[test]
fn pilot_line_breaks_between_words_and_before_the_action() {
    let line = PilotLine {
        place: "0+014.25".to_owned(),
        speed: String::new(),
        what: vec!["MISSED: too fast (0.32 m/s), holes over 0.5 m at 8:00".to_owned()],
        action: "inspect again from 0+014.25, at most 0.09 m/s".to_owned(),
        lamp: None,
    };
    insta::assert_snapshot!(line.broken(60).join("\n"), @r"
    0+014.25   MISSED: too fast (0.32 m/s), holes over 0.5 m at
               8:00
               -> inspect again from 0+014.25, at most 0.09 m/s
    ");
    assert_eq!(line.broken(200), [line.text()]);
    let widths = |columns: usize| line.broken(columns).iter().map(|l| l.chars().count()).max().unwrap();
    assert!((40..130).all(|columns| widths(columns) <= columns));
    let words = |text: &str| text.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(words(&line.broken(40).join(" ")), words(&line.text()), "no word is lost");
}

#[test]
fn narrow_screen_keeps_the_action_and_drops_the_reason() {
    let line = PilotLine {
        place: "0+039.06".to_owned(),
        speed: "0.09 m/s".to_owned(),
        what: vec![
            "THIS TURN MAY MISS: heads 55 degrees out of phase".to_owned(),
            "missed 1.00 m".to_owned(),
        ],
        action: "go 0.10 m/s".to_owned(),
        lamp: None,
    };
    assert!(line.cut(200).contains("missed 1.00 m  -> go 0.10 m/s"));
    assert_eq!(line.cut(60), "0+039.06   THIS TURN MAY MISS  -> go 0.10 m/s");
    let remedy = PilotLine { action: String::new(), ..line };
    assert!(remedy.cut(40).contains("THIS TURN MAY MISS: heads"), "without an action, the reason stays");
}
