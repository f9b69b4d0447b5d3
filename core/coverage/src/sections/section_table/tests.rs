use super::*;
use crate::hole::FARTHEST_M;
use crate::missing_samples::MissingSample;
use crate::store::{StoreLayout, WallSample};
use crate::unsure::Unsure;
use headrace_fusion::relative::Relative;
use headrace_geometry::tunnel::shapes;

const SECTION_M: f64 = 0.25;

/// Sections from a metre before the portal to 10 m, for a target of 0.5 m.
fn sections() -> Sections {
    Sections::new(SECTION_M, Target::new(0.5), -1.0, 10.0)
}

#[test]
fn stretch_contains_all_existing_sections_that_it_touches() {
    let of = |from_m: f64, to_m: f64| sections().sections_of(Some(Reach { from_m, to_m }));
    assert_eq!(of(1.1, 1.9), 4..8);
    assert_eq!(of(1.0, 2.0), 4..9, "both ends at section boundaries");
    assert_eq!(of(3.3, 3.3), 13..14);
    assert_eq!((of(-20.0, -0.6), of(9.9, 40.0)), (-4..-2, 39..40));
    assert!(of(11.0, 12.0).is_empty() && sections().sections_of(None).is_empty());
}

/// A judged section is counted once, however often its verdict changes.
///
/// A section that is not judged counts as open.
#[test]
fn each_section_counts_once_in_the_metres_of_its_latest_verdict() {
    let mut sections = sections();
    let [pass, fail] = [Verdict::Pass, Verdict::Fail].map(|verdict| Some(verdict as usize));
    for (before, now) in [(None, fail), (None, fail), (None, fail), (None, pass), (fail, pass), (fail, None)]
    {
        sections.count(before, now);
    }
    let metres = sections.metres(Some(Reach { from_m: 0.1, to_m: 1.9 }));
    let found = [metres.pass_m, metres.fail_m, metres.cannot_say_m, metres.open_m, metres.not_inspected_m];
    let expected = [2.0, 1.0, 0.0, 5.0, 0.0].map(|count| count * SECTION_M);
    assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
}

/// A section with pings has the error of its own passes. A section without pings has the largest error of the sections
/// within half the target of it.
#[test]
fn section_without_pings_has_the_largest_position_error_of_nearby_sections() {
    let error_of = |placed_in: i64, asked: i64| {
        let mut sections = sections();
        for (index, sd_m) in [(placed_in, 0.03), (30, 0.01)] {
            let passage = &mut sections.get_mut(index).unwrap().passage;
            passage.placed = 5;
            passage.pass_error.relative = Relative::along(sd_m);
        }
        let found = sections.pass_error(asked);
        if found == PassError::default() {
            0.0
        } else {
            found.sd_m([0.0; 2]) / PassError { relative: Relative::along(1.0), ..found }.sd_m([0.0; 2])
        }
    };
    let near = |found: f64, expected: f64| (found - expected).abs() < 1e-12;
    // Section 20 spans 5 to 5.25 m. With 0.25 m, half the target, on either side, this becomes 4.75 to 5.5 m.
    for (beside, expected) in [(18, 0.0), (19, 0.03), (21, 0.03), (22, 0.03), (23, 0.0)] {
        assert!(near(error_of(beside, 20), expected), "{beside}: {}", error_of(beside, 20));
    }
    assert!(near(error_of(31, 30), 0.01), "its own error, although a neighbour has a larger error");
    assert!(near(error_of(29, 28), 0.03) && near(error_of(27, 28), 0.03));
}

const BEHIND: f64 = f64::INFINITY;

fn hole(diameter_m: f64) -> Hole {
    Hole { diameter_m, least_m: diameter_m, most_m: diameter_m, x_m: 0.0, arc_m: 0.0, bounded: true }
}

#[test]
fn section_without_samples_never_passes() {
    let hole = Hole { bounded: false, most_m: f64::INFINITY, ..hole(2.0 * FARTHEST_M) };
    assert_eq!(verdict(&hole, 0.0, Target::new(100.0), BEHIND), Verdict::Fail);
    assert_eq!(verdict(&hole, 0.0, Target::new(100.0), 1.0), Verdict::Open);
}

