use super::*;
use crate::store::{Kept, StoreLayout, WallSample};
use headrace_support::hard_cases::found;
use proptest::prelude::*;

const PERIMETER_M: f64 = 9.0;

fn store(perimeter_m: f64, samples: &[(f64, f64)]) -> SampleStore {
    let layout = StoreLayout { perimeter_m, from_m: -20.0, to_m: 40.0, cell_m: 0.4, capacity: 100_000 };
    let mut store = SampleStore::new(layout);
    for (x_m, arc_m) in samples {
        store.insert(WallSample { x_m: *x_m, arc_m: *arc_m, head: 0, step_m: None, visit: 0 }).unwrap();
    }
    store
}

fn largest(perimeter_m: f64, samples: &[(f64, f64)], from_m: f64, to_m: f64) -> Hole {
    HoleFinder::default().largest(&store(perimeter_m, samples), from_m, to_m)
}

/// Distance from a point to the nearest sample, by brute force.
fn nearest_m(perimeter_m: f64, samples: &[(f64, f64)], place: (f64, f64)) -> f64 {
    let distance = |s: &(f64, f64)| {
        let around = (s.1 - place.1).abs() % perimeter_m;
        math::hypot(s.0 - place.0, around.min(perimeter_m - around))
    };
    samples.iter().map(distance).fold(f64::INFINITY, f64::min)
}

/// Diameter of the largest hole by brute force, without any code of the search under test.
///
/// The distance to the samples is largest at the circumcentre of three samples (or of their images), or at a point on
/// one of the section's two ends that is equidistant from two samples. All of these places are tried.
fn brute_force(perimeter_m: f64, samples: &[(f64, f64)], from_m: f64, to_m: f64) -> f64 {
    let images: Vec<(f64, f64)> =
        samples.iter().flat_map(|s| [-perimeter_m, 0.0, perimeter_m].map(|turn| (s.0, s.1 + turn))).collect();
    let mut candidates = Vec::new();
    for (i, a) in images.iter().enumerate() {
        for (j, b) in images.iter().enumerate().skip(i + 1) {
            // The points c with |c - a| = |c - b| form the line n . c = k.
            let n = (b.0 - a.0, b.1 - a.1);
            let k = (b.0 * b.0 + b.1 * b.1 - a.0 * a.0 - a.1 * a.1) / 2.0;
            if n.1.abs() > 1e-12 {
                candidates.extend([from_m, to_m].map(|x| (x, (k - n.0 * x) / n.1)));
            }
            for c in images.iter().skip(j + 1) {
                let m = (c.0 - a.0, c.1 - a.1);
                let l = (c.0 * c.0 + c.1 * c.1 - a.0 * a.0 - a.1 * a.1) / 2.0;
                let det = n.0 * m.1 - n.1 * m.0;
                if det.abs() > 1e-12 {
                    candidates.push(((k * m.1 - n.1 * l) / det, (n.0 * l - k * m.0) / det));
                }
            }
        }
    }
    let f = |place: &(f64, f64)| {
        images.iter().map(|s| math::hypot(s.0 - place.0, s.1 - place.1)).fold(f64::INFINITY, f64::min)
    };
    let inside = |place: &&(f64, f64)| {
        place.0 >= from_m - 1e-12 && place.0 <= to_m + 1e-12 && (0.0..perimeter_m).contains(&place.1)
    };
    2.0 * candidates.iter().filter(inside).map(f).fold(0.0, f64::max)
}

