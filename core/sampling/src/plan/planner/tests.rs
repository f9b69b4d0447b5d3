use super::*;
use crate::fixtures;
use crate::head::{Basis, Turn};
use crate::plan::Question;
use headrace_geometry::frames::Vec3;
use headrace_geometry::math;
use headrace_geometry::tunnel::shapes;

const MODES: [(&str, f64, f64); 5] = [
    ("slow", 0.3, 21.6),
    ("medium", 0.6, 10.8),
    ("fast", 0.9, 8.0),
    ("faster", 1.2, 6.6),
    ("fastest", 2.4, 4.8),
];

fn modes() -> Vec<HeadMode> {
    let mode = |(name, step_deg, period_s): (&'static str, f64, f64)| HeadMode {
        name,
        turn: Turn::new(step_deg.to_radians(), period_s).unwrap(),
        basis: Basis::Table,
    };
    MODES.into_iter().map(mode).collect()
}

fn head(position: [f64; 3], aft: bool, radius_m: f64) -> (HeadSpec, Vec<HeadMode>) {
    (fixtures::head(position, aft, radius_m), modes())
}

fn inspection(heads: Vec<(HeadSpec, Vec<HeadMode>)>, layout: HeadLayout) -> Inspection {
    let profile = shapes::ceran().unwrap();
    let place = profile.reference();
    Inspection {
        profile,
        length_m: 7000.0,
        place,
        heads,
        hull: Vec::new(),
        layout,
        drift_m: 0.0,
        yaw_rad: 0.0,
        yaw_rate_radps: 0.0,
        sound_speed_mps: 1500.0,
    }
}

fn ideal(count: usize) -> Inspection {
    inspection(vec![head([0.0; 3], false, 0.0); count], HeadLayout::PhaseShift)
}

/// VITA 2 with four heads: two side by side in front, two side by side aft.
fn vita_2(layout: HeadLayout) -> Inspection {
    let places = [([0.551, 0.15, 0.0], false), ([0.551, -0.15, 0.0], false)];
    let aft = [([-0.551, 0.15, 0.0], true), ([-0.551, -0.15, 0.0], true)];
    let heads = places.into_iter().chain(aft).map(|(place, aft)| head(place, aft, 0.04)).collect();
    inspection(heads, layout)
}

fn speed(target_m: f64) -> Question {
    Question { target_m: Some(target_m), ..Question::default() }
}

#[test]
fn t_max_at_the_largest_speed_equals_the_target() {
    let drifting = Inspection { drift_m: 1.0, yaw_rad: 0.2, ..vita_2(HeadLayout::PhaseShift) };
    let sectors = vita_2(HeadLayout::SectorOffset);
    for inspection in [ideal(1), ideal(2), ideal(4), vita_2(HeadLayout::PhaseShift), drifting, sectors] {
        let planner = Planner::new(inspection).unwrap();
        let mut met = 0;
        for mode in 0..MODES.len() {
            for target_m in [0.1, 0.3, 0.5, 1.0, 3.0] {
                let Ok(v_mps) = planner.v_max_mps(mode, target_m) else { continue };
                let t_m = planner.t_max_m(mode, v_mps).unwrap();
                assert!((t_m - target_m).abs() < 1e-9, "mode {mode}, {target_m}: {t_m}");
                assert!(planner.t_max_m(mode, 1.001 * v_mps).unwrap() > target_m);
                met += 1;
            }
        }
        assert!(met >= 9, "{met}");
    }
}

/// The reference table lists T_max, by Eq. 16 of Jorge et al. 2021.
///
/// The planner assumes the worst start angle of the pings, so its T_max is at most slightly larger than in the table.
#[test]
fn ideal_heads_have_the_t_max_of_the_reference_table() {
    let expected = [
        [4.259, 2.132, 1.069],
        [2.134, 1.074, 0.548],
        [1.589, 0.811, 0.434],
        [1.325, 0.695, 0.404],
        [1.042, 0.639, 0.513],
    ];
    for (column, heads) in [1, 2, 4].into_iter().enumerate() {
        let planner = Planner::new(ideal(heads)).unwrap();
        for (mode, row) in expected.iter().enumerate() {
            let t_m = planner.t_max_m(mode, 0.197).unwrap();
            assert!(
                (-2e-3..0.05).contains(&(t_m / row[column] - 1.0)),
                "{heads} {mode}: {t_m} {}",
                row[column]
            );
        }
    }
}

