use super::*;
use crate::frontier::Reach;
use crate::missing_samples::MissingSamples;
use crate::passage::OtherSettings;
use crate::store::{StoreLayout, WallSample};

const PERIMETER_M: f64 = 18.0;
const TARGET_M: f64 = 0.5;
const BOUNDS_M: (f64, f64) = (10.0, 10.25);

/// Driving figures for four heads in the mode FAST with 8 s per turn, at 0.19 m/s, for a target of 0.5 m.
fn sound() -> Drive {
    Drive {
        speed_mps: 0.19,
        planned_mps: 0.19,
        gap_s: 2.0,
        even_gap_s: 2.0,
        healthy_gap_s: 2.0,
        planned_gap_s: 2.0,
        all_gap_s: 2.0,
        gap_at_plan_s: 2.0,
        healthy_at_plan_s: 2.0,
        left_at_plan_s: 2.0,
        ping_period_s: 0.02,
        t_y_m: 0.19,
        middle_t_y_m: 0.19,
        ..Drive::default()
    }
}

/// A wall with a lattice of samples except in some places, and the facts known about the drive past it.
struct Wall {
    along_m: f64,
    around_m: f64,
    drive: Drive,
    /// A place without samples: its ends along and around the tunnel, m.
    bare: Option<[[f64; 2]; 2]>,
    /// Causes of the missing samples; empty if unknown.
    why: Causes,
    end_m: f64,
    beside: [Causes; 2],
    is_torn: bool,
    is_dark: bool,
    adrift: bool,
}

impl Default for Wall {
    fn default() -> Self {
        Self {
            along_m: 0.38,
            around_m: 0.18,
            drive: sound(),
            bare: None,
            why: Causes::default(),
            end_m: 14.0,
            beside: [Causes::default(); 2],
            is_torn: false,
            is_dark: false,
            adrift: false,
        }
    }
}

/// A place in the section without samples, because one turn of pings has missed it.
const BARE: Option<[[f64; 2]; 2]> = Some([[9.7, 10.5], [3.0, 4.5]]);

fn named(wall: &Wall) -> Vec<Cause> {
    explained(wall).causes.iter().collect()
}

fn explained(wall: &Wall) -> Evidence {
    let layout =
        StoreLayout { perimeter_m: PERIMETER_M, from_m: 0.0, to_m: 20.0, cell_m: 0.25, capacity: 40_000 };
    let (mut store, mut missing_samples) = (SampleStore::new(layout), MissingSamples::default());
    let count = |length_m: f64, step_m: f64| math::floor_to_i64(length_m / step_m + 1e-9);
    // The section's centre lies midway between two passes.
    let rows = count(4.0, wall.along_m);
    let x_m = |i: i64| 10.125 + (i as f64 + 0.5) * wall.along_m;
    for i in (-rows..=rows).filter(|i| x_m(*i) < wall.end_m) {
        for k in 0..count(PERIMETER_M, wall.around_m) {
            let (x_m, arc_m) = (x_m(i), k as f64 * wall.around_m);
            let is_bare = wall.bare.is_some_and(|[along, around]| {
                (along[0]..along[1]).contains(&x_m) && (around[0]..around[1]).contains(&arc_m)
            });
            if !is_bare {
                store.insert(WallSample { x_m, arc_m, head: 0, step_m: None, visit: 0 }).unwrap();
            } else if !wall.why.is_empty() {
                missing_samples.add(MissingSample { x_m, arc_m, head: 0, why: wall.why, may_be_wall: false });
            }
        }
    }
    let mut finder = HoleFinder::default();
    let hole = finder.largest(&store, BOUNDS_M.0, BOUNDS_M.1);
    assert!(hole.diameter_m > TARGET_M, "the section has to fail: {hole:?}");
    let case = Case {
        hole: &hole,
        bounds_m: BOUNDS_M,
        first_visit: 0,
        swept_by_all: Some(Reach { from_m: 6.0, to_m: wall.end_m }),
        to_come: None,
        none_alive: false,
        is_dark: wall.is_dark,
        is_torn: wall.is_torn,
        target_m: TARGET_M,
        beside: wall.beside,
        missing_samples: &missing_samples,
    };
    let Wall { drive, adrift, .. } = *wall;
    let passage = Passage { pings: 1000, placed: 1000, drive, adrift, ..Passage::default() };
    let evidence = explain(&case, core::iter::once(&passage), &store, &mut finder);
    assert_eq!(evidence.causes.iter().next(), Some(evidence.cause));
    evidence
}

