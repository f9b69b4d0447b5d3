//! Checks holes, spacings and verdicts of two hundred short dives against an oracle, which is an independent
//! computation.
//!
//! The oracle uses only the samples and the definitions. It has no cells, no search radius, and no order of judging.
//! Flags are checked in `flags.rs`.

use headrace_coverage::{Unsure, Verdict};
use std::collections::BTreeMap;

use headrace_geometry::math::{self, TAU};
use headrace_geometry::time::MonoNs;
use headrace_monitor::report::SpreadReport;
use headrace_monitor::section_row::SectionRow;
use headrace_oracle::wall::{Place, Wall};
use headrace_tests::flags::{NEAR_M, PARTS, all_passed_from_m, first_failing_m, reached};
use headrace_tests::instrumented::{Dive, Ping, Sample};
use headrace_tests::random_dives::Draw;
use headrace_tests::spacings::{Spacing, spacings, spread};

use crate::dives::DIVES;

const TOLERANCE_M: f64 = 1e-9;
/// Limit of the search for holes, m. The report calls larger holes unbounded.
const SEARCH_M: f64 = 12.0;

/// Checks every section of every dive with `misses`, which may return the description of an error.
#[track_caller]
fn every_section(mut misses: impl FnMut(&Dive, &Wall, &SectionRow) -> Option<String>) {
    let mut said = Vec::new();
    for (seeded, dive) in DIVES.iter() {
        let wall = Wall::new(dive.samples().map(|sample| sample.place), dive.profile.perimeter_m()).unwrap();
        for section in &dive.report.sections {
            let miss = misses(dive, &wall, section);
            said.extend(miss.map(|miss| {
                format!("seed {} ({:?}), section {}: {miss}", seeded.seed, seeded.kind, section.start_m)
            }));
        }
    }
    assert!(said.is_empty(), "{} sections: {:#?}", said.len(), &said[..said.len().min(10)]);
}

#[test]
fn random_dives_cover_every_verdict() {
    let mut count = BTreeMap::new();
    for (seeded, dive) in DIVES.iter() {
        for section in &dive.report.sections {
            *count.entry((seeded.kind, section.verdict.as_str())).or_insert(0) += 1;
        }
    }
    for (verdict, least) in [(Verdict::Pass, 200), (Verdict::Fail, 1000), (Verdict::CannotSay, 50)] {
        let all: u32 = count.iter().filter(|((_, v), _)| *v == verdict.as_str()).map(|(_, n)| n).sum();
        assert!(all >= least, "{verdict:?}: {all} sections of {count:?}");
    }
}

#[test]
fn sample_lies_on_the_design_wall_along_its_reference_ray() {
    for (seeded, dive) in DIVES.iter() {
        for Sample { place, point } in dive.samples() {
            let off_m = dive.profile.arc_of([point[1], point[2]]) - place[1];
            let off_m = math::wrap_signed(off_m, dive.profile.perimeter_m());
            assert!(off_m.abs() < TOLERANCE_M, "seed {}: {point:?} at {place:?}", seeded.seed);
            assert!(point[0].to_bits() == place[0].to_bits(), "seed {}: chainage", seeded.seed);
        }
    }
}

/// Whether a diameter, m, is within the bounds of a section's hole.
fn is_within(section: &SectionRow, diameter_m: f64) -> bool {
    let (Some(least_m), Some(most_m)) = (section.hole_least_m, section.hole_most_m) else { return false };
    (least_m - TOLERANCE_M..=most_m + TOLERANCE_M).contains(&diameter_m)
}

/// Whether a section passed and the diameter is at most the upper bound of the section's hole. The program may have
/// computed the bound from some visits of the vehicle only. The oracle uses the samples of all visits, which can only
/// make the hole smaller.
fn is_of_a_visit(section: &SectionRow, diameter_m: f64) -> bool {
    let most_m = section.hole_most_m.filter(|_| section.verdict == Verdict::Pass);
    most_m.is_some_and(|most_m| diameter_m <= most_m + TOLERANCE_M)
}

#[test]
fn holes_are_the_largest_empty_circles() {
    every_section(|_, wall, section| {
        let Some(hole_m) = section.hole_m else { return Some("not measured".to_owned()) };
        let largest = wall.largest(section.start_m, section.end_m)?;
        let expected_m = 2.0 * largest.radius_m;
        if largest.radius_m > SEARCH_M {
            let said = !section.hole_bounded
                && hole_m <= expected_m
                && [Verdict::Fail, Verdict::Open].contains(&section.verdict);
            return (!said).then(|| format!("{hole_m} m, bounded, not {expected_m} m"));
        }
        // The loop stores samples in packed form, which moves them by micrometres. The reported bounds of the hole
        // allow for this.
        let right =
            section.hole_bounded && (is_within(section, expected_m) || is_of_a_visit(section, expected_m));
        (!right).then(|| format!("{hole_m} m, not {expected_m} m about {:?}", largest.centre))
    });
}