#[test]
fn occluded_side_walls_get_half_of_the_passes() {
    let planner = Planner::new(vita_2(HeadLayout::PhaseShift)).unwrap();
    let fast = 2;
    let (gap_s, hidden_s) = planner.gaps_s(fast).unwrap();
    assert!((gap_s - 2.0).abs() < 1e-12 && (hidden_s - 4.0).abs() < 1e-12);
    let hidden: Vec<_> =
        planner.nominal_strips().unwrap().as_slice().iter().filter(|strip| strip.seen_by.len() < 4).collect();
    assert_eq!(hidden.len(), 2);
    for strip in hidden {
        assert!(strip.seen_by.len() == 2 && (strip.arc.length_m - 1.7).abs() < 0.1, "{strip:?}");
    }
    // On the side walls, neighbouring samples of a turn are close together. The corners therefore limit the speed, and
    // all heads see them.
    let t_m = planner.t_max_m(fast, 0.1).unwrap();
    assert!((0.41..0.43).contains(&t_m), "{t_m}");
}

#[test]
fn sector_heads_look_outwards_and_leave_floor_and_crown_unseen() {
    let planner = Planner::new(vita_2(HeadLayout::SectorOffset)).unwrap();
    assert!(planner.hidden().iter().all(|ranges| ranges.len() == 1));
    let strips = planner.nominal_strips().unwrap().as_slice();
    let unseen: Vec<_> = strips.iter().filter(|strip| strip.seen_by.is_empty()).collect();
    // In sectors, no head occludes another head's beam. Heads 0.3 m apart leave strips on floor and crown unseen,
    // between their sectors.
    assert_eq!(unseen.len(), 2, "{strips:?}");
    assert!(unseen.iter().all(|strip| (strip.arc.length_m - 0.3).abs() < 0.01));
    let answers = planner.answers(&speed(0.4), None).unwrap();
    let fastest = &answers[4];
    assert_eq!((fastest.reason, fastest.v_max_mps), (Some("angular_step"), None));
    assert!(fastest.refused.as_ref().unwrap().contains("no speed meets a target"));
    let slow = planner.answers(&speed(0.25), None).unwrap();
    assert_eq!(slow[0].reason, Some("unseen_strip"), "{:?}", slow[0].refused);
    assert!(slow[0].refused.as_ref().unwrap().contains("no head sees 0.30 m of the wall"));
}

#[test]
fn plan_gives_the_speed_for_a_target_or_the_target_for_a_time() {
    let planner = Planner::new(ideal(2)).unwrap();
    let answers = planner.answers(&speed(1.0), None).unwrap();
    let best: Vec<_> = answers.iter().filter(|answer| answer.best).map(|answer| answer.mode).collect();
    assert_eq!(best, ["fastest"]);
    let fast = &answers[2];
    assert!((fast.needed_h.unwrap() - 7000.0 / fast.v_max_mps.unwrap() / 3600.0).abs() < 1e-9);
    assert!((fast.spacing.unwrap().t_max_m.unwrap() - 1.0).abs() < 1e-9);
    assert_eq!((fast.meets_target, fast.suffices), (None, None));

    let day = Question { time_s: Some(8.0 * 3600.0), ..Question::default() };
    let answers = planner.answers(&day, Some("fast")).unwrap();
    assert_eq!(answers.len(), 1);
    let spacing = answers[0].spacing.unwrap();
    assert!((answers[0].speed_mps.unwrap() - 7000.0 / 28_800.0).abs() < 1e-12);
    assert!((spacing.hit_twice_m.unwrap() - 2.0 * spacing.hit_once_m.unwrap()).abs() < 1e-12);

    let both = Question { target_m: Some(1.0), ..day };
    let answers = planner.answers(&both, None).unwrap();
    for answer in &answers {
        assert_eq!(answer.meets_target, answer.suffices, "{answer:?}");
    }
    assert!(answers.iter().any(|answer| answer.suffices == Some(true)));
    assert!(answers.iter().any(|answer| answer.suffices == Some(false)));
}

