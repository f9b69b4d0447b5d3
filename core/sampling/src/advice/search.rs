//! Search for speeds that meet a target, which may form several intervals.

/// Upper end, up to `bound_mps`, of the interval of speeds that meet the target and include `from_mps`.
pub(super) fn upwards_mps(from_mps: f64, bound_mps: f64, meets: impl Fn(f64) -> bool) -> f64 {
    const STEP: f64 = 1.02;
    let mut good = from_mps;
    while good < bound_mps {
        let next = (good * STEP).min(bound_mps);
        if !meets(next) {
            return edge_mps(good, next, meets);
        }
        good = next;
    }
    good
}

/// The largest speed up to `bound_mps` that meets the target, found by stepping down from the bound; zero if none is
/// found.
pub(super) fn downwards_mps(bound_mps: f64, meets: impl Fn(f64) -> bool) -> f64 {
    const TRIED: u32 = 256;
    let at = |k: u32| bound_mps * (1.0 - f64::from(k) / f64::from(TRIED));
    match (0..TRIED).find(|k| meets(at(*k))) {
        None => 0.0,
        Some(0) => bound_mps,
        Some(first) => edge_mps(at(first), at(first - 1), meets),
    }
}

/// `fastest_mps`, which meets the target, reduced by `share`; where that leaves the interval of speeds that meet the
/// target, the middle of the interval.
pub(super) fn kept_back_mps(fastest_mps: f64, share: f64, meets: impl Fn(f64) -> bool) -> f64 {
    let less_mps = fastest_mps * (1.0 - share);
    if fastest_mps <= 0.0 || meets(less_mps) {
        return less_mps;
    }
    f64::midpoint(edge_mps(fastest_mps, less_mps, meets), fastest_mps)
}

/// Edge of the interval, by bisection between a speed that meets the target and one that doesn't.
fn edge_mps(mut good: f64, mut bad: f64, meets: impl Fn(f64) -> bool) -> f64 {
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
    fn what_is_kept_back_does_not_leave_the_stretch() {
        let wide = |mps: f64| (0.1..=0.2).contains(&mps);
        assert!((kept_back_mps(0.2, 0.01, wide) - 0.198).abs() < 1e-12);
        let narrow = |mps: f64| (0.199..=0.2).contains(&mps);
        assert!((kept_back_mps(0.2, 0.01, narrow) - 0.1995).abs() < 1e-9);
        assert!(kept_back_mps(0.0, 0.01, |_| false).abs() <= 0.0);
    }

    #[test]
    fn stretches_are_found_from_within_and_from_above() {
        let islands = |mps: f64| (0.05..=0.1).contains(&mps) || (0.13..=0.15).contains(&mps);
        assert!((upwards_mps(0.06, 0.3, islands) - 0.1).abs() < 1e-9);
        assert!((upwards_mps(0.14, 0.3, islands) - 0.15).abs() < 1e-9);
        assert!((downwards_mps(0.3, islands) - 0.15).abs() < 1e-9);
        assert!(downwards_mps(0.3, |_| false).abs() <= 0.0);
    }
}