proptest! {
    #[test]
    fn hole_of_scattered_samples_equals_a_brute_force_search(
        samples in proptest::collection::vec((-2.0f64..3.0, 0.0f64..PERIMETER_M), 1..14),
    ) {
        let hole = largest(PERIMETER_M, &samples, 0.0, 0.5);
        let expected = brute_force(PERIMETER_M, &samples, 0.0, 0.5);
        prop_assert!((hole.diameter_m - expected).abs() < 1e-9, "{} and {}", hole.diameter_m, expected);
        let at_centre = 2.0 * nearest_m(PERIMETER_M, &samples, (hole.x_m, hole.arc_m));
        prop_assert!((at_centre - hole.diameter_m).abs() < 1e-9, "the stated centre has the stated distance");
        prop_assert!(hole.least_m <= hole.diameter_m && hole.most_m - hole.least_m < 1e-9, "{:?}", hole);
    }

    /// The reference for the nearest-sample search in a window is brute force.
    #[test]
    fn window_search_finds_the_nearest_sample(
        samples in proptest::collection::vec((-3.0f64..4.0, 0.0f64..PERIMETER_M), 0..60),
        place in (0.0f64..1.0, -8.0f64..16.0),
        within_m in 0.05f64..3.0,
        cell_m in 0.05f64..1.0,
    ) {
        let mut window = Window::default();
        window.fill((&store(PERIMETER_M, &samples), 0), 0.0, (-3.0, 4.0), cell_m);
        let expected = Some(nearest_m(PERIMETER_M, &samples, place)).filter(|d| *d <= within_m);
        let found = window.nearest(WallPoint { x_m: place.0, arc_m: place.1 }, within_m);
        match (found, expected) {
            (Some(found), Some(expected)) => {
                prop_assert!((math::sqrt(found.distance2) - expected).abs() < 1e-12);
                let image_m = found.arc_m + found.turns * PERIMETER_M - place.1;
                let by_image_m = math::hypot(found.x_m - place.0, image_m);
                prop_assert!((by_image_m - expected).abs() < 1e-12, "the image must be the near one");
            }
            (found, expected) => prop_assert_eq!(found.is_some(), expected.is_some()),
        }
    }

    /// A search with a tolerance finds bounds that enclose the exact diameter D, and are at most the tolerance apart.
    ///
    /// The verdict from these bounds equals the verdict from the exact D. It is undecided if the target T lies between
    /// them.
    #[test]
    fn bounds_of_a_search_with_tolerance_contain_the_exact_diameter(
        samples in proptest::collection::vec((-2.0f64..3.0, 0.0f64..PERIMETER_M), 1..14),
        tolerance_m in 0.0f64..0.5,
        target_m in 0.1f64..6.0,
    ) {
        let expected = brute_force(PERIMETER_M, &samples, 0.0, 0.5);
        let hole = HoleFinder::new(tolerance_m).largest(&store(PERIMETER_M, &samples), 0.0, 0.5);
        prop_assert!(hole.least_m <= expected + 1e-9 && expected <= hole.most_m + 1e-9, "{:?}, {}", hole, expected);
        prop_assert!(hole.most_m - hole.least_m <= tolerance_m + 1e-9);
        let said = (hole.most_m <= target_m, hole.least_m > target_m);
        if (expected - target_m).abs() > tolerance_m + 1e-9 {
            prop_assert_eq!(said, (expected <= target_m, expected > target_m));
        } else {
            prop_assert!(said == (false, false) || said == (expected <= target_m, expected > target_m));
        }
    }

    /// For packed samples, the bounds also include the displacement by packing.
    #[test]
    fn bounds_with_packed_samples_contain_the_exact_diameter(
        samples in proptest::collection::vec((-2.0f64..3.0, 0.0f64..PERIMETER_M), 1..14),
    ) {
        let layout = StoreLayout { perimeter_m: PERIMETER_M, from_m: -20.0, to_m: 340.0, cell_m: 0.4, capacity: 1000 };
        let mut store = SampleStore::new(layout);
        let far = (0..120).map(|k| (339.0 - 1.7 * f64::from(k), 0.0));
        for (x_m, arc_m) in samples.iter().copied().chain(far) {
            store.insert(WallSample { x_m, arc_m, head: 0, step_m: None, visit: 0 }).unwrap();
        }
        let expected = brute_force(PERIMETER_M, &samples, 0.0, 0.5);
        let hole = HoleFinder::default().largest(&store, 0.0, 0.5);
        prop_assert!(hole.least_m <= expected && expected <= hole.most_m, "{:?} and {}", hole, expected);
        let width_m = hole.most_m - hole.least_m;
        prop_assert!(width_m > 0.0 && width_m < 1e-4, "{:?}", hole);
    }

    /// The bounds also hold for a cell that is so full that its samples were thinned.
    #[test]
    fn bounds_with_thinned_samples_contain_the_exact_diameter(
        crowd in proptest::collection::vec((0.0f64..0.4, 4.0f64..4.4), 200..500),
    ) {
        let mut samples: Vec<_> = crowd.into_iter().filter(|s| s.1 < 4.15 || s.1 > 4.25).collect();
        // The crowded cell has a gap. Everywhere else, samples are closer together than this gap, so the largest hole
        // is in that cell.
        let fence = (-6..=14).flat_map(|i| (0..180).map(move |k| (f64::from(i) * 0.05, f64::from(k) * 0.05)));
        samples.extend(fence.filter(|s| !(4.0..4.4).contains(&s.1)));
        let thinned = store(PERIMETER_M, &samples);
        prop_assume!(thinned.usage().thinned > 0);
        let hole = HoleFinder::default().largest(&thinned, 0.1, 0.3);
        let fine = StoreLayout { perimeter_m: PERIMETER_M, from_m: -1.0, to_m: 1.0, cell_m: 0.05, capacity: 100_000 };
        let mut all = SampleStore::new(fine);
        for (x_m, arc_m) in &samples {
            let kept = all.insert(WallSample { x_m: *x_m, arc_m: *arc_m, head: 0, step_m: None, visit: 0 });
            prop_assume!(kept == Ok(Kept::Stored));
        }
        let exact = HoleFinder::default().largest(&all, 0.1, 0.3);
        prop_assert!(hole.least_m < hole.diameter_m && hole.most_m - hole.diameter_m < 1e-9);
        prop_assert!(
            hole.least_m <= exact.diameter_m && exact.diameter_m <= hole.most_m + 1e-12,
            "{:?} {:?}", hole, exact
        );
    }

    /// In a small pipe, holes are wider than the perimeter.
    #[test]
    fn hole_wider_than_the_perimeter_agrees_with_brute_force(
        samples in proptest::collection::vec((-2.0f64..3.0, 0.0f64..1.1), 1..10),
    ) {
        let hole = largest(1.1, &samples, 0.0, 0.5);
        let expected = brute_force(1.1, &samples, 0.0, 0.5);
        prop_assert!((hole.diameter_m - expected).abs() < 1e-9, "{} and {}", hole.diameter_m, expected);
    }

    /// On a lattice, the centre of every hole is equidistant from four samples.
    #[test]
    fn lattice_hole_is_as_wide_as_the_lattice_diagonal(dx in 0.11f64..0.7, around in 6u32..24, shift in 0.0f64..1.0) {
        let darc = PERIMETER_M / f64::from(around);
        let mut samples = Vec::new();
        for i in -12..=12 {
            for k in 0..around {
                samples.push((f64::from(i) * dx + shift, f64::from(k) * darc));
            }
        }
        let expected = (dx * dx + darc * darc).sqrt();
        // A section longer than the lattice step contains the centre of a lattice cell.
        let hole = largest(PERIMETER_M, &samples, 0.0, dx * 1.01);
        prop_assert!((hole.diameter_m - expected).abs() < 1e-9, "{} and {}", hole.diameter_m, expected);
    }

    /// The diameter D depends neither on the order of the samples, nor on the seam of the unrolled wall, nor on the
    /// chainage's origin.
    #[test]
    fn hole_is_independent_of_sample_order_seam_and_chainage_origin(
        samples in proptest::collection::vec((-2.0f64..3.0, 0.0f64..PERIMETER_M), 1..30),
        turn in 0.0f64..PERIMETER_M,
    ) {
        let plain = largest(PERIMETER_M, &samples, 0.0, 0.5).diameter_m;
        let turned: Vec<_> = samples.iter().map(|s| (s.0, (s.1 + turn) % PERIMETER_M)).collect();
        let mirrored: Vec<_> = samples.iter().map(|s| (0.5 - s.0, PERIMETER_M - s.1)).collect();
        let reversed: Vec<_> = samples.iter().rev().copied().collect();
        for (what, other) in [("turned", turned), ("mirrored", mirrored), ("reversed", reversed)] {
            let got = largest(PERIMETER_M, &other, 0.0, 0.5).diameter_m;
            prop_assert!((got - plain).abs() < 1e-9, "{}: {} and {}", what, got, plain);
        }
    }
}

