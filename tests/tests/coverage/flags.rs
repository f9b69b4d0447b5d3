//! Checks the flags of two hundred short dives against their definition.
//!
//! A flag is raised when driving on can no longer undo a fail, and cleared when a later pass fills the hole. The
//! independent computation of flags knows the poses and all samples, but not the order in which the loop judges
//! sections.

use headrace_coverage::Verdict;
use std::sync::LazyLock;

use headrace_geometry::math;
use headrace_geometry::time::MonoNs;
use headrace_tests::flags::{EVERY, Flag, Journey, wall_until};
use headrace_tests::instrumented::Dive;
use headrace_tests::random_dives::{Kind, Seeded};

use crate::dives::DIVES;

/// A dive and its due flags by two definitions of a fail. By the first definition, the hole exceeds the target. By the
/// second definition, the hole exceeds the target by two standard deviations.
struct Judged {
    seeded: &'static Seeded,
    dive: &'static Dive,
    journey: Journey,
    at_target: Vec<Flag>,
    by_two_sigma: Vec<Flag>,
}

static JUDGED: LazyLock<Vec<Judged>> = LazyLock::new(|| {
    let judge = |(seeded, dive): &'static (Seeded, Dive)| {
        let journey = Journey::of(dive);
        let [at_target, by_two_sigma] = [0.0, 2.0].map(|sd| journey.flags(dive, sd));
        Judged { seeded, dive, journey, at_target, by_two_sigma }
    };
    DIVES.iter().map(judge).collect()
});

/// Calls `wrong` for every section, with the section's flag by both definitions of a fail (see [`Judged`]). `wrong`
/// returns what is wrong, if anything.
#[track_caller]
fn every_flag(
    dives: impl Fn(&Judged) -> bool,
    wrong: impl Fn(&Judged, &Flag, &Flag) -> Option<&'static str>,
) {
    let (mut said, mut raised) = (Vec::new(), 0);
    for judged in JUDGED.iter().filter(|judged| dives(judged)) {
        for (at_target, by_two_sigma) in judged.at_target.iter().zip(&judged.by_two_sigma) {
            raised += u32::from(at_target.raised_s.is_some());
            let Seeded { seed, kind, .. } = *judged.seeded;
            let wrong = wrong(judged, at_target, by_two_sigma);
            said.extend(wrong.map(|wrong| format!("seed {seed} ({kind:?}): {wrong}: {by_two_sigma:?}")));
        }
    }
    assert!(raised > 20, "{raised} flags");
    assert!(said.is_empty(), "{} of {raised} flags: {:#?}", said.len(), &said[..said.len().min(8)]);
}

/// A flag that becomes due less than this time before the end of the dive need not be raised, s. The loop waits until
/// the heads have passed the section's end or the vehicle is stationary.
const SOON_S: f64 = 3.0;

/// Whether a flag was raised before its due moment, or raised although none was due.
fn is_early(judged: &Judged, due: &Flag) -> bool {
    due.raised_s
        .is_some_and(|raised_s| due.may_s.is_none_or(|may_s| raised_s < may_s - 1.5 * EVERY.as_secs_f64()))
        && !judged.journey.was_due(judged.dive, due, 0.0)
}

fn forward(judged: &Judged) -> bool {
    judged.seeded.kind != Kind::Reversing
}

fn direct(judged: &Judged) -> bool {
    judged.seeded.vehicle.contains("way = \"direct\"")
}

#[test]
fn every_permanent_fail_is_flagged() {
    every_flag(forward, |_, _, due| {
        let due_s = due.due_s.filter(|due_s| due_s + SOON_S < due.end_s);
        (due_s.is_some() && due.raised_s.is_none()).then_some("never raised")
    });
}

#[test]
fn no_flag_is_raised_while_the_hole_can_still_be_filled() {
    every_flag(forward, |judged, due, _| {
        is_early(judged, due).then_some("raised although driving on could have undone it")
    });
}

#[test]
fn flag_of_a_moving_vehicle_is_raised_within_one_turn() {
    every_flag(
        |judged| forward(judged) && judged.seeded.kind != Kind::Parked,
        |judged, _, due| {
            due.late_s().is_some_and(|late_s| late_s > judged.dive.turn_s).then_some("raised late")
        },
    );
}

/// Longest distance that the heads may move between the due moment and the raising of a flag, m
/// (`docs/why/coverage.md`, "Verdicts").
const LATE_M: f64 = 0.25;
/// Time from the start until the position estimate has converged, seconds: the alignment, and 20 s after it.
const SETTLED_S: f64 = 22.0;