#[test]
fn reported_hole_position_is_right() {
    every_section(|_, wall, section| {
        let centre = section.hole_x_m.zip(section.hole_arc_m).filter(|_| section.hole_bounded);
        let (x_m, arc_m) = centre?;
        let clear_m = 2.0 * wall.clear_m([x_m, arc_m]);
        let within = (section.start_m - TOLERANCE_M..=section.end_m + TOLERANCE_M).contains(&x_m);
        let right = within && (is_within(section, clear_m) || is_of_a_visit(section, clear_m));
        (!right).then(|| format!("{clear_m} m about {x_m}, {arc_m}, not {:?}", section.hole_m))
    });
}

#[test]
fn verdicts_follow_from_hole_size_its_sd_and_the_target() {
    every_section(|dive, wall, section| {
        let largest = wall.largest(section.start_m, section.end_m)?;
        let (hole_m, target_m, twice_m) =
            (2.0 * largest.radius_m, dive.report.target_m, 2.0 * section.hole_sd_m);
        // A section must stay open if driving on could still fill its hole.
        let reached = reached(dive);
        let (rear_m, passed_m) = (reached.last()?.rear_m, all_passed_from_m(&reached));
        let radius_m = f64::midpoint(target_m, twice_m);
        let ends = [section.start_m, section.end_m];
        let first_m = first_failing_m(wall, ends, radius_m, passed_m);
        // The stretch that all heads have passed starts at `passed_m`. If the first failing place changes when this
        // start moves by `NEAR_M`, the place counts as near the start.
        let late_m = first_failing_m(wall, ends, radius_m, passed_m + NEAR_M);
        let is_near = late_m != first_failing_m(wall, ends, radius_m, passed_m - NEAR_M);
        // Tolerance for differences between oracle and program. The oracle finds the first failing place to within one
        // part of the section ([`PARTS`]). The program uses the largest standard deviation round the wall, and computes
        // the reach of a tilted head from the farthest wall.
        let near_m = (section.end_m - section.start_m) / f64::from(PARTS) + 2.0 * section.hole_sd_m + 0.03;
        let clear_m = first_m.map_or(f64::NEG_INFINITY, |first_m| rear_m - first_m - radius_m);
        let behind_m = rear_m - largest.centre[0] - largest.radius_m;
        let from_end_m = largest.centre[0] - largest.radius_m - passed_m;
        let expected = match section.verdict {
            _ if hole_m + twice_m <= target_m => Verdict::Pass,
            either @ (Verdict::Fail | Verdict::Open) if clear_m.abs() <= near_m => either,
            either @ (Verdict::Fail | Verdict::CannotSay) if (hole_m - twice_m - target_m).abs() < 0.01 => {
                either
            }
            either @ (Verdict::Open | Verdict::CannotSay) if behind_m.abs() <= near_m => either,
            either @ (Verdict::Open | Verdict::CannotSay | Verdict::Fail)
                if from_end_m.abs() <= near_m || is_near =>
            {
                either
            }
            // The reason why a section is undecided may be doubtful returns, but the oracle knows only samples.
            either @ Verdict::CannotSay if section.cannot_say == Some(Unsure::DoubtfulReturns) => either,
            // A flagged section keeps the verdict "fail" until its hole is filled.
            either @ Verdict::Fail if section.flagged_s.is_some() && section.cleared_s.is_none() => either,
            _ if clear_m > 0.0 => Verdict::Fail,
            _ if behind_m < 0.0 || from_end_m < 0.0 => Verdict::Open,
            _ => Verdict::CannotSay,
        };
        (section.verdict != expected)
            .then(|| format!("{:?}, not {expected:?}: {hole_m} m, {twice_m} m", section.verdict))
    });
}

/// Describes how a reported spread differs from the spread of `values`; `None` if both match.
///
/// Variances are compared, because the standard deviation of equal values is the root of a rounding error.
fn differs(got: &SpreadReport, values: &[f64]) -> Option<String> {
    let expected = spread(values);
    let figures = [got.min_m, got.mean_m, got.max_m, got.sd_m.map(|sd_m| sd_m * sd_m)];
    let same = expected.map_or(got.count == 0, |expected| {
        let near = |(got, expected): (&Option<f64>, f64)| {
            got.is_some_and(|got| (got - expected).abs() <= TOLERANCE_M)
        };
        usize::try_from(got.count).unwrap() == values.len() && figures.iter().zip(expected).all(near)
    });
    (!same).then(|| format!("{got:?}, not {} of {expected:?}", values.len()))
}

