//! The clock of a simulated dive, and drifting clocks of devices.

use bevy_ecs::prelude::Component;
use headrace_geometry::math;
use headrace_geometry::time::{DurNs, MonoNs};

/// Time at which every simulated dive starts.
pub const START: MonoNs = MonoNs(1_000_000_000);

/// Number of parts into which a second is divided. A clock's drift is a whole number of these parts per second, so that
/// sums have no rounding errors.
const PARTS: i128 = 1_000_000_000_000;

/// A clock that is correct at the start and drifts at a constant rate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Component)]
pub(crate) struct Clock {
    /// Length of a second of this clock minus that of a true second, in parts (see [`PARTS`]).
    longer: i128,
}

impl Clock {
    /// Creates a clock whose seconds are `ppm` millionths too long, so that its device samples late. Range of `ppm`:
    /// +/-10^5.
    pub(crate) fn slow_by_ppm(ppm: f64) -> Self {
        let per_ppm = (PARTS / 1_000_000) as f64;
        Self { longer: i128::from(math::round_to_i64(ppm.clamp(-1e5, 1e5) * per_ppm)) }
    }

    /// True time at which the device's clock shows `shown`.
    pub(crate) fn truly(&self, shown: MonoNs) -> MonoNs {
        let span = i128::from(shown.since(START).0);
        let true_span = span + (span * self.longer).div_euclid(PARTS);
        START + DurNs(i64::try_from(true_span).unwrap_or(i64::MAX))
    }

    /// Earliest time that this clock shows when the true time is `at` or later.
    pub(crate) fn shows(&self, at: MonoNs) -> MonoNs {
        let true_span = i128::from(at.since(START).0);
        let near = (true_span * PARTS).div_euclid(PARTS + self.longer);
        let mut shown = START + DurNs(i64::try_from(near).unwrap_or(i64::MAX));
        while self.truly(shown) < at {
            shown = shown + DurNs(1);
        }
        while self.truly(shown - DurNs(1)) >= at {
            shown = shown - DurNs(1);
        }
        shown
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conversions_between_device_and_true_time_are_inverse() {
        for ppm in [-1000.0, -3.7, 0.0, 1e-6, 20.0, 999.9] {
            let clock = Clock::slow_by_ppm(ppm);
            for after in [0, 1, 17, 999_999_999, 1_000_000_007, 36_000_000_000_000] {
                let at = START + DurNs(after);
                let shown = clock.shows(at);
                assert!(clock.truly(shown) >= at && clock.truly(shown - DurNs(1)) < at, "{ppm} {after}");
                let late_s = clock.truly(at).since(at).as_secs_f64();
                assert!((late_s - after as f64 * 1e-9 * ppm * 1e-6).abs() < 2e-9, "{ppm} {after}: {late_s}");
            }
        }
    }
}