#[test]
fn hole_is_unbounded_if_no_sample_is_within_the_search_radius() {
    let empty = largest(PERIMETER_M, &[], 0.0, 0.25);
    assert!(!empty.bounded);
    let far = largest(PERIMETER_M, &[(35.0, 1.0)], 0.0, 0.25);
    assert!(!far.bounded && far.diameter_m >= 2.0 * FARTHEST_M);
}

#[test]
fn hole_of_a_single_sample_is_on_the_opposite_wall() {
    let hole = largest(PERIMETER_M, &[(0.0, 1.0)], 0.0, 0.25);
    let expected = 2.0 * math::hypot(0.25, PERIMETER_M / 2.0);
    assert!((hole.diameter_m - expected).abs() < 1e-9, "{hole:?}");
    assert!((hole.arc_m - 5.5).abs() < 1e-6, "{hole:?}");
}

#[test]
fn hole_of_collinear_repeated_and_coincident_samples_is_correct() {
    let line: Vec<_> = (0..90).map(|i| (0.1, f64::from(i) * 0.1)).collect();
    let expected = brute_force(PERIMETER_M, &line[..20], 0.0, 0.25);
    let hole = largest(PERIMETER_M, &line[..20], 0.0, 0.25);
    found("holes.line", (hole.diameter_m - expected).abs(), 1e-9);
    let repeated: Vec<_> = (0..50).flat_map(|_| line.clone()).collect();
    let once = largest(PERIMETER_M, &line, 0.0, 0.25);
    let many = largest(PERIMETER_M, &repeated, 0.0, 0.25);
    assert!((once.diameter_m - many.diameter_m).abs() < 1e-9);
    let one_place = largest(PERIMETER_M, &[(0.0, 1.0); 33], 0.0, 0.25);
    found("holes.one_place", (one_place.diameter_m - 2.0 * math::hypot(0.25, PERIMETER_M / 2.0)).abs(), 1e-9);
}