/// Whether a section has samples that deviate from the design by more than a tenth of the radius.
///
/// A return that deviates so much is stored only after the next returns of its head. Until then, later samples of other
/// heads may be stored. These samples then count as earlier passes.
fn has_run(section: &SectionRow, perimeter_m: f64) -> bool {
    let extremes_m = section.deviation.map(|deviation| [deviation.inmost_m, deviation.outmost_m]);
    extremes_m.into_iter().flatten().any(|off_m| off_m.abs() > 0.1 * perimeter_m / TAU)
}

#[test]
fn spacings_of_every_section_match_their_definitions() {
    let (mut judged, mut sections, mut left_out) = (0, 0, 0);
    for (seeded, dive) in DIVES.iter() {
        let all = spacings(&dive.pings, dive.profile.perimeter_m());
        for section in &dive.report.sections {
            let within = |spacing: &&Spacing| (section.start_m..section.end_m).contains(&spacing.x_m);
            let here: Vec<&Spacing> = all.iter().filter(within).collect();
            let values = |of: &dyn Fn(&Spacing) -> Option<f64>| -> Vec<f64> {
                here.iter().filter_map(|spacing| of(spacing)).collect()
            };
            let at = format!("seed {} ({:?}), section {}", seeded.seed, seeded.kind, section.start_m);
            assert_eq!(usize::try_from(section.samples).unwrap(), here.len(), "{at}: samples");
            let miss = differs(&section.t_y, &values(&|spacing| spacing.t_y_m));
            assert!(miss.is_none(), "{at}: T_y {miss:?}");

            if has_run(section, dive.profile.perimeter_m()) {
                left_out += 1;
                continue;
            }
            let [fewest, most] = [0, 1].map(|k| values(&|spacing| spacing.t_x_m[k]));
            let count = usize::try_from(section.t_x.count).unwrap();
            assert!((fewest.len()..=most.len()).contains(&count), "{at}: {count} T_x");
            sections += 1;
            let same = |[a, b]: [Option<f64>; 2]| match (a, b) {
                (Some(a), Some(b)) => (a - b).abs() <= TOLERANCE_M,
                _ => a.is_none() && b.is_none(),
            };
            if here.iter().all(|spacing| same(spacing.t_x_m)) {
                judged += 1;
                let miss = differs(&section.t_x, &fewest);
                assert!(miss.is_none(), "{at}: T_x {miss:?}");
                let miss = differs(&section.t, &values(&|spacing| spacing.t_m[0]));
                assert!(miss.is_none(), "{at}: T {miss:?}");
            }
        }
    }
    println!("{left_out} sections with large deviations, {sections} without");
    assert!(10 * left_out < sections, "{left_out} sections with large deviations, {sections} without");
    assert!(10 * judged > 7 * sections, "{judged} of {sections} sections without end points of series");
}

// Samples in rows and columns, for tests of the oracle itself. `at` returns the place of a row and column.

fn lattice(rows: u32, columns: u32, at: impl Fn(f64, f64) -> Place) -> Vec<Place> {
    let row = |i| (0..columns).map(move |j| (f64::from(i), f64::from(j)));
    (0..rows).flat_map(row).map(|(i, j)| at(i, j)).collect()
}

#[track_caller]
fn holds(wall: &Wall, from_m: f64, to_m: f64, expected_m: f64) {
    let hole_m = 2.0 * wall.largest(from_m, to_m).unwrap().radius_m;
    assert!((hole_m - expected_m).abs() < 1e-12 * (1.0 + expected_m), "{hole_m}, not {expected_m}");
}

#[test]
fn holes_of_sample_lattices_match_exact_values() {
    let diagonal_m = math::sqrt(2.0);
    // The samples form squares with sides of 0.25 m, in which the four corners of each square lie on a common circle.
    // The second section contains no centre of a square.
    let squares = Wall::new(lattice(20, 24, |i, j| [0.25 * i, 0.25 * j]), 6.0).unwrap();
    holds(&squares, 1.0, 1.25, 0.25 * diagonal_m);
    holds(&squares, 1.0, 1.05, 2.0 * math::hypot(0.05, 0.125));
    // Every other row is offset by half a step, so that the samples form triangles with sides of 0.4 m.
    let height_m = 0.2 * math::sqrt(3.0);
    let triangles =
        Wall::new(lattice(20, 10, |i, j| [height_m * i, 0.4 * j + 0.2 * (i % 2.0)]), 4.0).unwrap();
    holds(&triangles, 1.0, 2.0, 0.8 / math::sqrt(3.0));
    // With a single ring of samples, the hole of a section grows with the section's distance from the ring.
    let ring = Wall::new(lattice(1, 10, |_, j| [0.0, 0.3 * j]), 3.0).unwrap();
    holds(&ring, 1.0, 2.0, 2.0 * math::hypot(2.0, 0.15));
    // With a single place of all samples, the centre of the hole is on the opposite side of the perimeter.
    let one = Wall::new(vec![[5.0, 0.0]; 7], 8.0).unwrap();
    holds(&one, 5.0, 8.0, 10.0);
    assert!(Wall::new(Vec::new(), 8.0).unwrap().largest(0.0, 1.0).is_none());
}