#[test]
fn verdict_requires_the_configured_number_of_standard_deviations() {
    for (confidence_sd, diameter_m, expected) in [
        (1.0, 0.89, Verdict::Pass),
        (1.0, 0.91, Verdict::CannotSay),
        (1.0, 1.11, Verdict::Fail),
        (2.0, 0.79, Verdict::Pass),
        (2.0, 0.81, Verdict::CannotSay),
        (2.0, 1.19, Verdict::CannotSay),
        (2.0, 1.21, Verdict::Fail),
        (3.0, 0.69, Verdict::Pass),
        (3.0, 1.29, Verdict::CannotSay),
        (3.0, 1.31, Verdict::Fail),
    ] {
        let target = Target { max_hole_m: 1.0, confidence_sd };
        assert_eq!(verdict(&hole(diameter_m), 0.1, target, BEHIND), expected, "{diameter_m}");
    }
    assert_eq!(
        verdict(&hole(1.0), 0.0, Target::new(1.0), BEHIND),
        Verdict::Pass,
        "a hole as large as the target passes"
    );
}

#[test]
fn verdict_stays_open_until_enough_of_the_hole_is_out_of_reach_of_the_heads() {
    let at = |clear_m: f64| verdict(&hole(2.0), 0.1, Target::new(1.0), clear_m);
    assert_eq!([0.0, 0.59, 0.61, 1.0].map(at), [Verdict::Open, Verdict::Open, Verdict::Fail, Verdict::Fail]);
    let unsure = |clear_m: f64| verdict(&hole(1.1), 0.1, Target::new(1.0), clear_m);
    assert_eq!([0.5, 0.56].map(unsure), [Verdict::Open, Verdict::CannotSay]);
}

#[test]
fn verdict_is_cannot_say_if_the_hole_bounds_straddle_the_target() {
    let within = |diameter_m: f64, least_m: f64, most_m: f64| {
        verdict(&Hole { least_m, most_m, ..hole(diameter_m) }, 0.0, Target::new(0.5), BEHIND)
    };
    assert_eq!(within(0.51, 0.49, 0.51), Verdict::CannotSay);
    assert_eq!(within(0.51, 0.501, 0.51), Verdict::Fail);
    assert_eq!(within(0.49, 0.49, 0.505), Verdict::CannotSay);
    assert_eq!(within(0.49, 0.45, 0.5), Verdict::Pass);
}

/// Judges a section of a pipe after two visits. Each leaves a square mesh of samples, with the widths `meshes_m`.
///
/// With `is_related`, both visits belong to one navigation segment. Returns the verdict, the hole's diameter, m, and
/// the number of the first visit that counts.
fn seen_twice(meshes_m: [f64; 2], is_related: bool) -> (Verdict, f64, u32) {
    let profile = shapes::circle(3.0).unwrap();
    let perimeter_m = profile.perimeter_m();
    let layout = StoreLayout { perimeter_m, from_m: 0.0, to_m: 10.0, cell_m: 0.25, capacity: 20_000 };
    let mut store = SampleStore::new(layout);
    let mut sections = sections();
    for (number, mesh_m) in (0..).zip(meshes_m) {
        let tie = if is_related { 0 } else { number };
        let visit = Visit {
            number,
            tie,
            at: MonoNs(u64::from(number) * 60_000_000_000),
            errors: [PassError::default(); 2],
        };
        let around = math::round_to_i64(perimeter_m / mesh_m);
        // The centre of the section is midway between two rows of samples.
        let rows = math::floor_to_i64(2.0 / mesh_m);
        for (i, k) in (-rows..rows).flat_map(|i| (0..around).map(move |k| (i, k))) {
            let (x_m, arc_m) = (5.125 + mesh_m * (i as f64 + 0.5), perimeter_m / around as f64 * k as f64);
            store.insert(WallSample { x_m, arc_m, head: 0, step_m: None, visit: number }).unwrap();
            sections.touch(x_m, &visit, &profile);
        }
    }
    let mut judging = Judging {
        store: &store,
        missing_samples: &MissingSamples::default(),
        finder: &mut HoleFinder::default(),
        profile: &profile,
        tell: &mut |_, _| {},
    };
    let request = Request {
        section: 20,
        at: MonoNs(0),
        swept_by_all: None,
        none_alive: false,
        to_come: Some(Reach { from_m: 9.0, to_m: f64::INFINITY }),
        not_passed: None,
        ended: None,
        only_fails: false,
    };
    sections.judge(&request, &mut judging);
    let section = sections.get(20).unwrap();
    (section.verdict, section.hole.unwrap().diameter_m, section.visits.first())
}

