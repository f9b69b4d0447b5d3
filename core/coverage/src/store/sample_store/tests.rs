use super::*;
use proptest::prelude::*;

const PERIMETER_M: f64 = 7.3;
const LAYOUT: StoreLayout =
    StoreLayout { perimeter_m: PERIMETER_M, from_m: -1.0, to_m: 212.0, cell_m: 0.3, capacity: 200_000 };

fn at(x_m: f64, arc_m: f64) -> WallPoint {
    WallPoint { x_m, arc_m }
}

fn sample(x_m: f64, arc_m: f64) -> WallSample {
    WallSample { x_m, arc_m, head: 0, step_m: None, visit: 0 }
}

/// Creates samples at these places for several heads in turn. Each head goes from place to place in single steps.
///
/// The first sample of each head has no step.
fn steps(places: &[(f64, f64)], heads: usize) -> Vec<WallSample> {
    let mut last = vec![None; heads];
    let mut all = Vec::new();
    for (k, (x_m, arc_m)) in places.iter().enumerate() {
        let head = k % heads;
        let step_m = last[head].replace((*x_m, *arc_m)).map(|(from_x_m, from_arc_m): (f64, f64)| {
            [x_m - from_x_m, math::wrap_signed(arc_m - from_arc_m, PERIMETER_M)]
        });
        all.push(WallSample { x_m: *x_m, arc_m: *arc_m, head, step_m, visit: 0 });
    }
    all
}

fn store(samples: &[WallSample]) -> SampleStore {
    let mut store = SampleStore::new(LAYOUT);
    for sample in samples {
        assert_eq!(store.insert(*sample), Ok(Kept::Stored));
    }
    store
}

/// Opens other bricks until all bricks of the first 40 m are packed.
fn pack_the_first_40_m(store: &mut SampleStore) {
    for k in 0..100 {
        store.insert(sample(210.0 - 1.2 * f64::from(k), 0.0)).unwrap();
    }
    assert!(store.bricks.iter().take(30).all(|brick| brick.slot == 0), "all bricks must be packed");
}

/// Samples stored in the first 40 m, sorted.
fn kept(store: &SampleStore) -> Vec<(f64, f64)> {
    let mut kept = Vec::new();
    store.each_between(-1.0, 40.0, |place, _| kept.push((place.x_m, place.arc_m)));
    kept.retain(|place| place.0 < 40.0);
    kept.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    kept
}

/// Distances in chainage from a point to every place where a step crosses the point's arc length.
///
/// The chainage of a crossing is interpolated along the step.
fn crossings(samples: &[WallSample], (x_m, arc_m): (f64, f64)) -> Vec<f64> {
    let mut found = Vec::new();
    for end in samples {
        let Some([along_m, around_m]) = end.step_m else { continue };
        for turn in [-1.0, 0.0, 1.0] {
            let start = end.arc_m - around_m + turn * PERIMETER_M;
            let share = (arc_m - start) / around_m;
            if share > 0.0 && share <= 1.0 {
                found.push((end.x_m - (1.0 - share) * along_m - x_m).abs());
            }
        }
    }
    found
}

fn apart(a: (f64, f64), b: (f64, f64)) -> f64 {
    let around = (a.1 - b.1).abs() % PERIMETER_M;
    math::hypot(a.0 - b.0, around.min(PERIMETER_M - around))
}

fn places(most: usize) -> impl Strategy<Value = Vec<(f64, f64)>> {
    proptest::collection::vec((-1.0f64..12.0, 0.0f64..PERIMETER_M), 0..most)
}

