//! Tests tracks at the seam, and beams. The figures of whole dives are tested with their drawings.

use super::*;

#[test]
fn track_over_the_seam_is_split_in_two() {
    let mut ways = Vec::new();
    for (from, to) in [([0.0, 8.0], [1.0, 9.0]), ([1.0, 9.0], [3.0, 1.0]), ([3.0, 1.0], [4.0, 2.0])] {
        add_step(&mut ways, 3, 10.0, from, to);
    }
    let expected = [vec![[0.0, 8.0], [1.0, 9.0], [2.0, 10.0]], vec![[2.0, 0.0], [3.0, 1.0], [4.0, 2.0]]];
    assert_eq!(ways.iter().map(|way| way.points.clone()).collect::<Vec<_>>(), expected);
    assert!(ways.iter().all(|way| way.head == 3));
}

/// Compares the simulator's cone with the paper's formula, computed independently.
#[test]
fn simulated_beam_footprints_match_the_paper_formula() {
    let figure = footprints().unwrap();
    assert!((figure.corner_deg - 59.27).abs() < 0.05, "{}", figure.corner_deg);
    for footprint in figure.by_range.iter().chain(&figure.by_angle) {
        assert!(footprint.simulated.len() >= 10);
        for [at, rays_m] in &footprint.simulated {
            let formula = footprint.points.iter().find(|[x, _]| (x - at).abs() < 1e-12).unwrap();
            assert!((rays_m / formula[1] - 1.0).abs() < 1e-9, "{footprint:?}");
        }
        assert!(footprint.points.windows(2).all(|pair| pair[0][1] < pair[1][1]));
    }
    // The paper states "up to around 25 cm" at 10 m.
    assert!((figure.by_range[0].points.last().unwrap()[1] - 0.2444).abs() < 1e-4);
}