#[test]
fn fail_with_a_single_cause_names_that_cause() {
    for (cause, wall) in [
        (
            Cause::TooFast,
            Wall { along_m: 0.7, drive: Drive { speed_mps: 0.35, ..sound() }, ..Wall::default() },
        ),
        (
            Cause::AngularStep,
            Wall {
                along_m: 0.1,
                around_m: 0.6,
                drive: Drive { speed_mps: 0.05, t_y_m: 0.6, middle_t_y_m: 0.6, ..sound() },
                ..Wall::default()
            },
        ),
        (Cause::OffAxis, Wall { around_m: 0.6, drive: Drive { t_y_m: 0.6, ..sound() }, ..Wall::default() }),
        (Cause::OffAxis, Wall { along_m: 0.78, drive: Drive { swing_m: 0.4, ..sound() }, ..Wall::default() }),
        (
            Cause::Phase,
            Wall { along_m: 0.76, drive: Drive { healthy_gap_s: 4.0, ..sound() }, ..Wall::default() },
        ),
        (Cause::NotPassed, Wall { end_m: 10.1, ..Wall::default() }),
        (Cause::PositionLost, Wall { bare: BARE, is_torn: true, ..Wall::default() }),
        (Cause::PositionLost, Wall { bare: BARE, adrift: true, ..Wall::default() }),
        (Cause::Unknown, Wall { bare: BARE, ..Wall::default() }),
    ] {
        assert_eq!(named(&wall), [cause], "{:?}", wall.drive);
    }
    for cause in [
        Cause::MissingReturns,
        Cause::OutOfRange,
        Cause::Occluded,
        Cause::HeadSilent,
        Cause::HeadStalled,
        Cause::PositionLost,
    ] {
        assert_eq!(named(&Wall { bare: BARE, why: Causes::of(cause), ..Wall::default() }), [cause]);
    }
}

#[test]
fn both_causes_are_named_only_if_both_are_needed() {
    let fast = Wall { along_m: 0.7, drive: Drive { speed_mps: 0.35, ..sound() }, ..Wall::default() };
    let wide = Some([[8.6, 11.7], [3.0, 5.5]]);
    let why = Causes::of(Cause::MissingReturns);
    assert_eq!(named(&Wall { bare: wide, why, ..fast }), [Cause::TooFast, Cause::MissingReturns]);
    // Scattered losses enlarge the hole, but the section would fail even without them.
    let here = Some([[10.4, 10.5], [3.0, 3.1]]);
    let fast = Wall { along_m: 0.7, drive: Drive { speed_mps: 0.35, ..sound() }, ..Wall::default() };
    assert_eq!(named(&Wall { bare: here, why, ..fast }), [Cause::TooFast]);
    // A sample that is missing for two reasons is put back only if both are removed.
    let both = Causes::of(Cause::PositionLost).with(Cause::OutOfRange);
    assert_eq!(
        named(&Wall { bare: BARE, why: both, ..Wall::default() }),
        [Cause::OutOfRange, Cause::PositionLost]
    );
}

/// The heads are slightly out of phase, which enlarges the hole.
///
/// Without the speed and the missing returns, the section would pass in spite of the phase.
#[test]
fn two_causes_are_named_if_removing_two_of_three_factors_suffices() {
    let wide = Some([[8.6, 11.7], [3.0, 5.5]]);
    let drive = Drive { speed_mps: 0.35, gap_s: 2.4, healthy_gap_s: 2.4, ..sound() };
    let wall =
        Wall { along_m: 0.7, drive, bare: wide, why: Causes::of(Cause::MissingReturns), ..Wall::default() };
    assert_eq!(named(&wall), [Cause::TooFast, Cause::MissingReturns]);
}

/// With a longer range or a finer step, a turn takes longer, so the passes are farther apart.
///
/// If the section would fail with the other setting too, the present setting is not the cause.
#[test]
fn head_setting_is_a_cause_only_if_another_setting_meets_the_target() {
    let other = |turn: f64| OtherSettings { finer_step: 0.5, finer_turn: turn, longer_turn: turn };
    let drive = |turn: f64| Drive { other: other(turn), ..sound() };
    let far = |turn: f64| Wall {
        bare: BARE,
        why: Causes::of(Cause::OutOfRange),
        drive: drive(turn),
        ..Wall::default()
    };
    assert_eq!(named(&far(1.1)), [Cause::OutOfRange]);
    assert_eq!(named(&far(2.2)), [Cause::Unknown]);
    let coarse = |turn: f64| {
        let drive = Drive { t_y_m: 0.6, middle_t_y_m: 0.6, ..drive(turn) };
        Wall { along_m: 0.38, around_m: 0.6, drive, ..Wall::default() }
    };
    assert_eq!(named(&coarse(1.0)), [Cause::AngularStep]);
    assert_eq!(named(&coarse(3.0)), [Cause::Unknown]);
}