proptest! {
    /// The reference for the nearest pass is a brute-force search over every step.
    #[test]
    fn nearest_pass_agrees_with_brute_force(
        places in places(60),
        heads in 1_usize..4,
        place in (-3.0f64..14.0, 0.0f64..PERIMETER_M),
        within_m in 0.05f64..9.0,
    ) {
        let samples = steps(&places, heads);
        let expected = crossings(&samples, place).into_iter().filter(|d| *d <= within_m).min_by(f64::total_cmp);
        let found = store(&samples).nearest_pass_m(at(place.0, place.1), within_m);
        match (found, expected) {
            (Some(found), Some(expected)) => prop_assert!((found - expected).abs() < 1e-9),
            (found, expected) => prop_assert_eq!(found, expected),
        }
    }

    /// Passes in packed bricks are found as accurately as samples are packed.
    ///
    /// Steps are as short as those of real heads. So interpolation along a step does not amplify the error.
    #[test]
    fn nearest_pass_among_packed_samples_has_the_accuracy_of_packing(
        starts in proptest::collection::vec((0.0f64..12.0, 0.0f64..PERIMETER_M, -0.06f64..0.06), 1..8),
        place in (-1.0f64..13.0, 0.0f64..PERIMETER_M),
    ) {
        let mut samples = Vec::new();
        for (head, (x_m, arc_m, around_m)) in starts.iter().enumerate() {
            for k in 0..80 {
                let arc_m = math::wrap(arc_m + around_m * f64::from(k), PERIMETER_M);
                let step_m = (k > 0).then_some([0.002, *around_m]);
                samples.push(WallSample { x_m: x_m + 0.002 * f64::from(k), arc_m, head, step_m, visit: 0 });
            }
        }
        // If the point is at the end of a step, an error of micrometres may select another pass.
        prop_assume!(samples.iter().all(|s| (s.arc_m - place.1).abs() > 1e-4));
        prop_assume!(starts.iter().all(|(_, _, around_m)| around_m.abs() > 0.01));
        let expected = crossings(&samples, place).into_iter().filter(|d| *d <= 9.0).min_by(f64::total_cmp);
        prop_assume!(expected.is_none_or(|d| d < 8.99));
        let mut store = SampleStore::new(LAYOUT);
        for sample in &samples {
            store.insert(*sample).unwrap();
        }
        prop_assume!(store.usage().thinned == 0);
        pack_the_first_40_m(&mut store);
        let found = store.nearest_pass_m(at(place.0, place.1), 9.0);
        match (found, expected) {
            (Some(found), Some(expected)) => prop_assert!((found - expected).abs() < 3e-5, "{found} {expected}"),
            (found, expected) => prop_assert_eq!(found, expected),
        }
    }

    /// Each sample stays within the stated displacement, even if it is packed and opened repeatedly.
    #[test]
    fn packed_samples_stay_within_the_stated_displacement(places in places(200), heads in 1_usize..8, reversed: bool) {
        let mut samples = steps(&places, heads);
        if reversed {
            samples.reverse();
        }
        let mut store = store(&samples);
        let mut expected = places.clone();
        expected.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        prop_assert_eq!(kept(&store), expected, "no sample moves while open");
        prop_assert_eq!(store.fidelity(-1.0, 12.0), Fidelity::default());
        pack_the_first_40_m(&mut store);
        let once = kept(&store);
        prop_assert_eq!(once.len(), places.len());
        prop_assert_eq!(store.fidelity(-1.0, 12.0).moved_m > 0.0, !places.is_empty());
        for place in &places {
            let nearest = once.iter().map(|other| apart(*place, *other)).fold(f64::INFINITY, f64::min);
            prop_assert!(nearest <= packed::MOVED_M, "{place:?} was moved by {nearest}");
        }
        for _ in 0..3 {
            for k in 0..40 {
                store.opened(store.brick_of(store.row_near(f64::from(k))), false);
            }
            pack_the_first_40_m(&mut store);
        }
        prop_assert_eq!(kept(&store), once, "no sample moves the second time");
    }

    /// Every dropped sample has a stored sample within the stated distance.
    #[test]
    fn every_dropped_sample_has_a_stored_sample_nearby(
        places in proptest::collection::vec((0.0f64..0.31, 1.0f64..1.31), 400..900),
        packing: bool,
    ) {
        let mut store = SampleStore::new(LAYOUT);
        for (k, place) in places.iter().enumerate() {
            store.insert(sample(place.0, place.1)).unwrap();
            if packing && k == 300 {
                pack_the_first_40_m(&mut store);
            }
        }
        let (kept, fidelity) = (kept(&store), store.fidelity(0.0, 0.3));
        prop_assert!(kept.len() < places.len(), "some samples must be dropped");
        prop_assert_eq!(kept.len() + store.usage().thinned as usize, places.len());
        for place in &places {
            let nearest = kept.iter().map(|other| apart(*place, *other)).fold(f64::INFINITY, f64::min);
            prop_assert!(nearest <= fidelity.thinned_m + fidelity.moved_m, "{place:?}: {nearest}");
        }
        let farthest = places.iter().map(|place| {
            kept.iter().map(|other| apart(*place, *other)).fold(f64::INFINITY, f64::min)
        }).fold(0.0, f64::max);
        prop_assert!(farthest > 0.1 * fidelity.thinned_m, "the stated distance is realistic");
    }
}

