use super::*;
use crate::occlusion::AngleRange;
use crate::ring::Standing;
use crate::spacing;
use headrace_geometry::frames::{Mount, Point3, Pose, Rot, Vec3};
use headrace_geometry::tunnel::{Profile, shapes};

const SOUNDINGS: u32 = 3600;
const STEP: usize = 24;
const PING_S: f64 = 0.02;
const GOING: Going = Going {
    ping_period_s: PING_S,
    swing_mps: 0.0,
    shift_m: 0.0,
    apart_m: 0.0,
    apart_swing_mps: 0.0,
    swing_most_m: None,
};

/// A pipe with a perimeter of 30 m. For a head on the axis, samples of a turn are equally spaced.
fn pipe() -> Profile {
    shapes::circle(30.0 / math::TAU).unwrap()
}

fn ring(profile: &Profile) -> Ring {
    let [y, z] = profile.reference();
    let pose = Pose { position: Point3::new(0.0, y, z), attitude: Rot::identity() };
    let mount = Mount { position: Vec3::zero(), rotation: Rot::identity() };
    Ring::cast(&Standing::new(profile, &pose, &mount).unwrap(), 0.0, SOUNDINGS).unwrap()
}

fn arc(from_m: f64, length_m: f64) -> Arc {
    Arc { from_m, length_m }
}

/// An angular step of 2.4 degrees is 0.2 m long on the wall.
fn strips(views: &[View]) -> Strips {
    let ring = ring(&pipe());
    let mut strips = Strips::default();
    strips.rebuild(30.0, views);
    strips.measure(1, views.iter().map(|_| &ring), |_, _| Some(STEP));
    strips
}

fn all_around(hidden: &[Arc]) -> View {
    View { sector: None, hidden: hidden.to_vec() }
}

fn turning(heads: usize) -> Passes {
    Passes::evenly_phased(HeadSet::first(heads), |_| 8.0).unwrap()
}

fn speed(strips: &Strips, passes: &Passes, target_m: f64) -> Result<f64, SamplingError> {
    strips.bound_for_target(0, passes, target_m, &GOING).map(|bound| bound.speed_mps)
}

fn closed(target_m: f64, t_y_m: f64, gap_s: f64) -> f64 {
    spacing::speed_for_target_mps(target_m, t_y_m, gap_s, PING_S).unwrap()
}

#[test]
fn wall_seen_by_all_heads_is_one_strip() {
    let one = strips(&[all_around(&[]), all_around(&[])]);
    let whole = Strip { arc: arc(0.0, 30.0), seen_by: HeadSet::first(2), set: 0, hidden: false, wait: 1.0 };
    assert_eq!(one.as_slice(), [whole]);
    assert!((one.largest_step_m(0) - 0.2).abs() < 1e-9);
    let v = speed(&one, &turning(2), 0.5).unwrap();
    assert!((v - closed(0.5, 0.2, 4.0)).abs() < 1e-9);
    assert!((one.t_max_m(0, &turning(2), v, &GOING) - 0.5).abs() < 1e-12);
}

#[test]
fn hidden_strip_across_the_seam_is_one_strip() {
    let some = strips(&[all_around(&[arc(29.0, 2.0)]), all_around(&[])]);
    let widths: Vec<f64> = some.as_slice().iter().map(|strip| strip.arc.length_m).collect();
    assert_eq!(widths, [28.0, 2.0]);
    assert_eq!(some.at(0.5).unwrap().seen_by, HeadSet::first(2).without(0));
    assert_eq!(some.at(29.5), some.at(0.5));
    assert_eq!(some.at(15.0).unwrap().seen_by, HeadSet::first(2));
}

#[test]
fn strip_hidden_from_some_heads_lowers_the_speed() {
    let hidden = [arc(7.0, 1.7)];
    let views = [all_around(&hidden), all_around(&[]), all_around(&hidden), all_around(&[])];
    let some = strips(&views);
    let v = speed(&some, &turning(4), 0.5).unwrap();
    assert!((v - closed(0.5, 0.2, 4.0)).abs() < 1e-9);
    assert!((some.t_max_m(0, &turning(4), v, &GOING) - 0.5).abs() < 1e-12);
}

#[test]
fn narrow_hidden_strip_counts_like_a_large_distance_between_samples() {
    let some = strips(&[all_around(&[arc(7.0, 0.1)]), all_around(&[])]);
    // On each side of the hidden strip, the nearest ping may be one angular step away from it.
    let v = speed(&some, &turning(2), 0.8).unwrap();
    assert!((v - closed(0.8, 0.5, 4.0)).abs() < 1e-9);
    // A hidden strip counts even if it is narrower than the distance between two rays on the wall.
    let sliver = strips(&[all_around(&[arc(7.0013, 1e-4)])]);
    let v = speed(&sliver, &turning(1), 0.8).unwrap();
    assert!((v - closed(0.8, 0.4001, 8.0)).abs() < 1e-9, "{v}: {sliver:?}");
}

