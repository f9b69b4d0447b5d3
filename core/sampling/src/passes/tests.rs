use super::*;

fn situation(angles_deg: &[f64], x_m: &[f64]) -> Situation {
    let mut heads = [None; MAX_HEADS];
    for ((slot, angle), x) in heads.iter_mut().zip(angles_deg).zip(x_m) {
        *slot = Some(HeadMotion {
            mount: Mount { position: Vec3::new(*x, 0.0, 0.0), rotation: Rot::identity() },
            angle_rad: angle.to_radians(),
            rate_radps: TAU / 8.0,
            step_rad: f64::to_radians(0.9),
            sector_rad: None,
        });
    }
    let configured = angles_deg.len();
    Situation {
        pose: None,
        speed_mps: 0.2,
        pass_error_m: 0.0,
        layout: HeadLayout::PhaseShift,
        configured,
        heads,
        deaf: HeadSet::default(),
        losses: [LossRate::default(); MAX_HEADS],
        lost_at_most: LossRate::default(),
    }
}

fn passes(angles_deg: &[f64], x_m: &[f64]) -> Passes {
    Phasing::of(&situation(angles_deg, x_m)).at(0.2)
}

fn all(passes: &Passes) -> f64 {
    passes.gap_s(passes.heads()).unwrap()
}

#[test]
fn evenly_phased_heads_pass_at_equal_intervals() {
    let passes = passes(&[10.0, 100.0, 190.0, 280.0], &[0.0; 4]);
    assert!((all(&passes) - 2.0).abs() < 1e-9 && (passes.even_gap_s() - 2.0).abs() < 1e-12);
    let errors = passes.phase_errors_rad(4);
    assert!(errors[..4].iter().all(|error| error.unwrap().abs() < 1e-9) && errors[4].is_none());
    let planned = Passes::evenly_phased(HeadSet::first(4), |_| 8.0).unwrap();
    assert!((all(&planned) - 2.0).abs() < 1e-12);
    // Heads side by side see a place at angles that differ by up to 9 degrees, a fortieth of a turn.
    assert!((all(&planned.beside(TAU / 40.0)) - 2.2).abs() < 1e-12);
    assert!((planned.beside(TAU / 40.0).gap_s(HeadSet::first(1)).unwrap() - 8.0).abs() < 1e-12);
}

#[test]
fn evened_passes_keep_the_turn_period_of_each_head() {
    let mut uneven = situation(&[0.0, 100.0], &[0.0; 2]);
    uneven.heads[1].as_mut().unwrap().rate_radps = TAU / 8.1;
    let even = Phasing::of(&uneven).at(0.2).evened();
    assert!(
        (even.gap_s(HeadSet::first(1)).unwrap() - 8.0).abs() < 1e-12 && (all(&even) - 4.05).abs() < 1e-12
    );
}

#[test]
fn place_hidden_from_some_heads_has_longer_times_between_passes_than_other_places() {
    let passes = Passes::evenly_phased(HeadSet::first(4), |_| 8.0).unwrap();
    let gap_s =
        |hidden: [usize; 2]| passes.gap_s(passes.heads().without(hidden[0]).without(hidden[1])).unwrap();
    // The place is hidden from two of four heads. If these two heads are half a turn apart, the longest gap doubles. If
    // they are a quarter turn apart, two successive passes are missing, so the gap triples.
    assert!((gap_s([0, 2]) - 4.0).abs() < 1e-12 && (gap_s([0, 1]) - 6.0).abs() < 1e-12);
    assert_eq!(passes.gap_s(HeadSet::default()), None);
    assert_eq!(passes.gap_s(HeadSet::default().with(6)), None);
}