#[test]
fn pass_position_is_interpolated_where_the_step_crosses_the_arc_length() {
    let mut store = store(&[sample(1.0, 7.2), sample(1.1, 0.2), sample(3.0, 7.2)]);
    // The step from (1.0, 7.2) to (1.3, 0.1) crosses the seam at its centre.
    let step = WallSample { step_m: Some([0.3, 0.2]), ..sample(1.3, 0.1) };
    store.insert(step).unwrap();
    let distance = store.nearest_pass_m(at(2.0, 0.0), 5.0).unwrap();
    assert!((distance - 0.85).abs() < 1e-9, "{distance}");
    assert_eq!(store.nearest_pass_m(at(2.0, 0.0), 0.5), None);
    assert_eq!(store.nearest_pass_m(at(2.0, 1.0), 5.0), None);
}

#[test]
fn samples_outside_the_extent_or_above_the_capacity_are_refused() {
    let layout = StoreLayout { perimeter_m: 3.0, from_m: 0.0, to_m: 1.0, cell_m: 0.25, capacity: 1 };
    let mut store = SampleStore::new(layout);
    let sample = sample(0.5, 1.0);
    for x_m in [-0.1, 1.1, f64::NAN] {
        assert_eq!(store.insert(WallSample { x_m, ..sample }), Err(StoreError::Outside));
    }
    assert_eq!(store.insert(WallSample { arc_m: f64::INFINITY, ..sample }), Err(StoreError::Outside));
    assert!(store.covers(at(0.0, 1.0)) && store.covers(at(1.0, 7.0)) && !store.covers(at(1.1, 1.0)));
    assert!(!store.covers(at(0.5, f64::NAN)) && !store.covers(at(f64::NAN, 1.0)));
    assert_eq!(store.insert(sample), Ok(Kept::Stored));
    assert_eq!(store.insert(sample), Err(StoreError::Full));
}

/// Samples that do not fit are reported, and stored samples remain.
#[test]
fn full_store_keeps_all_stored_samples() {
    let mut store = SampleStore::new(StoreLayout { capacity: 3_000, ..LAYOUT });
    let mut stored = 0;
    for k in 0..20_000_u32 {
        let x_m = f64::from(k) * 0.01;
        match store.insert(sample(x_m, (f64::from(k) * 2.37) % PERIMETER_M)) {
            Ok(_) => stored += 1,
            Err(error) => assert_eq!(error, StoreError::Full),
        }
    }
    assert!((3_000..20_000).contains(&stored), "{stored}");
    let mut seen = 0;
    store.each_between(-1.0, 212.0, |_, _| seen += 1);
    assert_eq!(seen, stored);
}

