//! Comparison of the required number of passes with simulated walls: random losses, and holes found by brute force.

use super::*;

const TARGET_M: f64 = 0.5;
const PERIMETER_M: f64 = 12.0;

fn sampled(t_y_m: f64) -> Sampled {
    Sampled { target_m: TARGET_M, t_y_m, perimeter_m: PERIMETER_M }
}

fn passes(t_y_m: f64, rates: &[LossRate]) -> f64 {
    sampled(t_y_m).passes_needed(rates.iter().copied())
}

/// Generator of random numbers from 0 to 1 (splitmix64).
struct Draw(u64);

impl Draw {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Share of simulated stretches of wall that have no empty circle of the target's diameter.
///
/// Passes are `along_m` apart; each stretch is 0.25 m long.
fn share_passed(along_m: f64, t_y_m: f64, rates: &[LossRate], seed: u64) -> f64 {
    const STRETCHES: usize = 80;
    const FINE_M: f64 = 0.02;
    let mut draw = Draw(seed);
    let length_m = STRETCHES as f64 * STRETCH_M + 2.0 * TARGET_M;
    let turns = (length_m / along_m).ceil() as usize + 1;
    let pings = (PERIMETER_M / t_y_m).round();
    let mut lost = vec![false; rates.len()];
    // Samples, grouped by intervals of half a metre along the tunnel.
    let mut rows = vec![Vec::new(); (length_m / TARGET_M) as usize + 3];
    for turn in 0..turns {
        let head = turn % rates.len();
        let LossRate { share, after_lost } = rates[head];
        let heard_to_lost = share * (1.0 - after_lost) / (1.0 - share);
        let offset = draw.next();
        for ping in 0..pings as usize {
            lost[head] = draw.next() < if lost[head] { after_lost } else { heard_to_lost };
            if !lost[head] {
                let x_m = (turn as f64 + ping as f64 / pings) * along_m;
                let y_m = ((ping as f64 + offset) % pings) * PERIMETER_M / pings;
                if let Some(row) = rows.get_mut((x_m / TARGET_M) as usize) {
                    row.push([x_m, y_m]);
                }
            }
        }
    }
    let is_empty = |x_m: f64, y_m: f64| {
        let row = (x_m / TARGET_M) as usize;
        rows[row.saturating_sub(1)..(row + 2).min(rows.len())].iter().flatten().all(|[sx, sy]| {
            let across = (sy - y_m).abs();
            let across = across.min(PERIMETER_M - across);
            (sx - x_m) * (sx - x_m) + across * across > TARGET_M * TARGET_M / 4.0
        })
    };
    let fails = |stretch: usize| {
        let from_m = TARGET_M + stretch as f64 * STRETCH_M;
        (0..(STRETCH_M / FINE_M) as u32).any(|i| {
            (0..(PERIMETER_M / FINE_M) as u32)
                .any(|j| is_empty(from_m + f64::from(i) * FINE_M, f64::from(j) * FINE_M))
        })
    };
    (0..STRETCHES).filter(|stretch| !fails(*stretch)).count() as f64 / STRETCHES as f64
}

fn along_m(t_y_m: f64, passes: f64) -> f64 {
    (TARGET_M * TARGET_M - t_y_m * t_y_m).sqrt() / passes
}

#[test]
fn required_passes_leave_no_hole_in_19_of_20_stretches() {
    let rates = [
        LossRate::independent(0.02),
        LossRate::independent(0.1),
        LossRate::independent(0.3),
        LossRate::independent(0.5),
        LossRate { share: 0.1, after_lost: 0.5 },
        LossRate { share: 0.2, after_lost: 0.8 },
    ];
    for t_y_m in [0.07, 0.1, 0.2] {
        for (seed, rate) in (1..).zip(rates) {
            let passes = passes(t_y_m, &[rate]);
            let share = share_passed(along_m(t_y_m, passes), t_y_m, &[rate], seed);
            // The share may be below 0.95, because there are few stretches and neighbouring stretches share holes.
            assert!(share >= 0.87, "steps of {t_y_m} m, {rate:?}: {passes:.2} passes, {share:.2} pass");
        }
    }
}

#[test]
fn too_few_passes_leave_holes_in_over_1_in_10_stretches() {
    let rates =
        [LossRate::independent(0.2), LossRate::independent(0.5), LossRate { share: 0.2, after_lost: 0.8 }];
    for t_y_m in [0.07, 0.1] {
        for (seed, rate) in (1..).zip(rates) {
            let passes = passes(t_y_m, &[rate]) / 1.4;
            let share = share_passed(along_m(t_y_m, passes), t_y_m, &[rate], seed);
            assert!(share < 0.9, "steps of {t_y_m} m, {rate:?}: {passes:.2} passes, {share:.2} pass");
        }
    }
}

#[test]
fn other_heads_make_up_for_the_passes_of_a_silent_head() {
    let sound = LossRate::default();
    let deaf = LossRate::independent(1.0);
    assert!((passes(0.1, &[sound, deaf, sound, sound]) - 2.0).abs() < 1e-12);
    assert!((passes(0.1, &[deaf, deaf, sound, sound]) - 3.0).abs() < 1e-12);
    assert!((passes(0.1, &[deaf]) - MOST_PASSES).abs() < 1e-12);
    // One head is silent and the others lose returns. Together, both losses need more passes than either of them alone.
    let lossy = LossRate::independent(0.1);
    let all = passes(0.1, &[deaf, lossy, lossy, lossy]);
    assert!(all > 2.05 && all > passes(0.1, &[lossy; 4]), "{all}");
    // If all heads have equal loss rates, the number of heads has no effect.
    assert!((passes(0.1, &[lossy; 4]) - passes(0.1, &[lossy])).abs() < 1e-12);
}

#[test]
fn required_passes_grow_continuously_with_losses() {
    for t_y_m in [0.03, 0.1, 0.2, 0.35] {
        let at = |share: f64| passes(t_y_m, &[LossRate::independent(share)]);
        assert!(at(0.002) >= 1.0 && at(0.998) >= 6.0);
        for k in 0..4980 {
            let [mut low, mut high] = [k, k + 1].map(|k| 0.002 + 2e-4 * f64::from(k));
            assert!(at(high) >= at(low) - 1e-9, "steps of {t_y_m} m, {high}: {} to {}", at(low), at(high));
            // The number of passes rises steeply where a run of lost pings becomes as wide as the target.
            for _ in 0..40 {
                let middle = f64::midpoint(low, high);
                if at(middle) - at(low) > at(high) - at(middle) { high = middle } else { low = middle }
            }
            assert!(at(high) <= 1.001 * at(low), "steps of {t_y_m} m, {high}: {} to {}", at(low), at(high));
        }
    }
}

#[test]
fn no_extra_passes_are_needed_without_losses_or_if_no_speed_meets_the_target() {
    assert!((passes(0.1, &[LossRate::default(); 4]) - 1.0).abs() <= 0.0);
    assert!((passes(0.1, &[]) - 1.0).abs() <= 0.0);
    // If samples of a turn are farther apart than the target, no speed meets the target.
    assert!((passes(0.6, &[LossRate::independent(0.5)]) - 1.0).abs() <= 0.0);
}

/// Chance losses often make small holes, and never large holes.
///
/// Without chance losses, no hole counts as caused by chance.
#[test]
fn hole_is_attributed_to_chance_if_enough_losses_can_coincide() {
    let hole = |hole_m: f64, rate: LossRate| sampled(0.1).is_by_chance(hole_m, 0.3, rate);
    let often = LossRate { share: 0.3, after_lost: 0.6 };
    assert!(hole(0.55, often), "the loss of one pass and three pings is likely");
    assert!(!hole(2.0, often), "the loss of nearly five passes of fourteen pings is unlikely");
    let [never, runs] = [LossRate::default(), LossRate { share: 0.58, after_lost: 0.98 }];
    assert!(!hole(0.55, never));
    assert!(hole(2.0, runs), "most of each turn is lost in long runs");
    // If a hole counts as caused by chance, so do smaller holes, and so does the same hole at a higher loss rate.
    for share in 1..9 {
        let rate = LossRate::independent(f64::from(share) / 10.0);
        let largest = |from: i32| (from..60).rev().find(|n| hole(f64::from(*n) / 20.0, rate)).unwrap_or(0);
        let more = LossRate::independent(f64::from(share + 1) / 10.0);
        let of_more = (0..60).rev().find(|n| hole(f64::from(*n) / 20.0, more)).unwrap_or(0);
        assert!(of_more >= largest(0) && (1..=largest(0)).all(|n| hole(f64::from(n) / 20.0, rate)));
    }
}