#[test]
fn hole_of_samples_with_nanometre_and_metre_spacings_is_correct() {
    let mut samples: Vec<_> = (0..20).map(|i| (f64::from(i) * 1e-9, 3.0 + f64::from(i % 3) * 1e-9)).collect();
    samples.extend([(0.3, 6.0), (-0.4, 0.5), (0.2, 8.0)]);
    let few = [(0.0, 3.0), (0.3, 6.0), (-0.4, 0.5), (0.2, 8.0)];
    let hole = largest(PERIMETER_M, &samples, 0.0, 0.25);
    let expected = brute_force(PERIMETER_M, &few, 0.0, 0.25);
    // Samples a nanometre apart count as one sample in the expected value.
    found("holes.spacings", (hole.diameter_m - expected).abs(), 1e-7);
}

/// Far along the tunnel, D is the same except for the floating-point precision of the chainage there.
#[test]
fn hole_is_the_same_at_7_km_and_at_1000_km() {
    let samples: Vec<_> =
        (0..60).map(|i| (f64::from(i) * 0.05 - 1.0, (f64::from(i) * 2.3) % PERIMETER_M)).collect();
    let near = largest(PERIMETER_M, &samples, 0.0, 0.25).diameter_m;
    for (name, chainage, error) in [("holes.7_km", 7_000.0, 1e-9), ("holes.1000_km", 1e6, 1e-8)] {
        let layout = StoreLayout {
            perimeter_m: PERIMETER_M,
            from_m: chainage - 5.0,
            to_m: chainage + 5.0,
            cell_m: 0.4,
            capacity: 100,
        };
        let mut store = SampleStore::new(layout);
        for (x_m, arc_m) in &samples {
            store
                .insert(WallSample { x_m: x_m + chainage, arc_m: *arc_m, head: 0, step_m: None, visit: 0 })
                .unwrap();
        }
        let hole = HoleFinder::default().largest(&store, chainage, chainage + 0.25);
        found(name, (hole.diameter_m - near).abs(), error);
    }
}

