use proptest::prelude::*;

use super::*;

/// A star-shaped polygon whose vertices have these distances from the centre.
fn polygon(radii: &[f64]) -> Profile {
    let count = radii.len() as f64;
    let points = radii.iter().enumerate().map(|(k, radius_m)| {
        let (sin, cos) = math::sin_cos(TAU * k as f64 / count);
        [radius_m * cos, 3.0 + radius_m * sin]
    });
    Profile::polygon(&points.collect::<Vec<_>>(), Some([0.0, 3.0])).unwrap()
}

/// Returns the same profile without its search tree.
fn plain(profile: &Profile) -> Profile {
    Profile { tree: Tree::default(), support: None, ..profile.clone() }
}

proptest! {
    /// The results are bit-identical, even for rays through vertices.
    #[test]
    fn profile_queries_give_equal_results_with_and_without_a_search_tree(
        radii in prop::collection::vec(1.8..2.2_f64, 25..400),
        at in (-1.0..1.0_f64, 2.0..4.0_f64),
        turns in 0.0..1.0_f64,
        vertex in 0usize..25,
    ) {
        let tree = polygon(&radii);
        let plain = plain(&tree);
        prop_assert!(tree.tree != plain.tree);
        let origin = [at.0, at.1];
        let (sin, cos) = math::sin_cos(turns * TAU);
        let corner = tree.elements[vertex].start;
        let axis = [[1.0, 0.0], [0.0, -1.0]][vertex % 2];
        for direction in [[cos, sin], [1e-6 * cos, 1e-6 * sin], sub(corner, origin), axis] {
            let (ours, theirs) = (tree.cast(origin, direction), plain.cast(origin, direction));
            prop_assert_eq!(ours, theirs);
            prop_assert!(ours.is_some());
        }
        for point in [origin, corner, [at.0 * 9.0, at.1 * 9.0], [0.0, 3.0]] {
            prop_assert_eq!(tree.nearest(point), plain.nearest(point));
        }
    }
}

proptest! {
    /// Distances never exceed the bounds from the table of extents, and the bounds exceed the distances only a little.
    ///
    /// The direction of the farthest point differs from a direction of the table by at most half an angular step. The
    /// tangents in two neighbouring directions touch the hull at two points, and meet beyond the edge between them.
    /// They meet at most half the edge's length times tan(half a step) away from the edge. The longest edge of the hull
    /// in this test is a chord that passes 1.8 m from the centre, with its ends at 2.2 m.
    #[test]
    fn precomputed_distance_bounds_exceed_the_exact_values_by_a_limited_amount(
        radii in prop::collection::vec(prop_oneof![9 => 1.8..2.2_f64, 1 => Just(1.8)], 257..600),
        level in prop::option::of(0usize..32),
        at in (-1.0..1.0_f64, 2.0..4.0_f64),
        turns in 0.0..1.0_f64,
    ) {
        // With a level, one point in 32 is much farther from the centre than the others. Then the hull has long edges.
        let radii: Vec<f64> = match level {
            Some(of_32) => radii.iter().enumerate().map(|(k, r)| if k % 32 == of_32 { *r } else { 1.8 }).collect(),
            None => radii,
        };
        let table = polygon(&radii);
        let exact = plain(&table);
        let origin = [at.0, at.1];
        let (sin, cos) = math::sin_cos(turns * TAU);
        let (half_step_sin, half_step_cos) = math::sin_cos(TAU / 2.0 / 128.0);
        let nearest_m = 1.8 * math::cos(TAU / 2.0 / 257.0);
        let edge_m = 2.0 * math::sqrt(2.2 * 2.2 - nearest_m * nearest_m);
        let (farthest_m, along_m) = (exact.farthest_m(origin), exact.farthest_along_m(origin, [cos, sin]));
        for (bound_m, exact_m, above_m) in [
            (table.farthest_m(origin), farthest_m, farthest_m * (1.0 / half_step_cos - 1.0)),
            (table.farthest_along_m(origin, [cos, sin]), along_m, edge_m / 2.0 * half_step_sin / half_step_cos),
        ] {
            let bounds = exact_m - 1e-9..=exact_m + above_m + 1e-9;
            prop_assert!(bounds.contains(&bound_m), "{} {} {}", bound_m, exact_m, above_m);
        }
    }
}

/// The centre of a regular polygon is equally far from all edges.
#[test]
fn search_tree_returns_the_same_element_of_equally_near_ones_as_a_full_search() {
    let tree = polygon(&[2.0; 96]);
    assert_eq!(tree.nearest([0.0, 3.0]), plain(&tree).nearest([0.0, 3.0]));
}

/// A query visits few of the profile's 100,000 elements. The test counts visits instead of measuring time.
#[test]
fn profile_query_visits_few_of_many_elements() {
    let radii: Vec<f64> = (0..100_000).map(|k| 2.0 + 0.01 * math::sin(f64::from(k) * 0.37)).collect();
    let profile = polygon(&radii);
    let mut looked = 0;
    for k in 0..100 {
        let (sin, cos) = math::sin_cos(f64::from(k));
        let (origin, direction) = ([0.3, 2.7], [cos, sin]);
        let mut best = f64::INFINITY;
        profile.tree.search(
            profile.elements.len(),
            |bounds| bounds.entry(origin, direction),
            |some| {
                looked += some.len();
                let some =
                    profile.elements[some].iter().filter_map(|element| element.crossing(origin, direction));
                best = some.fold(best, f64::min);
                best
            },
        );
        assert!(best.is_finite());
    }
    assert!(looked / 100 < 100, "{} elements per ray", looked / 100);
}

#[test]
fn error_of_a_rejected_polygon_names_the_input_point() {
    // The left wall has a hook. Its edges run backwards after the fourth point, whichever point is the first.
    let hooked = [[3.0, 0.0], [3.0, 4.0], [2.9, 4.0], [2.9, 0.5], [-3.0, 0.5], [-3.0, 0.0]];
    let refused = |points: &[Yz]| match Profile::polygon(points, Some([0.0, 0.2])) {
        Err(ProfileError::NotStarShaped { vertex, .. }) => {
            hooked.iter().position(|point| norm(sub(*point, points[vertex])) == 0.0).unwrap()
        }
        other => panic!("{other:?}"),
    };
    for first in 0..hooked.len() {
        let mut turned = hooked;
        turned.rotate_left(first);
        assert_eq!(refused(&turned), 2, "from {first}");
        // If each point is repeated, the error still gives the index in the input.
        let repeated: Vec<Yz> = turned.iter().flat_map(|point| [*point, *point]).collect();
        assert_eq!(refused(&repeated), 2, "from {first}");
        // If the order of the points is reversed, the offending edge begins at its other end.
        turned.reverse();
        assert!([2, 3].contains(&refused(&turned)), "from {first}");
    }
}

#[test]
fn polygon_on_one_side_of_y_0_is_rejected() {
    let beside = [[1.0, 0.0], [3.0, 0.0], [3.0, 2.0], [1.0, 2.0]];
    assert_eq!(Profile::polygon(&beside, None), Err(ProfileError::BesideMiddle));
}