/// A stalled head leaves the passes too far apart, even if the vehicle moves straight.
#[test]
fn stalled_head_and_swing_are_both_named_as_causes() {
    let why = Causes::of(Cause::HeadStalled);
    let drive = Drive { swing_m: 0.4, gap_s: 4.0, gap_at_plan_s: 4.0, ..sound() };
    let wall = Wall { along_m: 0.78, bare: Some([[9.0, 11.3], [3.0, 6.0]]), why, drive, ..Wall::default() };
    assert_eq!(named(&wall), [Cause::OffAxis, Cause::HeadStalled]);
}

/// If no head pinged, nothing shows that speed was a cause, so it is not named.
#[test]
fn silent_heads_are_the_only_named_cause_if_no_head_pinged() {
    let fast = || Wall { along_m: 0.7, drive: Drive { speed_mps: 0.35, ..sound() }, ..Wall::default() };
    assert_eq!(named(&Wall { is_dark: true, ..fast() }), [Cause::HeadSilent]);
    assert_eq!(named(&fast()), [Cause::TooFast]);
}

/// The passage knows no silent head, because the silence was short.
#[test]
fn head_that_was_silent_for_a_moment_is_named() {
    let heads = |cause: Cause| {
        explained(&Wall { bare: BARE, why: Causes::of(cause), ..Wall::default() }).silent_heads
    };
    assert_eq!(heads(Cause::HeadSilent), HeadSet::first(1));
    assert_eq!(heads(Cause::HeadStalled), HeadSet::default());
}

#[test]
fn cause_of_the_neighbouring_section_is_preferred_if_sufficient() {
    let wall = |beside: Cause| Wall {
        along_m: 0.7,
        drive: Drive { speed_mps: 0.26, planned_mps: 0.1, planned_gap_s: 2.6, healthy_gap_s: 2.6, ..sound() },
        beside: [Causes::default(), Causes::of(beside)],
        ..Wall::default()
    };
    assert_eq!(named(&wall(Cause::TooFast)), [Cause::TooFast]);
    // Only factors that were present in the section are preferred.
    assert_eq!(named(&wall(Cause::Occluded)), [Cause::TooFast]);
}

#[test]
fn cause_has_the_same_word_in_text_and_json() {
    for cause in Cause::ALL {
        assert_eq!(serde_json::to_value(cause).unwrap(), cause.as_str());
    }
}

/// The largest speed that meets the target leaves time for a single pass. With losses, the vehicle drives the same
/// distance in the time of all needed passes and one ping.
#[test]
fn speed_with_lost_returns_leaves_time_for_all_needed_passes() {
    let drive = Drive { fits_mps: 0.19, fits_along_m: 0.4, ..sound() };
    assert!((drive.with_losses_mps(1.0) - 0.19).abs() < 1e-12);
    // The vehicle drives 0.4 m in the time of 1.5 passes of 2 s each and one ping.
    assert!((drive.with_losses_mps(1.5) - 0.4 / 3.02).abs() < 1e-12);
    assert!((drive.with_losses_mps(1.01) - 0.19).abs() < 1e-12, "not faster than without losses");
}

