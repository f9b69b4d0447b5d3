use super::*;
use headrace_sampling::head::HeadSet;

/// Four heads at FAST, 8 s per turn, nominal at 0.19 m/s for a target of 0.5 m.
fn sound() -> Passage {
    let pings = 1000;
    let sum = |mean: f64| mean * f64::from(pings);
    Passage {
        pings,
        placed: pings,
        speed_sum_mps: sum(0.19),
        pass_gap_sum_s: sum(2.0),
        even_gap_sum_s: sum(2.0),
        all_gap_sum_s: sum(2.0),
        ping_period_sum_s: sum(0.02),
        t_y_m: 0.19,
        middle_t_y_m: 0.19,
        ..Passage::default()
    }
}

fn cause_of(passage: &Passage, diameter_m: f64) -> Cause {
    let hole =
        Hole { diameter_m, least_m: diameter_m, most_m: diameter_m, x_m: 10.1, arc_m: 3.0, bounded: true };
    let swept_by_all = Some(Reach { from_m: 0.0, to_m: 20.0 });
    let case = Case {
        hole: &hole,
        swept_by_all,
        none_alive: false,
        target_m: 0.5,
        confidence_sd: 2.0,
        perimeter_m: 18.0,
    };
    explain(&case, &core::iter::once(((10.0, 10.25), passage))).cause
}

#[test]
fn a_report_has_the_same_word_for_a_cause_wherever_it_stands() {
    for cause in Cause::ALL {
        assert_eq!(serde_json::to_value(cause).unwrap(), cause.as_str());
    }
}

#[test]
fn each_cause_alone_is_named() {
    let pings = 1000.0;
    let with = |change: &dyn Fn(&mut Passage)| {
        let mut passage = sound();
        change(&mut passage);
        passage
    };
    let lost = |loss: Loss| with(&|passage| passage.lost.note(loss, 3.1, 18.0));
    for (cause, passage, diameter_m) in [
        (Cause::TooFast, with(&|p| p.speed_sum_mps = 0.35 * pings), 0.7),
        (Cause::AngularStep, with(&|p| (p.t_y_m, p.middle_t_y_m) = (0.6, 0.6)), 0.7),
        (Cause::OffAxis, with(&|p| p.t_y_m = 0.6), 0.7),
        (Cause::OffAxis, with(&|p| p.swing_sum_m = 0.4 * pings), 0.7),
        (Cause::Phase, with(&|p| p.pass_gap_sum_s = 4.0 * pings), 0.7),
        (Cause::MissingReturns, lost(Loss::Missing), 0.7),
        (Cause::OutOfRange, lost(Loss::OutOfRange), 0.7),
        (Cause::Occluded, lost(Loss::Occluded), 0.7),
        (Cause::PositionLost, with(&|p| p.unseen = true), 2.0),
        (Cause::PositionLost, with(&|p| p.unplaced = 500), 2.0),
        // Driving is nominal and nothing was lost: navigation has jumped.
        (Cause::PositionLost, sound(), 2.0),
        (Cause::NotPassed, Passage::default(), 2.0),
        (Cause::HeadSilent, Passage { silent: HeadSet::first(4), ..Passage::default() }, 2.0),
    ] {
        assert_eq!(cause_of(&passage, diameter_m), cause, "{passage:?}");
    }
}

#[test]
fn a_head_that_stands_is_told_from_one_that_is_silent() {
    let mut one_of_four = sound();
    // Three are left: their passes leave a double gap, evenly spread they wouldn't.
    one_of_four.pass_gap_sum_s = 4.0 * 1000.0;
    one_of_four.even_gap_sum_s = 8.0 / 3.0 * 1000.0;
    assert_eq!(cause_of(&one_of_four, 0.7), Cause::MissingReturns);
    one_of_four.silent = HeadSet::default().with(2);
    assert_eq!(cause_of(&one_of_four, 0.7), Cause::HeadSilent);
    one_of_four.standing = 250;
    assert_eq!(cause_of(&one_of_four, 0.7), Cause::HeadStalled);
}

#[test]
fn a_stretch_where_no_head_pinged_is_dark_whatever_is_beside_it() {
    let silent = HeadSet::default().with(0).with(3);
    let dark = Passage { silent, ..Passage::default() };
    let mut beside = sound();
    beside.speed_sum_mps = 0.35 * 1000.0;
    beside.lost.note(Loss::Missing, 3.1, 18.0);
    let hole = Hole { diameter_m: 0.7, least_m: 0.7, most_m: 0.7, x_m: 10.3, arc_m: 3.0, bounded: true };
    let swept_by_all = Some(Reach { from_m: 0.0, to_m: 20.0 });
    let case = Case {
        hole: &hole,
        swept_by_all,
        none_alive: false,
        target_m: 0.5,
        confidence_sd: 2.0,
        perimeter_m: 18.0,
    };
    let sections = [((10.0, 10.25), &beside), ((10.25, 10.5), &dark)].into_iter();
    let evidence = explain(&case, &sections);
    assert_eq!((evidence.cause, evidence.silent_heads), (Cause::HeadSilent, silent));
    assert_eq!(serde_json::to_value(evidence).unwrap()["silent_heads"], serde_json::json!([0, 3]));
    // Beside it a head that was silent for a moment only is no cause of speed.
    assert_eq!(cause_of(&Passage { silent, ..beside }, 0.7), Cause::TooFast);
}

#[test]
fn what_was_lost_elsewhere_is_no_cause() {
    let mut passage = sound();
    passage.lost.note(Loss::Missing, 12.0, 18.0);
    passage.speed_sum_mps = 0.3 * 1000.0;
    assert_eq!(cause_of(&passage, 0.65), Cause::TooFast);
}

#[test]
fn what_was_lost_on_a_stretch_driven_too_fast_has_only_made_it_worse() {
    let mut passage = sound();
    passage.speed_sum_mps = 0.35 * 1000.0;
    passage.lost.note(Loss::Occluded, 3.1, 18.0);
    assert_eq!(cause_of(&passage, 1.8), Cause::TooFast);
    passage.speed_sum_mps = 0.22 * 1000.0;
    assert_eq!(cause_of(&passage, 1.8), Cause::Occluded);
}

#[test]
fn of_several_that_are_needed_the_one_that_costs_most_is_named() {
    let mut passage = sound();
    passage.pass_gap_sum_s = 6.0 * 1000.0;
    passage.swing_sum_m = 0.3 * 1000.0;
    assert_eq!(cause_of(&passage, 1.2), Cause::Phase);
    passage.swing_sum_m = 1.5 * 1000.0;
    assert_eq!(cause_of(&passage, 2.2), Cause::OffAxis);
}