#[test]
fn error_about_an_impossible_plan_names_the_cause() {
    let why = |inspection| Planner::new(inspection).unwrap_err();
    assert_eq!(why(ideal(0)), SamplingError::HeadCount { heads: 0 });
    let one = Inspection { layout: HeadLayout::SectorOffset, ..ideal(1) };
    assert_eq!(why(one), SamplingError::SectorNeedsHeads { heads: 1 });
    assert!(matches!(why(Inspection { drift_m: 9.0, ..ideal(1) }), SamplingError::HeadOutside { .. }));
    let yawed = Inspection { yaw_rad: math::FRAC_PI_2, ..ideal(1) };
    assert!(matches!(why(yawed), SamplingError::BeamAlongTunnel { .. }));
    let none = inspection(vec![(head([0.0; 3], false, 0.0).0, Vec::new())], HeadLayout::PhaseShift);
    assert_eq!(why(none), SamplingError::NoCommonMode);
    for (length_m, drift_m) in [(7000.0, -1.0), (7000.0, f64::NAN), (0.0, 0.0), (f64::INFINITY, 0.0)] {
        let error = why(Inspection { length_m, drift_m, ..ideal(1) });
        assert!(
            matches!(error, SamplingError::Negative { .. } | SamplingError::NotPositive { .. }),
            "{error}"
        );
    }
    let planner = Planner::new(ideal(1)).unwrap();
    assert_eq!(planner.answers(&Question::default(), None), Err(SamplingError::NothingAsked));
    for bad in [0.0, -1.0, f64::NAN] {
        assert!(planner.answers(&speed(bad), None).is_err() && planner.t_max_m(0, bad).is_err());
    }
    // If a mode can't meet the target, its answer says so. This isn't an error.
    let answers = planner.answers(&speed(0.1), None).unwrap();
    assert!(answers[0].v_max_mps.is_some() && answers[4].reason == Some("angular_step"));
}

/// One head in the centre loses no speed to margins.
///
/// Four heads on one vehicle lose speed to hidden wall and to phases.
#[test]
fn margins_lower_the_speed_step_by_step_to_the_largest_planned_speed() {
    for (inspection, loses) in [(ideal(1), false), (vita_2(HeadLayout::PhaseShift), true)] {
        let planner = Planner::new(inspection).unwrap();
        let (mode, target_m) = (2, 0.5);
        let margins = planner.margins(mode, target_m).unwrap();
        let Margins { geometry_mps, hidden_mps, phase_mps, swing_mps, position_mps, losses_mps, .. } =
            margins;
        let speeds = [geometry_mps, hidden_mps, phase_mps, swing_mps, position_mps, losses_mps];
        assert!(speeds.windows(2).all(|pair| pair[0] >= pair[1]), "{speeds:?}");
        let most_mps = planner.v_max_mps(mode, target_m).unwrap();
        assert!(most_mps > 0.0 && (position_mps - most_mps).abs() < 1e-12, "{speeds:?}");
        assert_eq!(geometry_mps > 1.001 * phase_mps, loses, "{speeds:?}");
    }
}

/// The maximum range in the plan is the smallest of the heads' maximum ranges. The ping period follows from the turn
/// period.
#[test]
fn plan_states_the_maximum_range_and_ping_period() {
    let mut shorter = ideal(2);
    shorter.heads[1].0.range_m[1] = 8.0;
    // With a speed of sound 10 % higher, the same echo times give ranges 10 % longer.
    shorter.sound_speed_mps = 1650.0;
    let planner = Planner::new(shorter).unwrap();
    assert!((planner.reach_m() - 8.8).abs() < 1e-9, "{}", planner.reach_m());
    for (planned, (name, step_deg, period_s)) in planner.modes().iter().zip(MODES) {
        let period_s = period_s * step_deg / 360.0;
        assert!((planned.ping_period_s() - period_s).abs() < 1e-9, "{name}: {}", planned.ping_period_s());
    }
}

#[test]
fn drift_and_yaw_never_improve_the_plan() {
    let still = Planner::new(ideal(2)).unwrap();
    let drifting =
        Planner::new(Inspection { drift_m: 1.5, yaw_rad: f64::to_radians(15.0), ..ideal(2) }).unwrap();
    for mode in 0..MODES.len() {
        assert!(drifting.modes()[mode].t_y2_m > 1.5 * still.modes()[mode].t_y2_m);
        assert!(drifting.v_max_mps(mode, 3.0).unwrap() < still.v_max_mps(mode, 3.0).unwrap());
        // Plan values at the nominal pose are unchanged by drift and yaw.
        let same = drifting.modes()[mode].chords_m.iter().zip(still.modes()[mode].chords_m);
        assert!(same.into_iter().all(|(a, b)| (a - b).abs() < 1e-12));
    }
    assert!(drifting.farthest_m().1 > still.farthest_m().1 + 1.0);
}