/// Checks the expected time between passes for each set of removed causes.
///
/// The figures in `drive` differ, so that each shows which one was used: as driven, as scheduled, without stalls, or at
/// the planned speed.
#[test]
fn expected_time_between_passes_depends_on_the_removed_causes() {
    let drive = Drive {
        healthy_gap_s: 4.0,
        planned_gap_s: 3.0,
        all_gap_s: 2.0,
        gap_at_plan_s: 6.0,
        healthy_at_plan_s: 3.5,
        left_at_plan_s: 2.5,
        ping_period_s: 0.02,
        swing_m: 0.3,
        t_y_m: 0.24,
        middle_t_y_m: 0.2,
        other: OtherSettings { finer_step: 0.5, finer_turn: 1.5, longer_turn: 2.0 },
        ..sound()
    };
    let without = |causes: &[Cause], all_turn: bool| {
        let removed = causes.iter().fold(Causes::default(), |all, cause| all.with(*cause));
        drive.without(removed, 0.5, all_turn)
    };
    let near = |found: f64, expected: f64| (found - expected).abs() < 1e-9;
    let (phase, fast) = (Cause::Phase, Cause::TooFast);
    for (causes, all_turn, gap_s) in [
        (&[][..], true, 4.0),
        (&[][..], false, 4.0),
        (&[phase], true, 3.0),
        (&[phase], false, 2.5),
        (&[fast], true, 3.5),
        (&[fast], false, 6.0),
        (&[phase, fast], true, 2.0),
        (&[phase, fast], false, 2.5),
    ] {
        let then = without(causes, all_turn);
        assert!(near(then.healthy_gap_s, gap_s), "{causes:?} {all_turn}: {}", then.healthy_gap_s);
    }
    // A longer range doubles the time between passes, and a finer mode multiplies it by 1.5. Both scale all times that
    // depend on the turn period.
    for (causes, slower, finer) in [
        (&[Cause::OutOfRange][..], 2.0, 1.0),
        (&[Cause::AngularStep], 1.5, 0.5),
        (&[Cause::OutOfRange, Cause::AngularStep], 3.0, 0.5),
    ] {
        let then = without(causes, true);
        let found = [then.healthy_gap_s, then.ping_period_s, then.t_y_m, then.middle_t_y_m, then.swing_m];
        let expected = [4.0 * slower, 0.02 * slower, 0.24 * finer, 0.2 * finer, 0.3];
        assert!(found.iter().zip(expected).all(|(a, b)| near(*a, b)), "{causes:?}: {found:?}");
    }
    let straight = without(&[Cause::OffAxis], true);
    assert!(near(straight.swing_m, 0.0) && near(straight.t_y_m, 0.2) && near(straight.healthy_gap_s, 4.0));
}

/// For a target of 0.5 m and steps of 0.3 m around the perimeter, passes may be 0.4 m apart along the tunnel.
#[test]
fn removing_the_speed_cause_lowers_the_speed_until_the_target_is_met() {
    let drive = Drive { speed_mps: 0.4, t_y_m: 0.3, middle_t_y_m: 0.3, ..sound() };
    let slowed_mps = |drive: Drive| drive.without(Causes::of(Cause::TooFast), 0.5, true).speed_mps;
    // The vehicle drives 0.4 m in the time of one pass, 2 s, and one ping.
    assert!((slowed_mps(drive) - 0.4 / 2.02).abs() < 1e-9, "{}", slowed_mps(drive));
    assert!(
        (slowed_mps(Drive { fits_mps: 0.1, ..drive }) - 0.1).abs() < 1e-9,
        "hidden wall needs a lower speed"
    );
    assert!((slowed_mps(Drive { fits_mps: 0.35, ..drive }) - 0.4 / 2.02).abs() < 1e-9);
    assert!(
        (slowed_mps(Drive { speed_mps: 0.15, ..drive }) - 0.15).abs() < 1e-9,
        "the vehicle wasn't too fast"
    );
    // If steps exceed the target, passes may still be three tenths of the target apart.
    let coarse = Drive { t_y_m: 0.6, middle_t_y_m: 0.6, ..drive };
    assert!((slowed_mps(coarse) - 0.15 / 2.02).abs() < 1e-9, "{}", slowed_mps(coarse));
}

/// Passes 4 s apart at 0.1 m/s have the same distance along the tunnel as passes 2 s apart at 0.2 m/s, the planned
/// speed.
///
/// The planned speed helps only if it reduces this distance below the share `HELPS` of the actual one.
#[test]
fn removing_the_phase_cause_sets_the_planned_speed_only_if_passes_come_closer_together() {
    let then = |planned_gap_s: f64| {
        let drive = Drive {
            speed_mps: 0.1,
            planned_mps: 0.2,
            fits_mps: 0.2,
            planned_gap_s,
            healthy_gap_s: 5.0,
            all_gap_s: 2.0,
            ..sound()
        };
        let then = drive.without(Causes::of(Cause::Phase), 0.5, true);
        (then.speed_mps, then.healthy_gap_s)
    };
    let near = |found: (f64, f64), speed_mps: f64, gap_s: f64| {
        (found.0 - speed_mps).abs() < 1e-12 && (found.1 - gap_s).abs() < 1e-12
    };
    assert!(near(then(4.4), 0.2, 2.0) && near(then(4.2), 0.1, 4.2) && near(then(3.9), 0.1, 3.9));
}
