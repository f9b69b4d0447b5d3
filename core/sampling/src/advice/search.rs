//! Search for speeds that meet a target, which may form several intervals.

/// Share by which the advised speed is reduced to allow for errors of the measured speed.
pub const SPEED_MARGIN: f64 = 0.01;

/// Returns the largest speed up to `bound_mps` that meets the target, provided that all lower speeds meet it.
///
/// Zero if no speed meets the target.
pub(super) fn highest_mps(bound_mps: f64, meets: impl Fn(f64) -> bool) -> f64 {
    const LEAST_SHARE: f64 = 1e-3;
    if meets(bound_mps) {
        return bound_mps;
    }
    let least_mps = LEAST_SHARE * bound_mps;
    if meets(least_mps) { edge_mps(least_mps, bound_mps, meets) } else { 0.0 }
}

/// Finds the largest speed up to `bound_mps` that meets the target, by stepping down.
///
/// Zero if no speed meets the target. For a speed that misses the target, `tries` returns the same speed or a lower
/// speed. No speed between these two meets the target.
pub(super) fn downwards_mps(bound_mps: f64, tries: impl Fn(f64) -> Result<(), f64>) -> f64 {
    const TRIED: u32 = 256;
    let at = |k: u32| bound_mps * (1.0 - f64::from(k) / f64::from(TRIED));
    let meets = |speed_mps: f64| tries(speed_mps).is_ok();
    let mut k = 0;
    while k < TRIED {
        match tries(at(k)) {
            Ok(()) if k == 0 => return bound_mps,
            Ok(()) => return edge_mps(at(k), at(k - 1), meets),
            Err(below_mps) => {
                k += 1;
                while k < TRIED && at(k) > below_mps {
                    k += 1;
                }
            }
        }
    }
    0.0
}

/// Returns `fastest_mps`, which meets the target, reduced by `share`.
///
/// If the reduced speed misses the target, the result is midway between `fastest_mps` and the lower limit of the speeds
/// below it that meet the target.
pub(super) fn kept_back_mps(fastest_mps: f64, share: f64, meets: impl Fn(f64) -> bool) -> f64 {
    debug_assert!((0.0..1.0).contains(&share), "a margin is a share of the speed: {share}");
    debug_assert!(fastest_mps >= 0.0, "a speed isn't negative: {fastest_mps} m/s");
    let less_mps = fastest_mps * (1.0 - share);
    if fastest_mps <= 0.0 || meets(less_mps) {
        return less_mps;
    }
    f64::midpoint(edge_mps(fastest_mps, less_mps, meets), fastest_mps)
}

/// Finds the edge of a speed interval by bisection: the speed `good` meets the target, the speed `bad` misses it.
pub(super) fn edge_mps(mut good: f64, mut bad: f64, meets: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..30 {
        let middle = f64::midpoint(good, bad);
        if meets(middle) {
            good = middle;
        } else {
            bad = middle;
        }
    }
    good
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speed_reduced_by_the_margin_stays_within_the_interval() {
        let wide = |mps: f64| (0.1..=0.2).contains(&mps);
        assert!((kept_back_mps(0.2, 0.01, wide) - 0.198).abs() < 1e-12);
        let narrow = |mps: f64| (0.199..=0.2).contains(&mps);
        assert!((kept_back_mps(0.2, 0.01, narrow) - 0.1995).abs() < 1e-9);
        assert!(kept_back_mps(0.0, 0.01, |_| false).abs() <= 0.0);
    }

    #[test]
    fn search_finds_the_upper_end_of_the_highest_speed_interval() {
        let islands = |mps: f64| (0.05..=0.1).contains(&mps) || (0.13..=0.15).contains(&mps);
        assert!((highest_mps(0.3, |mps| mps < 0.1) - 0.1).abs() < 1e-9);
        assert!((highest_mps(0.3, |_| true) - 0.3).abs() <= 0.0 && highest_mps(0.3, |_| false) <= 0.0);
        let tries = |mps: f64| if islands(mps) { Ok(()) } else { Err(mps) };
        let knows = |mps: f64| if islands(mps) { Ok(()) } else { Err(if mps > 0.15 { 0.15 } else { 0.1 }) };
        assert!((downwards_mps(0.3, tries) - 0.15).abs() < 1e-9);
        assert!((downwards_mps(0.3, knows) - downwards_mps(0.3, tries)).abs() <= 0.0);
        assert!(downwards_mps(0.3, Err).abs() <= 0.0 && downwards_mps(0.3, |_| Err(0.0)).abs() <= 0.0);
        assert!((downwards_mps(0.3, |_| Ok(())) - 0.3).abs() <= 0.0);
    }
}