#[test]
fn unseen_strip_as_wide_as_the_target_rules_out_every_speed() {
    let views = [all_around(&[arc(7.0, 0.7)]), all_around(&[arc(7.0, 0.7)])];
    let why = speed(&strips(&views), &turning(2), 0.5).unwrap_err();
    assert!(
        matches!(why, SamplingError::UnseenStrip { width_m, arc_m, .. }
            if (width_m - 0.7).abs() < 1e-9 && (arc_m - 7.35).abs() < 1e-9),
        "{why}"
    );
    assert!(speed(&strips(&views), &turning(2), 1.2).is_ok());
    let blind = strips(&[all_around(&[arc(0.0, 30.0)])]);
    assert!(speed(&blind, &turning(1), 0.5).is_err());
    assert!(blind.t_max_m(0, &turning(1), 0.1, &GOING).is_infinite());
    let coarse = speed(&strips(&[all_around(&[])]), &turning(1), 0.15).unwrap_err();
    assert!(matches!(coarse, SamplingError::AngularStep { t_y_m, .. } if (t_y_m - 0.2).abs() < 1e-9));
}

#[test]
fn gap_between_sectors_is_an_unseen_strip_that_limits_the_speed() {
    let views = [
        View { sector: Some(Sector::evenly(arc(0.2, 14.8))), hidden: Vec::new() },
        View { sector: Some(Sector::evenly(arc(15.0, 14.9))), hidden: Vec::new() },
    ];
    let passes = Passes::in_sectors(HeadSet::first(2), 8.0).unwrap();
    let some = strips(&views);
    let unseen: Vec<&Strip> = some.as_slice().iter().filter(|strip| strip.seen_by.is_empty()).collect();
    assert!(unseen.len() == 1 && (unseen[0].arc.length_m - 0.3).abs() < 1e-9);
    // For a large target, the spacing at the end of a sector limits the speed. For a small target, a circle through
    // three samples limits it. Two of them are on one side of the gap, 8 s apart. The third is on the other side,
    // between the two.
    let v = speed(&some, &passes, 1.0).unwrap();
    assert!((v - closed(1.0, 0.2, 8.0)).abs() < 1e-9);
    let v = speed(&some, &passes, 0.35).unwrap();
    let apart_m = v * (8.0 + PING_S);
    assert!((0.3 + apart_m * apart_m / 1.2 - 0.35).abs() < 1e-9, "{v}");
    assert!((some.t_max_m(0, &passes, v, &GOING) - 0.35).abs() < 1e-9);
}

#[test]
fn hidden_arc_outside_a_sector_has_no_effect() {
    let plain = |from_m: f64, length_m: f64| View {
        sector: Some(Sector::evenly(arc(from_m, length_m))),
        hidden: Vec::new(),
    };
    let open = [plain(0.0, 14.99), plain(15.0, 15.0)];
    // The hidden arc covers a narrow strip between the sectors, and wall in the other head's sector.
    let mut beside = open.clone();
    beside[0].hidden = vec![arc(14.992, 5.0)];
    let passes = Passes::in_sectors(HeadSet::first(2), 8.0).unwrap();
    let speeds = [&open, &beside].map(|views| speed(&strips(views), &passes, 0.5).unwrap());
    assert!((speeds[0] - speeds[1]).abs() < 1e-12, "{speeds:?}");
    // No head sees a hidden arc within the head's own sector, so no speed meets the target.
    let mut own = open.clone();
    own[0].hidden = vec![arc(7.0, 0.4)];
    assert!(speed(&strips(&own), &passes, 0.5).is_err());
}