#[test]
fn spacing_around_the_perimeter_includes_corners_hidden_strips_and_sectors() {
    let planner = Planner::new(vita_2(HeadLayout::PhaseShift)).unwrap();
    let places = planner.perimeter(2, 0.1, 720).unwrap();
    let most = places.iter().map(|place| place.t_y_m).fold(0.0, f64::max);
    assert!((most - planner.modes()[2].t_y2_m).abs() < 1e-9);
    assert!(places.iter().all(|place| place.t_y_m > 0.04));
    let at = |t_x_m: f64| places.iter().filter(|p| (p.t_x_m.unwrap()[1] - t_x_m).abs() < 1e-9).count();
    assert_eq!(at(0.2) + at(0.4), 720);
    assert!((at(0.4) as f64 * 35.9 / 720.0 - 3.4).abs() < 0.3, "{}", at(0.4));

    let sectors = inspection(vec![head([0.0; 3], false, 0.0); 3], HeadLayout::SectorOffset);
    let planner = Planner::new(sectors).unwrap();
    for place in planner.perimeter(0, 0.1, 360).unwrap() {
        let [smaller, larger] = place.t_x_m.unwrap();
        assert!((smaller + larger - 2.0 * 0.1 * 21.6 / 3.0).abs() < 1e-9 && smaller <= larger);
    }
}

#[test]
fn sample_pattern_counts_pings_sweeps_and_hidden_angles() {
    let planner = Planner::new(vita_2(HeadLayout::PhaseShift)).unwrap();
    let samples = planner.pattern(2, 0.1, 2.0).unwrap();
    assert_eq!(samples.len(), 4 * 801);
    assert_eq!(samples.iter().filter(|sample| sample.new_sweep).count(), 4);
    let hidden = samples.iter().filter(|sample| sample.hidden).count() as f64 / samples.len() as f64;
    assert!((hidden - 15.33 / 360.0).abs() < 2e-3, "{hidden}");
    let sectors = inspection(vec![head([0.0; 3], false, 0.0); 2], HeadLayout::SectorOffset);
    let samples = Planner::new(sectors).unwrap().pattern(2, 0.1, 2.0).unwrap();
    // Two turns' time is four sweeps of half a turn, with three turning points between the sweeps.
    assert_eq!(samples.iter().filter(|sample| sample.new_sweep).count(), 2 * 4);
}

#[test]
fn only_side_by_side_heads_gain_from_mounts_in_line() {
    let planner = Planner::new(vita_2(HeadLayout::PhaseShift)).unwrap();
    let gain = planner.in_line(0.5).unwrap().unwrap();
    assert!(gain.v_max_mps > 1.3 * gain.present_mps.unwrap(), "{gain:?}");
    let [places, sides]: [Vec<f64>; 2] =
        [0, 1].map(|k| gain.positions_m.iter().map(|place| place[k]).collect());
    assert_eq!(sides, [0.0; 4]);
    // The line of heads extends equally ahead and astern, and no two heads overlap.
    assert!(places.iter().sum::<f64>().abs() < 1e-12, "{places:?}");
    let mut sorted = places.clone();
    sorted.sort_by(f64::total_cmp);
    assert!(sorted.windows(2).all(|pair| pair[1] - pair[0] > 0.05), "{sorted:?}");
    assert!(places[0] > 0.0 && places[2] < 0.0, "heads in front must remain in front: {places:?}");
    // A plan for heads mounted in line gives the same speed as the prediction of `in_line`.
    let mut there = vita_2(HeadLayout::PhaseShift);
    for ((spec, _), place) in there.heads.iter_mut().zip(&gain.positions_m) {
        spec.mount.position = Vec3::new(place[0], place[1], place[2]);
    }
    let there = Planner::new(there).unwrap();
    let fastest = there.answers(&speed(0.5), None).unwrap().into_iter().filter_map(|answer| answer.v_max_mps);
    assert_eq!(fastest.fold(0.0, f64::max).to_bits(), gain.v_max_mps.to_bits());
    assert_eq!(there.in_line(0.5).unwrap(), None);
    assert_eq!(Planner::new(ideal(1)).unwrap().in_line(0.5).unwrap(), None);
}