/// Judges a section of a pipe with a square hole. `may_be_wall` belongs to a missing sample in the middle of the hole;
/// `None` means that there is none.
///
/// The section is judged again at the end of the dive, when missing samples are no longer listed.
fn with_hole(edge_m: f64, may_be_wall: Option<bool>) -> (Verdict, Option<Unsure>) {
    let profile = shapes::circle(3.0).unwrap();
    let layout = StoreLayout {
        perimeter_m: profile.perimeter_m(),
        from_m: 0.0,
        to_m: 10.0,
        cell_m: 0.25,
        capacity: 20_000,
    };
    let (mut store, mut sections, mut missing_samples) =
        (SampleStore::new(layout), sections(), MissingSamples::default());
    let visit = Visit { number: 0, tie: 0, at: MonoNs(0), errors: [PassError::default(); 2] };
    for (x_m, arc_m) in
        (0..40).flat_map(|i| (0..94).map(move |k| (3.0 + 0.1 * f64::from(i), 0.2 * f64::from(k))))
    {
        if (x_m - 5.1_f64).abs().max((arc_m - 7.0).abs()) > edge_m / 2.0 {
            store.insert(WallSample { x_m, arc_m, head: 0, step_m: None, visit: 0 }).unwrap();
            sections.touch(x_m, &visit, &profile);
        }
    }
    if let Some(may_be_wall) = may_be_wall {
        let why = Causes::of(Cause::MissingReturns);
        missing_samples.add(MissingSample { x_m: 5.1, arc_m: 7.0, head: 0, why, may_be_wall });
    }
    let to_come = Some(Reach { from_m: 9.0, to_m: f64::INFINITY });
    let request = Request {
        section: 20,
        at: MonoNs(0),
        swept_by_all: None,
        none_alive: false,
        to_come,
        not_passed: None,
        ended: None,
        only_fails: false,
    };
    let all = Reach { from_m: 0.0, to_m: 10.0 };
    let at_the_end = Request { ended: Some(Ended(Some(all))), ..request };
    for (request, missing_samples) in [(request, &missing_samples), (at_the_end, &MissingSamples::default())]
    {
        let mut judging = Judging {
            store: &store,
            missing_samples,
            finder: &mut HoleFinder::default(),
            profile: &profile,
            tell: &mut |_, _| {},
        };
        sections.judge(&request, &mut judging);
    }
    let section = sections.get(20).unwrap();
    (section.verdict, section.unsure())
}

/// For a target of 0.5 m, a sample in the middle would fill a hole of 0.7 m, but not one of 2 m.
#[test]
fn section_neither_passes_nor_fails_if_doubtful_returns_would_fill_its_hole() {
    let undecided = (Verdict::CannotSay, Some(Unsure::DoubtfulReturns));
    assert_eq!(with_hole(0.1, None), (Verdict::Pass, None));
    assert_eq!(with_hole(0.5, None), (Verdict::Fail, None));
    assert_eq!(with_hole(0.5, Some(false)), (Verdict::Fail, None), "the return is certainly no wall");
    assert_eq!(with_hole(0.5, Some(true)), undecided);
    assert_eq!(with_hole(2.0, Some(true)), (Verdict::Fail, None), "the rest of the hole is too large");
}

/// A mesh leaves holes as wide as its diagonal: 0.28 m for a width of 0.2 m, and 0.48 m for 0.34 m.
///
/// The target is 0.5 m.
#[test]
fn hole_uses_the_samples_of_all_visits_unless_the_newest_visit_alone_passes() {
    let fine_m = 0.2 * math::sqrt(2.0);
    let (verdict, hole_m, first) = seen_twice([0.2, 0.34], true);
    assert!(hole_m < fine_m + 1e-3, "{hole_m}");
    assert_eq!((verdict, first), (Verdict::Pass, 0), "the samples of both visits count");
    let (verdict, hole_m, first) = seen_twice([0.2, 0.34], false);
    assert!((hole_m - 0.34 * math::sqrt(2.0)).abs() < 0.01, "{hole_m}");
    assert_eq!((verdict, first), (Verdict::Pass, 1), "the first visit has no relation to the second");
    let (verdict, hole_m, first) = seen_twice([0.2, 0.6], false);
    assert!(hole_m < fine_m + 1e-3, "{hole_m}");
    assert_eq!((verdict, first), (Verdict::CannotSay, 0), "neither the newest visit nor both visits pass");
    let (verdict, hole_m, first) = seen_twice([0.6, 0.2], true);
    assert!(hole_m < fine_m + 1e-3, "{hole_m}");
    assert_eq!((verdict, first), (Verdict::Pass, 0));
    assert_eq!(seen_twice([0.6, 0.62], true).0, Verdict::Fail, "both meshes are too wide, even together");
}