/// The reference is the set of samples of two heads in the middle of a rectangle.
///
/// The rectangle's corners lie within the heads' sectors.
#[test]
fn large_sample_distance_in_a_sector_uses_the_pass_interval_at_that_place() {
    let (target_m, sweep_s, count) = (0.5, 8.0, 75);
    let profile = shapes::rectangle(6.0, 4.0).unwrap();
    let ring = ring(&profile);
    let perimeter_m = profile.perimeter_m();
    // The first head sweeps up the left side from the floor's centre to the roof's centre. The second head sweeps
    // down the right side.
    let half = perimeter_m / 2.0;
    let views = [0.0, half].map(|from_m| {
        let [y, z] = profile.reference();
        let pose = Pose { position: Point3::new(0.0, y, z), attitude: Rot::identity() };
        let mount = Mount { position: Vec3::zero(), rotation: Rot::identity() };
        let standing = Standing::new(&profile, &pose, &mount).unwrap();
        let from_rad = if from_m > 0.0 { math::TAU / 2.0 } else { 0.0 };
        let angles = AngleRange { from_rad, size_rad: math::TAU / 2.0 };
        View { sector: Some(Sector::of(&standing, &angles).unwrap()), hidden: Vec::new() }
    });
    let mut strips = Strips::default();
    strips.rebuild(perimeter_m, &views);
    let stride = SOUNDINGS as usize / (2 * count);
    strips.measure(1, [&ring, &ring].into_iter(), |_, _| Some(stride));
    let going = Going { ping_period_s: sweep_s / (2 * count) as f64, ..GOING };
    let passes = Passes::in_sectors(HeadSet::first(2), sweep_s).unwrap();
    let v = strips.bound_for_target(0, &passes, target_m, &going).unwrap().speed_mps;
    let without = closed(target_m, strips.largest_step_m(0), sweep_s);
    assert!(v > 1.1 * without, "{v} {without}");
    let at = |angle: usize| ring.soundings()[angle * stride % SOUNDINGS as usize].arc_m;
    let hole_m = |speed_mps: f64| {
        let place = |ping: usize, head: usize| {
            let along = ping % (2 * count);
            let along = if along <= count { along } else { 2 * count - along };
            [speed_mps * ping as f64 * going.ping_period_s, at(along + head * count)]
        };
        let samples: Vec<[f64; 2]> =
            (0..count * 8).flat_map(|ping| [0, 1].map(|head| place(ping, head))).collect();
        let clear = |x_m: f64, arc_m: f64| {
            let away = |place: &[f64; 2]| {
                let around_m = math::wrap_signed(place[1] - arc_m, perimeter_m);
                math::hypot(place[0] - x_m, around_m)
            };
            samples.iter().map(away).fold(f64::INFINITY, f64::min)
        };
        let turn_m = speed_mps * sweep_s;
        let grid = (0..40).flat_map(|i| (0..1000).map(move |k| (f64::from(i) / 40.0, f64::from(k) / 1000.0)));
        let widest = grid.map(|(x, s)| clear((1.5 + x) * turn_m, s * perimeter_m)).fold(0.0, f64::max);
        2.0 * widest
    };
    let (at_it_m, faster_m) = (hole_m(v), hole_m(1.1 * v));
    assert!(at_it_m < target_m && at_it_m > 0.9 * target_m, "{at_it_m}");
    assert!(faster_m > target_m, "{faster_m}");
}

#[test]
fn sample_distances_count_only_on_strips_that_they_touch() {
    // Neighbouring samples are far apart in the corners of a rectangle, but not on a strip in the middle of the
    // floor.
    let profile = shapes::rectangle(8.0, 4.0).unwrap();
    let ring = ring(&profile);
    let mut some = Strips::default();
    some.rebuild(profile.perimeter_m(), &[all_around(&[arc(0.5, 0.2)]), all_around(&[])]);
    some.measure(1, [&ring, &ring].into_iter(), |_, _| Some(STEP));
    let of = |k: usize| some.steps_m[k];
    assert!(of(0)[0] < 0.12 && of(1)[0] > 0.3, "{:?}", some.steps_m);
    assert!((some.largest_step_m(0) - ring.largest_step_m(STEP)).abs() < 1e-12);
}

#[test]
fn vehicle_swing_and_pass_shift_widen_the_distance_between_passes() {
    let one = strips(&[all_around(&[])]);
    let rough = Going { swing_mps: 0.01, apart_swing_mps: 0.01, shift_m: 0.05, apart_m: 0.2, ..GOING };
    let v = one.bound_for_target(0, &turning(1), 0.5, &rough).unwrap().speed_mps;
    assert!((one.t_max_m(0, &turning(1), v, &rough) - 0.5).abs() < 1e-12);
    assert!(v < speed(&one, &turning(1), 0.5).unwrap() - 0.01);
    let worse = Going { swing_mps: 0.1, apart_swing_mps: 0.1, ..rough };
    assert!(one.bound_for_target(0, &turning(1), 0.5, &worse).is_err());
    // A swing whose extent is known to be small allows a higher speed.
    let to_and_fro = Going { swing_most_m: Some(0.1), ..worse };
    let v = one.bound_for_target(0, &turning(1), 0.5, &to_and_fro).unwrap().speed_mps;
    assert!((one.t_max_m(0, &turning(1), v, &to_and_fro) - 0.5).abs() < 1e-12);
    assert!(v > 0.02 && one.t_max_m(0, &turning(1), 1.02 * v, &to_and_fro) > 0.5);
}