/// Heads that are apart along the hull are in phase only near the speed for which they were started.
///
/// The live advice therefore differs from a plan, which may restart the heads.
#[test]
fn heads_started_for_a_slower_speed_than_v_max_lower_the_largest_speed() {
    let target_m = 0.6;
    let mode = 2;
    let apart = Planner::new(vita_2(HeadLayout::PhaseShift)).unwrap();
    let v_max_mps = apart.v_max_mps(mode, target_m).unwrap();
    let started = |planner: &Planner, share: f64| {
        planner.as_started_mps(mode, target_m, share * v_max_mps).unwrap() / v_max_mps
    };
    let held = started(&apart, HELD_SHARE);
    assert!(held > HELD_SHARE && held <= 1.0, "{held}");
    assert!(started(&apart, 0.7) < 0.9, "{}", started(&apart, 0.7));
    // With a single head, the speed for which the head was started makes no difference.
    let alone = Planner::new(ideal(1)).unwrap();
    let [slow, fast] = [0.3, 0.9].map(|share| started(&alone, share));
    assert!((slow - fast).abs() < 1e-3);
    assert!(
        apart.as_started_mps(mode, target_m, 0.0).is_err()
            && apart.as_started_mps(99, target_m, 0.1).is_err()
    );
}

/// The error names the configured target, not the target minus the margin for position errors.
#[test]
fn plan_error_names_the_configured_target() {
    let swinging = Inspection { yaw_rate_radps: 10.0, ..vita_2(HeadLayout::PhaseShift) };
    let why = Planner::new(swinging).unwrap().v_max_mps(2, 0.6).unwrap_err();
    assert!(why.to_string().contains("a target of 0.6 m"), "{why}");
}

/// Heads at one position have the same distances between samples as one head.
///
/// For heads at different positions, the smallest and largest distances between samples are over all heads.
#[test]
fn smallest_and_largest_sample_distances_are_over_all_heads() {
    let chords_m = |inspection: Inspection| {
        let planner = Planner::new(inspection).unwrap();
        planner.modes().iter().map(|mode| mode.chords_m).collect::<Vec<_>>()
    };
    let one = chords_m(ideal(1));
    for (four, one) in chords_m(ideal(4)).iter().zip(&one) {
        assert!(four.iter().zip(one).all(|(a, b)| (a - b).abs() < 1e-12), "{four:?} {one:?}");
    }
    let aside = |y_m: f64| inspection(vec![head([0.0, y_m, 0.0], false, 0.0)], HeadLayout::PhaseShift);
    let both = [head([0.0, 1.5, 0.0], false, 0.0), head([0.0, -0.5, 0.0], false, 0.0)];
    let both = chords_m(inspection(both.to_vec(), HeadLayout::PhaseShift));
    let [left, right] = [1.5, -0.5].map(|y_m| chords_m(aside(y_m)));
    for ((both, left), right) in both.iter().zip(&left).zip(&right) {
        let mean_m = f64::midpoint(left[1], right[1]);
        let expected = [left[0].min(right[0]), mean_m, left[2].max(right[2])];
        assert!(both.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{both:?} {expected:?}");
        assert!(both[0] < both[1] && both[1] < both[2]);
    }
}

/// At 0.2 rad/s, beams move 2.4 m along a wall 6 m away between two passes.
///
/// The tolerated yaw limits this movement of the beams.
#[test]
fn swing_is_limited_by_the_tolerated_yaw() {
    let v_mps = |yaw_deg: f64, rate_radps: f64| {
        let of = Inspection { yaw_rad: yaw_deg.to_radians(), yaw_rate_radps: rate_radps, ..ideal(4) };
        Planner::new(of).unwrap().v_max_mps(2, 1.2)
    };
    let [still, swinging] = [0.0, 0.2].map(|rate_radps| v_mps(0.5, rate_radps).unwrap());
    assert!((0.5 * still..0.97 * still).contains(&swinging), "{still} {swinging}");
    assert!(v_mps(20.0, 0.2).is_err(), "too far for any speed");
}