/// For an hour, four heads at 50 pings per second see the same spot, with jitter of a centimetre.
#[test]
fn memory_stops_growing_while_the_vehicle_is_stationary() {
    let mut store = SampleStore::new(LAYOUT);
    let (mut hashed, mut after_half) = (1_u64, None);
    let mut noise_m = || {
        hashed = hashed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((hashed >> 33) as f64 / (1_u64 << 31) as f64 - 0.5) * 0.04
    };
    let pings = 50 * 3600;
    for k in 0..pings {
        for head in 0..4 {
            let arc_m = (k as f64 / 400.0 + f64::from(head) / 4.0) * PERIMETER_M + noise_m();
            let head = head as usize;
            store.insert(WallSample { head, ..sample(100.0 + noise_m(), arc_m) }).unwrap();
        }
        if k == pings / 2 {
            after_half = Some(store.usage());
        }
    }
    let (usage, after_half) = (store.usage(), after_half.unwrap());
    assert_eq!(usage.kept + usage.thinned, 4 * pings as u64);
    assert!(usage.kept < 10_000, "{usage:?}");
    assert!(usage.bytes < 2_000_000, "{usage:?}");
    assert!(usage.kept - after_half.kept < 300, "the store should hardly grow: {after_half:?} {usage:?}");
    assert!(store.fidelity(100.0, 100.0).thinned_m <= 0.02);
}

/// The direction of a step distinguishes passes. So a full cell drops a step only if a nearby step has the same
/// direction.
#[test]
fn step_is_dropped_only_near_a_step_in_the_same_direction() {
    let mut store = SampleStore::new(LAYOUT);
    let mut goes = |around_m: f64, k: u32| {
        // The samples lie within a decimetre of one cell, a millimetre apart.
        let off_m = 0.001 * f64::from(k % 100);
        let before = store.usage().thinned;
        store.insert(WallSample { step_m: Some([0.002, around_m]), ..sample(100.1, 3.05 + off_m) }).unwrap();
        store.usage().thinned > before
    };
    let ways: Vec<bool> = (0..400).map(|k| goes(0.05, k)).collect();
    assert!(ways[..100].iter().all(|dropped| !dropped) && ways[300..].iter().all(|dropped| *dropped));
    assert!(!goes(-0.03, 17), "the first step in the other direction is kept");
    assert!(goes(0.05, 17));
}

/// While the vehicle drives back and forth over one stretch, memory and error do not grow.
#[test]
fn memory_does_not_grow_over_a_hundred_passes_back_and_forth() {
    let mut store = SampleStore::new(LAYOUT);
    let mut after_seventy = None;
    for round in 0..100 {
        for k in 0..500 {
            let k = if round % 2 == 0 { k } else { 499 - k };
            // The vehicle drives 150 m back and forth, so the first bricks are packed and opened each time.
            let x_m = 0.3 * f64::from(k);
            store.nearest_pass_m(at(x_m, 1.0), 12.0);
            let arc_m = (f64::from(k) * 0.045 + f64::from(round % 7) * 1e-3) % PERIMETER_M;
            store.insert(sample(x_m + f64::from(round % 5) * 1e-3, arc_m)).unwrap();
        }
        if round == 69 {
            after_seventy = Some((kept(&store), store.usage()));
        }
    }
    let (usage, (then, used)) = (store.usage(), after_seventy.unwrap());
    assert!(usage.kept < used.kept + used.kept / 50, "full cells must drop samples: {used:?} {usage:?}");
    assert!(usage.bytes < used.bytes + used.bytes / 50, "{used:?} {usage:?}");
    let now = kept(&store);
    let lost = then.iter().filter(|place| !now.iter().any(|other| apart(**place, *other) <= packed::MOVED_M));
    assert_eq!(lost.count(), 0, "samples stay where they were");
}

#[test]
fn packing_keeps_the_visit_number_of_each_sample() {
    let mut store = SampleStore::new(LAYOUT);
    let visited = |k: u32| WallSample {
        head: k as usize % 3,
        visit: [0, 0, 1, 7, 7, u32::MAX][k as usize / 3 % 6],
        ..sample(5.0 + 0.01 * f64::from(k), 0.02 * f64::from(k))
    };
    for k in 0..90 {
        store.insert(visited(k)).unwrap();
    }
    let visits = |store: &SampleStore| {
        let mut visits = Vec::new();
        store.each_between(4.0, 7.0, |place, visit| visits.push(((place.x_m * 100.0).round() as i64, visit)));
        visits.sort_unstable();
        visits
    };
    let before = visits(&store);
    assert_eq!(before.len(), 90);
    pack_the_first_40_m(&mut store);
    assert_eq!(visits(&store), before);
}