#[test]
fn wall_beyond_the_range_limits_counts_as_hidden() {
    let profile = shapes::rectangle(8.0, 4.0).unwrap();
    let ring = ring(&profile);
    let hidden = |reach_m: [f64; 2]| {
        let mut view = View { sector: None, hidden: Vec::with_capacity(8) };
        view.hide_out_of_reach(&ring, reach_m);
        view.hidden
    };
    assert!(hidden([0.1, 5.0]).is_empty());
    // The four corners are 4.5 m away, and the end walls 4 m.
    let corners = hidden([0.1, 4.2]);
    assert_eq!(corners.len(), 4);
    let far_m: f64 = corners.iter().map(|arc| arc.length_m).sum();
    let expected_m = 4.0 * ((4.0 - math::sqrt(4.2 * 4.2 - 4.0)) + (2.0 - math::sqrt(4.2 * 4.2 - 16.0)));
    assert!((far_m - expected_m).abs() < 0.1, "{far_m} and {expected_m}");
    assert_eq!(hidden([0.1, 1.0]), [arc(0.0, 24.0)]);
    assert_eq!(hidden([3.0, 10.0]).len(), 2);
}

#[test]
fn overlapping_hidden_arcs_across_the_seam_form_one_strip() {
    let mut some = Strips::default();
    some.rebuild(10.0, &[all_around(&[arc(8.0, 4.0), arc(1.0, 2.0)])]);
    let unseen: Vec<&Strip> = some.as_slice().iter().filter(|strip| strip.seen_by.is_empty()).collect();
    assert!(unseen.len() == 1 && (unseen[0].arc.length_m - 5.0).abs() < 1e-9, "{some:?}");
    assert!((unseen[0].arc.from_m - 8.0).abs() < 1e-9);
    for (arc_m, seen) in [(0.5, false), (2.9, false), (3.1, true), (7.9, true), (8.1, false)] {
        assert_eq!(some.at(arc_m).unwrap().seen_by.is_empty(), !seen, "{arc_m}");
    }
}

#[test]
fn full_list_of_hidden_arcs_overestimates_the_hidden_wall() {
    // Slots in the wall, all around the profile, are outside the range limits. One of the two views has too little
    // capacity for arcs of all slots.
    let points: Vec<[f64; 2]> = (0..240)
        .map(|k| {
            let (sine, cosine) = math::sin_cos(math::TAU * (f64::from(k) + 0.3) / 240.0);
            let r = if k % 6 == 0 { 3.4 } else { 3.0 };
            [r * sine, r * cosine]
        })
        .collect();
    let profile = Profile::polygon(&points, Some([0.0, 0.0])).unwrap();
    let ring = ring(&profile);
    let hidden = |room: usize| {
        let mut view = View { sector: None, hidden: Vec::with_capacity(room) };
        view.hide_out_of_reach(&ring, [0.1, 3.2]);
        assert!(view.hidden.capacity() == room && view.hidden.len() <= room);
        view
    };
    let (all, few) = (hidden(100), hidden(5));
    assert_eq!((all.hidden.len(), few.hidden.len()), (40, 5));
    let perimeter_m = profile.perimeter_m();
    let is_hidden = |view: &View, arc_m: f64| view.hidden.iter().any(|arc| arc.has(arc_m, perimeter_m));
    for k in 0..2000 {
        let arc_m = perimeter_m * f64::from(k) / 2000.0;
        assert!(is_hidden(&few, arc_m) || !is_hidden(&all, arc_m), "{arc_m}");
    }
}

/// In either direction of rotation, the strip ends at the computed distance, even across the start of arc lengths.
#[test]
fn distance_to_the_end_of_the_strip_is_right_for_each_sample() {
    let mut strips = strips(&[all_around(&[arc(4.0, 3.0), arc(28.0, 3.5)]), all_around(&[arc(10.0, 5.0)])]);
    let ring = ring(&pipe());
    for (forward, side) in [(true, 1.0), (false, -1.0)] {
        strips.find_strips(&ring, forward);
        assert_eq!(strips.strip_of.len(), ring.soundings().len());
        for (sounding, (number, left_m)) in ring.soundings().iter().zip(&strips.strip_of) {
            let at = |on_m: f64| {
                number_at(&strips.strips, math::wrap(sounding.arc_m + side * on_m, 30.0), strips.perimeter_m)
            };
            if *left_m > 1e-3 {
                assert_eq!((at(0.0), at(left_m - 1e-4)), (*number, *number), "{forward} {}", sounding.arc_m);
                assert_ne!(at(left_m + 1e-4), *number, "{forward} {}: {left_m}", sounding.arc_m);
            }
        }
    }
}