/// The reference values are for `ceran` at 0.197 m/s, with heads in phase shift at the circle's centre.
///
/// The samples have positions only, and no steps.
#[test]
fn largest_holes_of_ideal_helices_match_reference_values() {
    let profile = headrace_geometry::tunnel::shapes::ceran().unwrap();
    let perimeter_m = profile.perimeter_m();
    let modes = [
        ("SLOW", 1200, 21.6, [4.248, 2.125, 1.064]),
        ("MEDIUM", 600, 10.8, [2.128, 1.067, 0.542]),
        ("FAST", 400, 8.0, [1.582, 0.803, 0.427]),
        ("FASTER", 300, 6.6, [1.317, 0.687, 0.397]),
        ("FASTEST", 150, 4.8, [1.030, 0.630, 0.452]),
    ];
    for (mode, steps, turn_s, expected) in modes {
        for (heads, expected) in [1_u32, 2, 4].into_iter().zip(expected) {
            let layout =
                StoreLayout { perimeter_m, from_m: 0.0, to_m: 24.0, cell_m: 0.25, capacity: 100_000 };
            let mut store = SampleStore::new(layout);
            let per_ping_m = 0.197 * turn_s / f64::from(steps);
            for ping in 0..math::floor_to_i64(23.0 / per_ping_m) {
                for head in 0..heads {
                    let angle =
                        math::TAU * (ping as f64 / f64::from(steps) + f64::from(head) / f64::from(heads));
                    let hit =
                        profile.cast(profile.reference(), [math::sin(angle), -math::cos(angle)]).unwrap();
                    let (x_m, arc_m, head) = (ping as f64 * per_ping_m, hit.arc_m, head as usize);
                    store.insert(WallSample { x_m, arc_m, head, step_m: None, visit: 0 }).unwrap();
                }
            }
            let mut finder = HoleFinder::default();
            let holes = (0..36).map(|k| 7.0 + 0.25 * f64::from(k));
            let d = holes.map(|x| finder.largest(&store, x, x + 0.25).diameter_m).fold(0.0, f64::max);
            assert!((d / expected - 1.0).abs() < 2e-3, "{mode} x {heads}: {d} and {expected}");
        }
    }
}

#[test]
fn samples_of_visits_before_the_requested_visit_are_ignored() {
    let grid = |off_m: f64| {
        (0..60).flat_map(move |i| {
            (0..20).map(move |k| (f64::from(i) * 0.1 + off_m, f64::from(k) * PERIMETER_M / 20.0))
        })
    };
    let mut store = store(PERIMETER_M, &[]);
    for (visit, off_m) in [(3, 0.0), (4, 0.05)] {
        for (x_m, arc_m) in grid(off_m) {
            store.insert(WallSample { x_m, arc_m, head: 0, step_m: None, visit }).unwrap();
        }
    }
    let mut finder = HoleFinder::default();
    let mut since = |visit: u32| finder.largest_since(&store, 2.0, 3.0, visit);
    let [both, later, none] = [3, 4, 5].map(&mut since);
    assert!(both.diameter_m < later.diameter_m, "{both:?} {later:?}");
    assert!((later.diameter_m - math::hypot(0.1, PERIMETER_M / 20.0)).abs() < 1e-9, "{later:?}");
    assert!(!none.bounded);
}

/// A hole that has grown, moved along or around the tunnel, or become unbounded is a different hole.
#[test]
fn holes_count_as_equal_if_size_and_position_differ_by_under_1_cm() {
    let hole = Hole { diameter_m: 0.6, least_m: 0.6, most_m: 0.6, x_m: 7.0, arc_m: 3.0, bounded: true };
    let little = Hole { diameter_m: 0.609, x_m: 6.991, arc_m: 3.009, ..hole };
    assert!(hole.is_like(&little) && little.is_like(&hole));
    for other in [
        Hole { diameter_m: 0.62, ..hole },
        Hole { x_m: 7.02, ..hole },
        Hole { arc_m: 2.98, ..hole },
        Hole { bounded: false, ..hole },
    ] {
        assert!(!hole.is_like(&other) && !other.is_like(&hole), "{other:?}");
    }
}