/// One stretch may contain as many samples as there is room for in all open bricks.
#[test]
fn packed_stretch_that_fills_all_open_bricks_can_be_read() {
    let mut store = SampleStore::new(StoreLayout { capacity: 4, ..LAYOUT });
    for k in 0..4 {
        let at = f64::from(k);
        let step_m = (k > 0).then_some([0.01, 0.1]);
        store.insert(WallSample { step_m, ..sample(1.0 + 0.01 * at, 2.0 + 0.1 * at) }).unwrap();
    }
    store.insert(sample(100.0, 0.0)).unwrap();
    assert!(
        store.bricks.iter().take(30).all(|brick| brick.slot == 0),
        "the bricks must be packed for the distant sample"
    );
    // The step from 2.2 to 2.3 m of arc length crosses the point's arc length at the step's centre.
    let distance = store.nearest_pass_m(at(1.5, 2.25), 5.0).unwrap();
    assert!((distance - 0.475).abs() < 3e-5, "{distance}");
}

/// Packed samples of a turning head take four bytes each, with or without single steps.
#[test]
fn packed_samples_of_a_sweep_take_one_word_each() {
    for is_stepped in [true, false] {
        let mut store = SampleStore::new(LAYOUT);
        let all = store.arena.free_words();
        for k in 0..10_000 {
            let at = f64::from(k);
            let step_m = (is_stepped && k > 0).then_some([0.003, 0.05]);
            let sample = sample(0.003 * at, 0.05 * at % PERIMETER_M);
            assert_eq!(store.insert(WallSample { step_m, ..sample }), Ok(Kept::Stored));
        }
        pack_the_first_40_m(&mut store);
        let words = all - store.arena.free_words();
        assert!((10_000..12_000).contains(&words), "{is_stepped}: {words}");
    }
}

#[test]
fn sample_store_cell_edge_is_half_the_target_within_limits() {
    for (target_m, cell_m) in [(0.5, 0.25), (0.8, 0.4), (1.0, 0.5), (6.0, 0.5), (0.1, 0.05), (0.02, 0.05)] {
        assert!((StoreLayout::cell_for_target_m(target_m) - cell_m).abs() < 1e-12, "{target_m}");
    }
}

/// A pass is found at its chainage, whatever the first chainage of the wall.
#[test]
fn pass_is_found_at_its_chainage_wherever_the_wall_begins() {
    for from_m in [-1.0, 0.0, 6000.0] {
        let layout = StoreLayout { from_m, to_m: from_m + 40.0, ..LAYOUT };
        let mut store = SampleStore::new(layout);
        for k in 0..30 {
            let x_m = from_m + 1.0 + f64::from(k);
            store.insert(WallSample { step_m: Some([0.0, 0.2]), ..sample(x_m, 1.1) }).unwrap();
        }
        for k in 0..30 {
            let x_m = from_m + 1.05 + f64::from(k);
            let found = store.nearest_pass_m(at(x_m, 1.0), 0.1);
            assert!(found.is_some_and(|m| (m - 0.05).abs() < 1e-4), "{from_m} {x_m}: {found:?}");
        }
    }
}

/// The last chainage of the wall belongs to the last row.
#[test]
fn sample_at_the_end_of_the_wall_is_found() {
    let layout = StoreLayout { from_m: 0.0, to_m: 10.0, cell_m: 0.25, ..LAYOUT };
    let mut store = SampleStore::new(layout);
    for (k, x_m) in [9.4, 10.0].into_iter().enumerate() {
        let sample = WallSample { step_m: Some([0.0, 0.2]), ..sample(x_m, 1.1) };
        assert_eq!(store.insert(sample), Ok(Kept::Stored), "{k}");
    }
    let mut found = Vec::new();
    store.each_between(9.9, 10.0, |place, _| found.push(place.x_m));
    assert!(found.len() == 1 && (found[0] - 10.0).abs() < 1e-4, "{found:?}");
    assert!(store.nearest_pass_m(at(9.95, 1.0), 0.1).is_some_and(|m| (m - 0.05).abs() < 1e-4));
}
