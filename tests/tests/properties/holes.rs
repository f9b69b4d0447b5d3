//! The largest hole of random arrangements of samples, compared with the Voronoi vertices of all samples.

use headrace_coverage::{HoleFinder, SampleStore, StoreLayout, WallSample};
use headrace_oracle::wall::Wall;

use crate::cases::{Case, few, many};

/// Draws samples on the wall. They are at random places, on a lattice, on a line, all at one place, partly coincident,
/// or closer together than the samples of any vehicle.
fn samples(case: &mut Case, perimeter_m: f64) -> Vec<[f64; 2]> {
    let count = 1 + case.below(24);
    let kind = case.below(7);
    let pitch = [case.between(0.1, 0.6), perimeter_m / (2 + case.below(8)) as f64];
    let fixed = [case.between(-1.0, 1.0), case.between(0.0, perimeter_m)];
    let mut found: Vec<[f64; 2]> = Vec::new();
    for k in 0..count {
        let free = [case.between(-2.0, 2.5), case.between(0.0, perimeter_m)];
        let cell = [(k % 5) as f64 - 2.0, (k / 5) as f64];
        found.push(match kind {
            0 => [cell[0] * pitch[0], cell[1] * pitch[1] % perimeter_m],
            1 => [fixed[0], free[1]],
            2 => [free[0], fixed[1]],
            3 => fixed,
            4 if !found.is_empty() => {
                let near = found[case.below(found.len())];
                let off = case.power_of_ten(-12.0, -3.0);
                [near[0] + off, (near[1] + off * case.unit()).min(perimeter_m.next_down())]
            }
            5 => [(free[0] * 8.0).round() / 8.0, (free[1] / perimeter_m * 16.0).floor() / 16.0 * perimeter_m],
            _ => free,
        });
    }
    if case.below(4) == 0 {
        found.reverse();
    }
    found
}

fn hole(case: &mut Case) -> Result<(), String> {
    let perimeter_m = if case.below(5) == 0 { case.between(0.3, 1.5) } else { case.between(3.0, 12.0) };
    let along_m = [0.0, 16.0, 7e3, 1e6][case.below(4)];
    let samples = samples(case, perimeter_m);
    let from_m = case.between(-1.0, 1.0);
    let to_m = from_m + [0.05, 0.25, 1.0][case.below(3)];
    let layout = StoreLayout {
        perimeter_m,
        from_m: along_m - 4.0,
        to_m: along_m + 4.0,
        cell_m: case.between(0.1, 0.8),
        capacity: 64,
    };
    let mut store = SampleStore::new(layout);
    for (k, [x_m, arc_m]) in samples.iter().enumerate() {
        let sample = WallSample { x_m: x_m + along_m, arc_m: *arc_m, head: k % 3, step_m: None, visit: 0 };
        store.insert(sample).map_err(|why| format!("{why:?} at {x_m} {arc_m}"))?;
    }
    let hole = HoleFinder::default().largest(&store, from_m + along_m, to_m + along_m);
    let numbers = [hole.diameter_m, hole.least_m, hole.x_m, hole.arc_m];
    if !numbers.iter().all(|number| number.is_finite()) {
        return Err(format!("{hole:?}"));
    }
    // At a large chainage, the positions of samples are rounded. The oracle therefore gets the rounded positions.
    let wall = Wall::new(samples.iter().map(|[x_m, arc_m]| [(x_m + along_m) - along_m, *arc_m]), perimeter_m)
        .map_err(|why| why.to_string())?;
    let ends = [(from_m + along_m) - along_m, (to_m + along_m) - along_m];
    let largest = wall.largest(ends[0], ends[1]).ok_or("the oracle has no circle")?;
    let expected_m = 2.0 * largest.radius_m;
    let allowed_m = 1e-7 + along_m * 1e-14;
    if hole.bounded && (hole.diameter_m - expected_m).abs() > allowed_m {
        return Err(format!(
            "{hole:?}, expected {expected_m} about {:?}: {samples:?}, {ends:?}, {perimeter_m}",
            largest.centre
        ));
    }
    if !hole.bounded && hole.diameter_m > expected_m + allowed_m {
        return Err(format!("{hole:?}, unbounded, and {expected_m}"));
    }
    if !(hole.least_m <= hole.diameter_m + 1e-12 && hole.diameter_m <= hole.most_m + 1e-12) {
        return Err(format!("bounds: {hole:?}"));
    }
    Ok(())
}

#[test]
fn holes_match_the_voronoi_diagram() {
    few("holes", &hole);
}

#[test]
#[ignore = "long; see the module's description"]
fn holes_match_the_voronoi_diagram_in_a_long_run() {
    many("holes", &hole);
}