#[test]
fn time_for_several_passes_is_the_time_of_the_slowest_sequence() {
    let even = Passes::evenly_phased(HeadSet::first(4), |_| 8.0).unwrap();
    let time_s = |heads: HeadSet, needed: f64| even.time_for_s(heads, even.gap_s(heads).unwrap(), needed);
    let all = even.heads();
    assert!((time_s(all, 1.0) - 2.0).abs() < 1e-12 && (time_s(all, 2.5) - 5.0).abs() < 1e-12);
    assert!((time_s(all, 9.0) - 18.0).abs() < 1e-12);
    // Two heads that are a quarter of a turn apart pass with alternating gaps of 6 s and 2 s.
    let two = all.without(0).without(1);
    for (needed, seconds) in [(1.0, 6.0), (1.5, 7.0), (2.0, 8.0), (3.0, 14.0), (4.0, 16.0)] {
        assert!((time_s(two, needed) - seconds).abs() < 1e-9, "{needed}");
    }
    assert!((time_s(HeadSet::first(1), 3.0) - 24.0).abs() < 1e-12);
    let sectors = Passes::in_sectors(HeadSet::first(2), 8.0).unwrap();
    for (needed, seconds) in [(1.0, 8.0), (2.0, 8.0), (2.5, 12.0), (3.0, 16.0), (4.0, 16.0)] {
        assert!((sectors.time_for_s(sectors.heads(), 8.0, needed) - seconds).abs() < 1e-9, "{needed}");
    }
}

#[test]
fn heads_at_one_place_with_equal_angles_pass_together() {
    let together = passes(&[0.0, 0.0], &[0.0, 0.0]);
    assert!((all(&together) - 8.0).abs() < 1e-9 && (together.even_gap_s() - 4.0).abs() < 1e-12);
    assert!((together.phase_errors_rad(2)[1].unwrap().abs() - math::PI).abs() < 1e-9);
    // Heads at equal angles interleave if they are apart along the hull by half the advance per turn: 0.8 m at 0.2
    // m/s and 8 s per turn.
    let apart = passes(&[0.0, 0.0], &[0.8, 0.0]);
    assert!((all(&apart) - 4.0).abs() < 1e-9);
}

#[test]
fn reversed_vehicle_reverses_the_order_of_heads() {
    let mut back = situation(&[0.0, 90.0], &[0.9, -0.3]);
    let out = Phasing::of(&back).at(0.2);
    let turned = Rot::from_roll_pitch_yaw(0.0, 0.0, math::PI);
    back.pose = Some(Pose { position: headrace_geometry::frames::Point3::zero(), attitude: turned });
    // Travelling back nose first mirrors travelling out nose first. Travelling back tail first does not.
    assert!((all(&Phasing::of(&back).at(-0.2)) - all(&out)).abs() < 1e-9);
    assert!((all(&Phasing::of(&back).at(0.2)) - all(&out)).abs() > 0.1);
    // If the vehicle yaws, the distance of heads along the tunnel grows. Heads whose scan planes lie along the tunnel
    // have no phase.
    let askew = |yaw: f64| Rot::from_roll_pitch_yaw(0.0, 0.0, yaw);
    let mount = Mount { position: Vec3::new(1.0, 0.0, 0.0), rotation: Rot::identity() };
    assert!((ahead_m(&askew(0.5), &mount).unwrap() - 1.0 / math::cos(0.5)).abs() < 1e-12);
    assert_eq!(ahead_m(&askew(math::FRAC_PI_2), &mount), None);
}

#[test]
fn late_head_has_a_positive_phase_error() {
    // The second of two heads should be half a turn ahead, but is only 150 degrees ahead.
    let passes = passes(&[0.0, 150.0], &[0.0, 0.0]);
    assert!((passes.phase_errors_rad(2)[1].unwrap() - f64::to_radians(30.0)).abs() < 1e-9);
    // At 10 % above the planned speed, the phase error of a head 1.6 m astern (the advance of one turn) is 1 - 1 /
    // 1.1 of a turn.
    let at = |speed| Phasing::of(&situation(&[0.0, 180.0], &[1.6, 0.0])).at(speed).phase_errors_rad(2)[1];
    assert!(at(0.2).unwrap().abs() < 1e-9);
    assert!((at(0.22).unwrap() - TAU * (1.0 - 1.0 / 1.1)).abs() < 1e-9, "{:?}", at(0.22));
    assert_eq!(at(0.0), None);
}

