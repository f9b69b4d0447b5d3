//! Classification of the returns of heads in a round tunnel. Its wall may have any shape.

use super::*;
use headrace_geometry::math::{self, TAU};

const STEPS: u32 = 150;

/// Test fixture: heads that turn together, evenly spread, on a moving vehicle.
struct Turning {
    limits: WallLimits,
    relief: Relief,
    heads: Vec<HeadWall>,
    /// Distance travelled between two passes, m.
    pass_m: f64,
}

/// Counts of a head's returns by classification.
#[derive(Debug, Clone, Default, PartialEq)]
struct Count {
    wall: usize,
    doubtful: usize,
    /// Number of returns from wall that another head has found too.
    confirming: usize,
    named: Vec<Distrust>,
}

impl Turning {
    fn new(radius_m: f64, heads: usize) -> Self {
        let contradiction_m = (0.2 * radius_m).min(0.5);
        Self {
            limits: WallLimits::new(TAU * radius_m, contradiction_m, 2.0),
            relief: Relief::default(),
            heads: vec![HeadWall::default(); heads],
            pass_m: 0.04 * radius_m,
        }
    }

    /// Simulates some turns of the heads.
    ///
    /// `heard` returns the range from the centre that a head measures; `None` without a return. Its arguments are head,
    /// chainage, angle, and the numbers of turn and step.
    fn turn(&mut self, turns: u32, heard: impl Fn(usize, f64, f64, [u32; 2]) -> Option<f64>) -> Vec<Count> {
        let radius_m = self.limits.radius_m;
        let mut counts = vec![Count::default(); self.heads.len()];
        let mut waiting = vec![0; self.heads.len()];
        for (turn, step) in (0..turns).flat_map(|turn| (0..STEPS).map(move |step| (turn, step))) {
            for (head, count) in counts.iter_mut().enumerate() {
                let angle =
                    TAU * (f64::from(step) / f64::from(STEPS) + head as f64 / self.heads.len() as f64) % TAU;
                let x_m = self.pass_m
                    * self.heads.len() as f64
                    * (f64::from(turn) + f64::from(step) / f64::from(STEPS));
                let Some(range_m) = heard(head, x_m, angle, [turn, step]) else { continue };
                let placed = PlacedReturn { x_m, arc_m: angle * radius_m, off_m: range_m - radius_m };
                let beam =
                    Beam { range_m, angle_rad: angle, standing: false, design_range_m: &|| Some(radius_m) };
                let sorted = self.heads[head].sort(head, placed, &beam, &self.limits, &mut self.relief);
                let waits = usize::from(sorted.this == Taken::Waits);
                let settled =
                    if sorted.waiting.is_some() { std::mem::replace(&mut waiting[head], 0) } else { 0 };
                waiting[head] += waits;
                for (taken, returns) in [(sorted.waiting, settled), (Some(sorted.this), 1)] {
                    count.wall += if taken == Some(Taken::Wall) { returns } else { 0 };
                    let is_rejected = matches!(taken, Some(Taken::Doubtful | Taken::Other));
                    count.doubtful += if is_rejected { returns } else { 0 };
                }
                count.confirming += usize::from(sorted.is_confirming);
                count.named.extend(sorted.distrusted.map(|(why, _)| why));
            }
        }
        counts
    }

    /// Checks that no return is doubtful and no head is distrusted.
    #[track_caller]
    fn all_wall(mut self, turns: u32, wall_m: impl Fn(f64, f64) -> f64) {
        for count in self.turn(turns, |_, x_m, angle, _| Some(wall_m(x_m, angle))) {
            assert_eq!((count.doubtful, count.named), (0, vec![]));
            assert!(count.wall + 1 >= (turns * STEPS) as usize, "{}", count.wall);
        }
    }
}