#[test]
fn flag_is_raised_within_25_cm_of_the_point_of_no_return() {
    let (mut late, mut on_time) = (Vec::new(), 0);
    for judged in JUDGED.iter().filter(|judged| forward(judged) && judged.seeded.kind != Kind::Parked) {
        // With a navigation filter, standard deviations differ from place to place. In such dives a flag counts as due
        // only if the hole exceeds the target by three standard deviations.
        let flags =
            if direct(judged) { &judged.by_two_sigma } else { &judged.journey.flags(judged.dive, 3.0) };
        for flag in flags {
            // While the estimate converges, standard deviations shrink, but the report has only the final ones. Flags
            // that are due during this time don't count.
            let settles = !direct(judged) && flag.due_s.is_some_and(|due_s| due_s < SETTLED_S);
            let is_late = flag.late_m.filter(|_| !settles).map(|late_m| late_m > LATE_M);
            on_time += u32::from(is_late == Some(false));
            late.extend(is_late.filter(|is| *is).map(|_| format!("seed {}: {flag:?}", judged.seeded.seed)));
        }
    }
    assert!(on_time > 60 && late.is_empty(), "{on_time} flags on time; late: {late:#?}");
}

#[test]
fn no_flag_is_cleared_without_turning_back() {
    every_flag(forward, |_, due, _| due.cleared_s.map(|_| "cleared"));
}

#[test]
fn every_flagged_section_fails_if_positions_are_exact() {
    every_flag(
        |judged| forward(judged) && direct(judged),
        |_, _, due| {
            let is_flagged = due.raised_s.is_some() && due.cleared_s.is_none();
            (is_flagged && !due.fails).then_some("the flag remains although the section doesn't fail")
        },
    );
}

#[test]
fn flag_is_cleared_only_after_the_hole_is_filled() {
    let reversing = |judged: &Judged| judged.seeded.kind == Kind::Reversing;
    every_flag(reversing, |judged, due, _| {
        let cleared_s = due.cleared_s?;
        let until =
            |at_s: f64| wall_until(judged.dive, MonoNs(math::round_to_i64(at_s * 1e9).unsigned_abs()));
        let hole_m = |at_s: f64| {
            let section =
                judged.dive.report.sections.iter().find(|section| section.start_m >= due.start_m)?;
            Some(2.0 * until(at_s).largest(section.start_m, section.end_m)?.radius_m)
        };
        let target_m = judged.dive.report.target_m;
        let raised_s = due.raised_s?;
        let filled = hole_m(raised_s)? > target_m && hole_m(cleared_s)? <= target_m;
        (!filled || raised_s >= cleared_s).then_some("cleared, not filled")
    });
}

#[test]
fn filled_hole_has_no_flag() {
    let reversing = |judged: &Judged| judged.seeded.kind == Kind::Reversing;
    every_flag(reversing, |judged, due, _| {
        let section = judged.dive.report.sections.iter().find(|section| section.start_m >= due.start_m)?;
        let is_flagged = due.raised_s.is_some() && due.cleared_s.is_none();
        (is_flagged && section.verdict == Verdict::Pass).then_some("passes but keeps its flag")
    });
}

#[test]
fn flags_of_the_way_out_do_not_depend_on_the_way_back() {
    every_flag(
        |judged| judged.seeded.kind == Kind::Reversing && direct(judged),
        |judged, due, _| {
            let raised_s = due.raised_s.filter(|at_s| *at_s < judged.journey.turned_back_s())?;
            let moment_s = due.due_s.filter(|at_s| *at_s <= judged.journey.turned_back_s());
            let late = moment_s.is_none_or(|moment_s| raised_s - moment_s > judged.dive.turn_s);
            (late || is_early(judged, due)).then_some("raised at another time")
        },
    );
}

#[test]
fn end_of_a_dive_raises_no_flag() {
    every_flag(forward, |_, due, _| due.raised_at_the_end().then_some("raised by the end"));
}

#[test]
fn no_flag_is_raised_while_the_fail_can_still_be_undone() {
    // Dives with a navigation filter are left out, because their standard deviations still change after a flag is
    // raised.
    every_flag(
        |judged| forward(judged) && direct(judged),
        |judged, _, due| is_early(judged, due).then_some("raised although driving on could have undone it"),
    );
}

#[test]
fn flag_of_a_stationary_or_returning_vehicle_is_raised_within_one_turn() {
    every_flag(
        |judged| direct(judged) && matches!(judged.seeded.kind, Kind::Parked | Kind::Reversing),
        |judged, _, due| {
            // If the vehicle turns back at the moment when the flag is due, a later pass may still undo the fail.
            let due_s = due.due_s.filter(|due_s| {
                let back_s = judged.journey.turned_back_s();
                !(back_s - 3.0..judged.journey.turned_on_s()).contains(due_s)
            })?;
            let late_s = due.raised_s.map_or(f64::INFINITY, |raised_s| raised_s - due_s);
            (late_s > judged.dive.turn_s).then_some("raised late, or never")
        },
    );
}