#[test]
fn heads_must_all_rotate_in_the_same_sense_to_be_in_phase() {
    let mut mirrored = situation(&[0.0, 180.0], &[0.0, 0.0]);
    for head in mirrored.heads.iter_mut().flatten() {
        head.rate_radps = -head.rate_radps;
    }
    assert!((all(&Phasing::of(&mirrored).at(0.2)) - 4.0).abs() < 1e-9);
    if let Some(first) = mirrored.heads.iter_mut().flatten().next() {
        first.rate_radps = -first.rate_radps;
    }
    let opposed = Phasing::of(&mirrored).at(0.2);
    assert!((all(&opposed) - 8.0).abs() < 1e-9 && opposed.phase_errors_rad(2) == [None; MAX_HEADS]);
}

#[test]
fn heads_with_unequal_turn_periods_count_as_the_fastest_head_alone() {
    let mut mixed = situation(&[0.0, 180.0], &[0.0, 0.0]);
    if let Some(second) = mixed.heads.iter_mut().flatten().nth(1) {
        second.rate_radps = TAU / 21.6;
    }
    assert!((all(&Phasing::of(&mixed).at(0.2)) - 8.0).abs() < 1e-9);
    let planned = Passes::evenly_phased(HeadSet::first(2), |head| 8.0 + 0.01 * head as f64).unwrap();
    assert!((all(&planned) - 8.0).abs() < 1e-12);
}

/// The fourth of four heads is on its way back to its program. The other three are in step.
#[test]
fn head_out_of_step_adds_only_its_own_passes() {
    let mut returning = situation(&[0.0, 90.0, 180.0, 270.0], &[0.5, 0.5, -0.5, -0.5]);
    let three = Situation {
        heads: {
            let mut heads = returning.heads;
            heads[3] = None;
            heads
        },
        ..returning
    };
    let three = Phasing::of(&three).at(0.2);
    for turn_s in [2.0, 21.6, -8.0] {
        returning.heads[3].as_mut().unwrap().rate_radps = TAU / turn_s;
        let phasing = Phasing::of(&returning);
        assert_eq!(phasing.in_step(), HeadSet::first(3), "{turn_s}");
        let passes = phasing.at(0.2);
        assert!((all(&passes) - all(&three).min(turn_s.abs())).abs() < 1e-9, "{turn_s}: {}", all(&passes));
        let last = HeadSet::default().with(3);
        assert!((passes.gap_s(last).unwrap() - turn_s.abs()).abs() < 1e-9);
        assert!((passes.even_gap_s() - (8.0_f64 / 3.0).min(turn_s.abs())).abs() < 1e-9);
        assert_eq!(passes.phase_errors_rad(4)[3], None);
        assert_eq!(phasing.first_passes().count(), 3);
    }
    returning.heads[3].as_mut().unwrap().rate_radps = TAU / 8.1;
    assert_eq!(Phasing::of(&returning).in_step(), HeadSet::first(4), "within 2 %");
}

#[test]
fn measured_sector_is_ignored_in_a_phase_shift_layout() {
    let mut jerked = situation(&[0.0, 180.0], &[0.0, 0.0]);
    for head in jerked.heads.iter_mut().flatten() {
        head.sector_rad = Some(f64::to_radians(0.9));
    }
    assert!((all(&Phasing::of(&jerked).at(0.2)) - 4.0).abs() < 1e-9);
    // In the sector layout with two heads, a sector that has not been measured counts as half a turn, swept there and
    // back.
    let mut sectors = situation(&[0.0, 180.0], &[0.0, 0.0]);
    sectors.layout = HeadLayout::SectorOffset;
    assert!((all(&Phasing::of(&sectors).at(0.2)) - 8.0).abs() < 1e-9);
    assert_eq!(Phasing::of(&sectors).at(0.2).phase_errors_rad(2), [None; MAX_HEADS]);
}

#[test]
fn planned_heads_without_a_failed_head_pass_at_equal_intervals() {
    let three = Passes::evenly_phased(HeadSet::first(4).without(1), |_| 9.0).unwrap();
    assert!((all(&three) - 3.0).abs() < 1e-12);
    let none = HeadSet::default();
    assert_eq!(Passes::evenly_phased(none, |_| 8.0), Err(SamplingError::HeadCount { heads: 0 }));
    assert_eq!(Passes::in_sectors(none, 16.0), Err(SamplingError::HeadCount { heads: 0 }));
    assert!((all(&Passes::in_sectors(HeadSet::first(2), 8.0).unwrap()) - 8.0).abs() < 1e-12);
}