/// Pseudo-random number from -1 to 1 that depends only on the inputs.
fn noise(a: u32, b: u32) -> f64 {
    let mixed = (u64::from(a) << 32 | u64::from(b)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (mixed >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

#[test]
fn smooth_rough_and_wide_walls_are_accepted_in_tunnels_of_any_size() {
    for radius_m in [0.3, 1.0, 6.0] {
        Turning::new(radius_m, 1).all_wall(10, |_, _| radius_m);
        Turning::new(radius_m, 1).all_wall(10, |_, _| 1.06 * radius_m);
        // The wall has overbreak of a quarter of the radius, with three lobes around the tunnel and one along it.
        Turning::new(radius_m, 2)
            .all_wall(10, |x_m, angle| radius_m * (1.12 + 0.12 * math::sin(3.0 * angle + x_m / radius_m)));
        // A vehicle beside the centre measures such ranges while its estimated position is in the centre.
        Turning::new(radius_m, 1).all_wall(10, |_, angle| radius_m * (1.0 + 0.15 * math::sin(angle)));
    }
}

/// Objects are at least three steps wide. At their edges, the range jumps from one return to the next. Returns of the
/// first pass may be doubtful, because one pass cannot distinguish a boulder from a large fish.
#[test]
fn boulders_and_niches_are_wall_once_a_second_pass_has_met_them() {
    for (inward_m, half_width) in [(1.5, 0.1), (-2.0, 0.15), (3.0, 0.3)] {
        let count = &Turning::new(6.0, 1).turn(8, |_, x_m, angle, _| {
            let within = (0.5..2.0).contains(&x_m) && (angle - 3.0).abs() < half_width;
            Some(if within { 6.0 - inward_m } else { 6.0 })
        })[0];
        let of_a_pass = (2.0 * half_width / TAU * f64::from(STEPS)) as usize + 1;
        assert!(count.doubtful <= of_a_pass && count.named.is_empty(), "{inward_m} {half_width}: {count:?}");
        assert!(count.wall + count.doubtful + 1 >= 8 * STEPS as usize, "{count:?}");
    }
}

/// A cloud of bubbles gives five successive returns that agree and are far from the wall, but only in one turn.
///
/// A pole at the same place is met again in later turns. It is wall from the fourth turn on at the latest.
#[test]
fn object_is_doubtful_in_its_first_turn_but_wall_if_met_again() {
    let near = |angle: f64| (angle - 3.0).abs() < 2.6 * TAU / f64::from(STEPS);
    for radius_m in [1.0, 6.0] {
        let cloud = |_: usize, _: f64, angle: f64, [turn, _]: [u32; 2]| {
            Some(if turn == 2 && near(angle) { 0.4 * radius_m } else { radius_m })
        };
        let count = &Turning::new(radius_m, 1).turn(5, cloud)[0];
        assert_eq!((count.wall, count.doubtful), (5 * STEPS as usize - 5, 5), "{radius_m}");
        let pole = |_: usize, _: f64, angle: f64, [turn, _]: [u32; 2]| {
            Some(if turn >= 2 && near(angle) { 0.4 * radius_m } else { radius_m })
        };
        let count = &Turning::new(radius_m, 1).turn(9, pole)[0];
        assert!((5..=15).contains(&count.doubtful), "{radius_m}: {count:?}");
        assert_eq!(count.wall + count.doubtful, 9 * STEPS as usize, "{radius_m}");
        // An echo off two walls gives three successive returns, but only in one turn.
        let echo = |_: usize, _: f64, angle: f64, [turn, _]: [u32; 2]| {
            Some(if turn == 2 && (angle - 3.0).abs() < 1.6 * TAU / f64::from(STEPS) {
                1.9 * radius_m
            } else {
                radius_m
            })
        };
        let count = &Turning::new(radius_m, 1).turn(5, echo)[0];
        assert_eq!((count.wall, count.doubtful), (5 * STEPS as usize - 3, 3), "{radius_m}");
    }
}

/// A heap is higher than it is wide, and its foot slopes to the wall.
#[test]
fn run_of_returns_ending_in_a_slope_to_the_wall_is_wall() {
    let steep = |_: f64, angle: f64| {
        let off = (angle - 3.0).abs();
        6.0 - (1.4 - 12.0 * off).max(0.0)
    };
    Turning::new(6.0, 1).all_wall(6, steep);
}

#[test]
fn isolated_return_is_doubtful_until_later_passes_confirm_it() {
    let mut turning = Turning::new(6.0, 1);
    let fish = |_: usize, _: f64, _: f64, at: [u32; 2]| Some(if at == [2, 70] { 3.0 } else { 6.0 });
    let count = &turning.turn(5, fish)[0];
    assert_eq!((count.wall, count.doubtful), (5 * STEPS as usize - 1, 1));
    let mut turning = Turning::new(6.0, 1);
    let post = |_: usize, _: f64, _: f64, [turn, step]: [u32; 2]| {
        Some(if step == 70 && turn >= 2 { 3.0 } else { 6.0 })
    };
    let count = &turning.turn(8, post)[0];
    assert_eq!(count.wall + count.doubtful, 8 * STEPS as usize);
    assert!((1..=3).contains(&count.doubtful), "the first of six hits are doubtful: {count:?}");
}

#[test]
fn stray_echoes_are_doubtful_but_the_head_remains_trusted() {
    for radius_m in [1.0, 6.0] {
        let mut turning = Turning::new(radius_m, 2);
        let murk = |head: usize, _: f64, _: f64, [turn, step]: [u32; 2]| {
            let place = [turn + 1000 * u32::try_from(head).unwrap(), step];
            let share = noise(place[0] + 7, place[1]);
            // 5 % of the returns come from random places in front of the wall, and 3 % are echoes off two walls.
            Some(match share {
                ..-0.9 => radius_m * (0.4 + 0.4 * noise(place[0], place[1] + 500)),
                0.94.. => 2.0 * radius_m * (1.0 + 0.2 * noise(place[0], place[1] + 900)),
                _ => radius_m,
            })
        };
        let mut strays = 0;
        for (turn, step) in (0..20).flat_map(|turn| (0..STEPS).map(move |step| (turn, step))) {
            for head in 0..2 {
                let range_m = murk(head, 0.0, 0.0, [turn, step]).unwrap();
                strays += usize::from((range_m - radius_m).abs() > turning.limits.tolerance_m);
            }
        }
        let counts = turning.turn(20, murk);
        assert!(counts.iter().all(|count| count.named.is_empty()), "{counts:?}");
        let doubtful = counts.iter().map(|count| count.doubtful).sum::<usize>();
        assert!(strays > 400 && doubtful <= strays && 10 * doubtful >= 9 * strays, "{doubtful} of {strays}");
    }
}

#[test]
fn random_ranges_make_a_head_distrusted() {
    let mut turning = Turning::new(1.0, 1);
    let count = &turning.turn(10, |_, _, _, [turn, step]| Some(1.0 + 0.9 * noise(turn, step)))[0];
    assert!(
        matches!(count.named[..], [Distrust::Scattered(jump_m)] if (0.3..0.9).contains(&jump_m)),
        "{count:?}"
    );
    assert!(5 * count.wall < count.doubtful, "{count:?}");
}

#[test]
fn outvoted_head_is_distrusted_until_it_agrees_with_the_other_heads() {
    for wrong in 0..3 {
        let mut turning = Turning::new(1.0, 3);
        let frozen = |head: usize, _: f64, _: f64, _: [u32; 2]| Some(if head == wrong { 0.55 } else { 1.0 });
        let counts = turning.turn(6, frozen);
        for (head, count) in counts.iter().enumerate() {
            if head == wrong {
                assert!(
                    matches!(count.named[..], [Distrust::Outvoted(off_m)] if (off_m + 0.45).abs() < 1e-6)
                );
            } else {
                assert_eq!((count.doubtful, &count.named[..]), (0, &[][..]));
            }
        }
        let counts = turning.turn(6, frozen);
        assert_eq!((counts[wrong].wall, counts[wrong].doubtful), (0, 6 * STEPS as usize));
        // The simulated chainage begins at zero again, as if the vehicle had gone back to its start.
        turning.turn(4, |_, _, _, _| Some(1.0));
        let counts = turning.turn(4, |_, _, _, _| Some(1.0));
        assert_eq!(counts[wrong].doubtful, 0, "the head is trusted again");
    }
}

#[test]
fn cave_seen_by_all_heads_is_wall() {
    Turning::new(1.0, 3).all_wall(12, |x_m, _| if (0.6..1.2).contains(&x_m) { 1.45 } else { 1.0 });
}

#[test]
fn constant_range_counts_as_wall_only_in_the_centre_of_a_pipe() {
    for (out_m, named) in [(0.0, 0), (0.02, 0), (0.2, 1)] {
        let mut turning = Turning::new(1.0, 1);
        let limits = turning.limits;
        let mut names = 0;
        for step in 0..5 * STEPS {
            let angle = TAU * f64::from(step % STEPS) / f64::from(STEPS);
            // The head is `out_m` left of the centre. Its constant range of 0.95 m makes a circle about it.
            let (sine, cosine) = math::sin_cos(angle);
            let (y, z) = (out_m + 0.95 * sine, -0.95 * cosine);
            let design_m = -out_m * sine + math::sqrt(1.0 - out_m * out_m * cosine * cosine);
            let placed = PlacedReturn {
                x_m: 0.001 * f64::from(step),
                arc_m: math::wrap(math::atan2(y, -z), TAU),
                off_m: math::hypot(y, z) - 1.0,
            };
            let beam =
                Beam { range_m: 0.95, angle_rad: angle, standing: false, design_range_m: &|| Some(design_m) };
            let sorted = turning.heads[0].sort(0, placed, &beam, &limits, &mut turning.relief);
            names += usize::from(matches!(sorted.distrusted, Some((Distrust::Constant(_), _))));
        }
        assert_eq!(names, named, "{out_m}");
    }
}

/// Heads that are frozen at one range in the centre of a pipe seem to find the same wall, 22 % outside the design. But
/// at a true wall of this size, the vehicle is beside the centre, so the ranges vary with the direction.
#[test]
fn frozen_heads_never_confirm_wall_but_heads_at_a_true_wall_do() {
    let confirming_share = |beside_m: f64, noise_m: f64| {
        let heard = |head: usize, _: f64, angle: f64, [turn, step]: [u32; 2]| {
            let noise = noise(turn * STEPS + step, u32::try_from(head).unwrap());
            Some(1.22 + beside_m * math::sin(angle) + noise_m * noise)
        };
        let counts = Turning::new(1.0, 2).turn(10, heard);
        let [confirming, wall] = [|count: &Count| count.confirming, |count: &Count| count.wall]
            .map(|of| counts.iter().map(of).sum::<usize>() as f64);
        confirming / wall
    };
    let frozen = [0.0, 0.005, 0.01, 0.02, 0.04].map(|noise_m| confirming_share(0.0, noise_m));
    assert!(frozen.iter().all(|share| *share < 0.02), "{frozen:?}");
    let seen = [0.0, 0.005, 0.01, 0.02].map(|noise_m| confirming_share(0.05, noise_m));
    assert!(seen.iter().all(|share| *share > 0.9), "{seen:?}");
}

/// A constant range off the centre agrees with the wall for a part of each turn.
#[test]
fn stuck_head_is_distrusted_until_its_range_varies() {
    for (radius_m, out_m) in [(1.0, 0.3), (6.0, 1.0)] {
        let mut turning = Turning::new(radius_m, 1);
        let limits = turning.limits;
        let (mut named, mut stuck_wall, mut stuck_m) = (Vec::new(), 0, None);
        turning.relief.note_changing(1, true);
        for step in 0..5 * STEPS {
            let angle = TAU * f64::from(step % STEPS) / f64::from(STEPS);
            let (sine, cosine) = math::sin_cos(angle);
            let design_m = -out_m * sine + math::sqrt(radius_m * radius_m - out_m * out_m * cosine * cosine);
            let sticks = (2 * STEPS..2 * STEPS + STEPS / 2).contains(&step);
            // When the head gets stuck, its range is still correct.
            let range_m = if sticks { *stuck_m.get_or_insert(design_m) } else { design_m };
            let (y, z) = (out_m + range_m * sine, -range_m * cosine);
            let placed = PlacedReturn {
                x_m: 0.001 * f64::from(step),
                arc_m: math::wrap(math::atan2(y, -z), TAU) * radius_m,
                off_m: math::hypot(y, z) - radius_m,
            };
            let beam =
                Beam { range_m, angle_rad: angle, standing: false, design_range_m: &|| Some(design_m) };
            let sorted = turning.heads[0].sort(0, placed, &beam, &limits, &mut turning.relief);
            stuck_wall += usize::from(sticks && sorted.this == Taken::Wall);
            named.extend(sorted.distrusted);
            if step == 4 * STEPS {
                assert_eq!(turning.heads[0].distrusted(), None, "the range varies again");
            }
        }
        let [(Distrust::Constant(_), [from_m, to_m])] = named[..] else { panic!("{named:?}") };
        // All wall samples since the head got stuck are withdrawn. Those before it are kept.
        let begun_m = 0.001 * f64::from(2 * STEPS);
        assert!((from_m - begun_m).abs() <= 0.001 + 1e-9, "{from_m}");
        assert!(
            ((to_m - from_m) / 0.001 - stuck_wall as f64).abs() <= 1.5,
            "{stuck_wall}, {from_m} to {to_m}"
        );
    }
}

#[test]
fn wall_classification_limits_scale_with_the_cross_section() {
    let of = |radius_m: f64| WallLimits::new(TAU * radius_m, (0.2 * radius_m).min(0.5), 2.0);
    assert!((of(1.0).tolerance_m - 0.1).abs() < 1e-12 && (of(1.0).contradiction_m - 0.2).abs() < 1e-12);
    assert!((of(0.15).tolerance_m - 0.03).abs() < 1e-12, "not below the sonars' accuracy");
    assert!((of(20.0).tolerance_m - 0.5).abs() < 1e-12, "not above the contradiction limit");
}