fn scattered(seed: u64, count: usize, perimeter_m: f64) -> Vec<Place> {
    let mut draw = Draw::new(seed);
    (0..count).map(|_| [draw.between(-0.4, 0.9), draw.between(0.0, perimeter_m)]).collect()
}

#[test]
fn holes_of_small_sample_sets_match_a_dense_grid_search() {
    let (perimeter_m, step_m) = (2.0, 0.004);
    for seed in 0..30 {
        let wall =
            Wall::new(scattered(seed, 1 + usize::try_from(seed).unwrap() % 9, perimeter_m), perimeter_m)
                .unwrap();
        let along = (0..=125).map(|i| f64::from(i) * step_m);
        let around = || (0..500).map(|j| f64::from(j) * step_m);
        let dense_m = along
            .flat_map(|x| around().map(move |sigma| [x, sigma]))
            .map(|at| wall.clear_m(at))
            .fold(0.0, f64::max);
        let exact = wall.largest(0.0, 0.5).unwrap();
        let short_m = exact.radius_m - dense_m;
        // From any point to the nearest grid point, the distance to the nearest sample changes by no more than the
        // distance between the point and the grid point.
        assert!((-1e-12..=step_m / math::sqrt(2.0)).contains(&short_m), "{seed}: {exact:?}, {dense_m}");
    }
}

#[test]
fn seam_position_does_not_change_holes() {
    let perimeter_m = 3.0;
    for seed in 0..20 {
        let samples = scattered(seed, 60, perimeter_m);
        let shift_m = 0.13 * seed as f64;
        let shifted = samples.iter().map(|[x, sigma]| [*x, math::wrap(sigma + shift_m, perimeter_m)]);
        let [here, there] =
            [Wall::new(samples.clone(), perimeter_m).unwrap(), Wall::new(shifted, perimeter_m).unwrap()];
        let holes = [here, there].map(|wall| wall.largest(0.0, 0.5).unwrap().radius_m);
        assert!((holes[0] - holes[1]).abs() < 1e-12, "{seed}: {holes:?}");
    }
}

/// Pings of one head in a circular tunnel, with `count` pings per turn. The chainage grows by `d_m` per ping.
fn helix(radius_m: f64, count: u32, d_m: f64, pings: u32) -> Vec<Ping> {
    let ping = |k: u32| {
        let angle = TAU * f64::from(k % count) / f64::from(count);
        let (sin, cos) = math::sin_cos(angle);
        let x_m = d_m * f64::from(k);
        Ping {
            head: 0,
            received: MonoNs(u64::from(k)),
            single_step: k > 0,
            new_sweep: k == 0,
            pose: None,
            doubtful: None,
            sample: Some(Sample {
                place: [x_m, angle * radius_m],
                point: [x_m, radius_m * sin, -radius_m * cos],
            }),
        }
    };
    (0..pings).map(ping).collect()
}

#[test]
fn helix_spacings_match_the_formulas() {
    let (radius_m, count, d_m) = (2.0, 40, 0.01);
    let mut pings = helix(radius_m, count, d_m, 130);
    let chord_m = 2.0 * radius_m * math::sin(TAU / 80.0);
    let t_y_m = math::hypot(chord_m, d_m);
    let t_x_m = 40.0 * d_m;
    let all = spacings(&pings, TAU * radius_m);
    assert!(all[..40].iter().all(|spacing| spacing.t_x_m == [None, None]));
    assert_eq!(all[40].t_x_m[0], None, "the first ping of the dive is an end point of its series");
    for spacing in &all[41..] {
        for t_x in spacing.t_x_m {
            assert!((t_x.unwrap() - t_x_m).abs() < 1e-12);
        }
        assert!((spacing.t_y_m.unwrap() - t_y_m).abs() < 1e-12);
        assert!((spacing.t_m[0].unwrap() - math::hypot(t_x_m + d_m, t_y_m)).abs() < 1e-12);
    }
    // Ping 20 has no return. In the next turn, the pings at neighbouring angles therefore have no T_x. The T_y of the
    // return after ping 20 spans the gap.
    pings[20].sample = None;
    let all = spacings(&pings, TAU * radius_m);
    assert!(
        (all[20].t_y_m.unwrap() - math::hypot(2.0 * radius_m * math::sin(TAU / 40.0), 2.0 * d_m)).abs()
            < 1e-12
    );
    assert_eq!(all[59].t_x_m, [None, None]);
    assert!(all[61].t_x_m[0].is_some());
}