#[test]
fn parallax_is_larger_in_a_narrow_tunnel_than_in_a_wide_one() {
    let wide = headrace_geometry::tunnel::shapes::circle(6.0).unwrap();
    let narrow = headrace_geometry::tunnel::shapes::circle(1.0).unwrap();
    let of = |profile: &Profile, z: f64| parallax_rad(profile, &[[0.15, z], [-0.15, z]]);
    // At a range of 6 m, heads 0.3 m apart see one place at angles 0.05 rad apart.
    assert!((of(&wide, 6.0) - 0.05).abs() < 1e-3 && of(&narrow, 1.0) > 0.29);
    assert!(parallax_rad(&wide, &[[0.1, 6.0]]) <= 0.0 && parallax_rad(&wide, &[]) <= 0.0);
}

/// The mean distance does not depend on the position of the vehicle's origin along the hull.
#[test]
fn mean_distance_between_successive_heads_is_a_share_of_the_largest_distance() {
    for origin_m in [-3.0, 0.0, 0.4, 5.0] {
        let at = |x_m: &[f64]| {
            let x_m: Vec<f64> = x_m.iter().map(|x_m| x_m + origin_m).collect();
            let angles: Vec<f64> =
                (0..x_m.len()).map(|head| 360.0 * head as f64 / x_m.len() as f64).collect();
            Phasing::of(&situation(&angles, &x_m))
        };
        for (x_m, apart_m, share) in [
            (vec![0.9, -0.3], 1.2, 1.0),
            (vec![0.9, 0.9, -0.3, -0.3], 1.2, 0.5),
            (vec![0.9, -0.3, 0.9, -0.3], 1.2, 1.0),
            // The mean of 0.4 m, 0.4 m, and 0.8 m from the last head back to the first, is two thirds of 0.8 m.
            (vec![0.0, 0.4, 0.8], 0.8, 2.0 / 3.0),
            (vec![0.7, 0.7], 0.0, 0.0),
            (vec![0.7], 0.0, 0.0),
            (vec![], 0.0, 0.0),
        ] {
            let heads = at(&x_m);
            assert!((heads.apart_m() - apart_m).abs() < 1e-12, "{x_m:?}: {}", heads.apart_m());
            assert!((heads.neighbours_apart() - share).abs() < 1e-9, "{x_m:?}: {}", heads.neighbours_apart());
            assert_eq!(heads.fits_some_speeds(), apart_m > 0.0, "{x_m:?}");
        }
    }
    // Heads that turn in opposite senses pass in no fixed order, so their distances count as zero.
    let mut loose = situation(&[0.0, 180.0], &[0.9, -0.3]);
    loose.heads[1].as_mut().unwrap().rate_radps = -TAU / 8.0;
    let heads = Phasing::of(&loose);
    assert!(
        heads.apart_m().abs() <= 0.0 && heads.neighbours_apart().abs() <= 0.0 && !heads.fits_some_speeds()
    );
}

/// Scheduled heads pass a place at equal intervals at the planned speed, whatever their positions along the hull.
#[test]
fn scheduled_heads_pass_at_equal_intervals_at_the_planned_speed() {
    for x_m in [[0.8, 0.0, -0.5], [0.0, 1.3, 0.2]] {
        let phasing = Phasing::of(&situation(&[3.0, 200.0, 77.0], &x_m)).as_scheduled(3, 0.1);
        let gap_s = |mps: f64| all(&phasing.at(mps));
        assert!((gap_s(0.1) - 8.0 / 3.0).abs() < 1e-9, "{x_m:?}: {}", gap_s(0.1));
        assert!(gap_s(0.13) > 3.0, "{x_m:?}: {}", gap_s(0.13));
        // A schedule for speed zero assumes heads at one place of the hull.
        let at_rest = Phasing::of(&situation(&[3.0, 200.0, 77.0], &[0.0; 3])).as_scheduled(3, 0.0);
        assert!((all(&at_rest.at(0.1)) - 8.0 / 3.0).abs() < 1e-9);
    }
}
