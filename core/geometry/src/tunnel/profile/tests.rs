use proptest::prelude::*;

use super::*;

/// A star-shaped polygon of so many points, with radii of its own.
fn polygon(radii: &[f64]) -> Profile {
    let count = radii.len() as f64;
    let points = radii.iter().enumerate().map(|(k, radius_m)| {
        let (sin, cos) = math::sin_cos(TAU * k as f64 / count);
        [radius_m * cos, 3.0 + radius_m * sin]
    });
    Profile::polygon(&points.collect::<Vec<_>>(), Some([0.0, 3.0])).unwrap()
}

/// The same curve without a tree.
fn plain(profile: &Profile) -> Profile {
    Profile { tree: Tree::default(), support: None, ..profile.clone() }
}

proptest! {
    /// What is asked of a profile with a tree has the same answer, to the bit, as without; rays go through vertices, too.
    #[test]
    fn a_tree_changes_no_answer(
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
    /// The table's bounds hold. How near they are is geometry: the farthest point is at most half a step off a direction of the table, and
    /// tangents in two neighbouring directions meet above the edge between their points by at most half that edge times the tangent of half
    /// a step. No edge of the hull is longer here than a chord of 2.2 m that passes 1.8 m from the centre.
    #[test]
    fn bounds_of_many_points_are_just_above_what_they_bound(
        radii in prop::collection::vec(prop_oneof![9 => 1.8..2.2_f64, 1 => Just(1.8)], 257..600),
        level in prop::option::of(0usize..32),
        at in (-1.0..1.0_f64, 2.0..4.0_f64),
        turns in 0.0..1.0_f64,
    ) {
        // Few points of many stand out: edges of the hull become long.
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

/// A regular polygon's centre is equally far from all edges: the first along the wall is nearest, with a tree, too.
#[test]
fn of_equally_near_elements_the_first_is_taken() {
    let tree = polygon(&[2.0; 96]);
    assert_eq!(tree.nearest([0.0, 3.0]), plain(&tree).nearest([0.0, 3.0]));
}

/// A survey's 100,000 points: each question looks at few of them. Counted, not timed.
#[test]
fn of_many_elements_few_are_looked_at() {
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
    assert!(looked / 100 < 100, "{} elements a ray", looked / 100);
}

#[test]
fn a_refused_polygon_names_the_point_as_it_was_given() {
    // A hook on the left wall, its edges backwards after the fourth point, however the points are counted.
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
        // Repeated points count in the file.
        let repeated: Vec<Yz> = turned.iter().flat_map(|point| [*point, *point]).collect();
        assert_eq!(refused(&repeated), 2, "from {first}");
        // The other way round the same edge begins at its other end, or is read from it.
        turned.reverse();
        assert!([2, 3].contains(&refused(&turned)), "from {first}");
    }
}

#[test]
fn a_polygon_beside_the_middle_is_refused_for_that() {
    let beside = [[1.0, 0.0], [3.0, 0.0], [3.0, 2.0], [1.0, 2.0]];
    assert_eq!(Profile::polygon(&beside, None), Err(ProfileError::BesideMiddle));
}
