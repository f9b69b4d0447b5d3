//! Weight of head returns from bumps that the heads have seen before.
//!
//! A stationary vehicle sees the same bumps in every turn of its heads. If each turn counted as new information,
//! the estimate would become wrong and overconfident. Derivation: `docs/why/navigation.md`, "Noise that is learnt".

use serde::{Deserialize, Serialize};

use super::settings::Settings;
use headrace_geometry::math;

/// Maximum share of a return's range variance that is assumed to come from bumps of the wall.
const MOST_BUMPS: f64 = 0.9;
/// Largest number of passes over the same bumps that is counted.
///
/// Returns from repeated bumps must keep some weight, because the estimate would drift on gyros alone.
const MOST_PASSES: f64 = 10.0;

/// Counts how often the heads have passed over the bumps that they see now.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct RepeatedBumps {
    /// Chainage of the vehicle when its heads began to see the present bumps, m.
    from_m: Option<f64>,
    /// Number of returns of all heads since the heads began to see the present bumps.
    returns: u32,
}

impl RepeatedBumps {
    /// Restarts the count of passes if the vehicle has moved on; `x_m` is its chainage.
    pub(super) fn pass(&mut self, x_m: f64, settings: &Settings) {
        if self.from_m.is_none_or(|from_m| (x_m - from_m).abs() >= settings.seen_again_m) {
            *self = Self { from_m: Some(x_m), returns: 0 };
        }
    }

    /// Returns how often the heads have seen a bump on average, including the present pass; at least 1.
    ///
    /// A turn sees each bump once. In the middle of the present turn, half of the bumps have been seen once more. So
    /// the mean number of passes is the number of turns plus one half.
    fn passes(&self, settings: &Settings) -> f64 {
        (0.5 + f64::from(self.returns) * settings.return_step_rad / math::TAU).clamp(1.0, MOST_PASSES)
    }

    /// Counts a return, and returns the variance with which to fuse it, m^2.
    ///
    /// `declared_m2` is the variance of a single return, and `bumps` is the share of it that comes from bumps. All
    /// returns from one bump together weigh as much as their mean. So each return gets a variance with which it adds
    /// only the weight that is new.
    pub(super) fn noise_m2(
        &mut self,
        range_m: f64,
        declared_m2: f64,
        bumps: f64,
        settings: &Settings,
    ) -> f64 {
        let passes = self.passes(settings);
        self.returns = self.returns.saturating_add(1);
        let step_m = settings.return_step_rad * range_m;
        // Number of returns from the same bump within one pass.
        let around = if step_m > 0.0 { (settings.bump_m / step_m).max(1.0) } else { 1.0 };
        let bumps_m2 = bumps.min(MOST_BUMPS) * declared_m2;
        let own_m2 = (declared_m2 - bumps_m2) / around;
        around * (own_m2 + passes * bumps_m2) * (own_m2 + (passes - 1.0) * bumps_m2) / own_m2
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DECLARED_M2: f64 = 9e-4;

    /// Returns the noise variance of a return after `passes` passes, if `around` returns of a turn see the same bump.
    fn noise_m2(passes: f64, around: f64, bumps: f64) -> f64 {
        let settings = Settings::default();
        let returns = math::round_to_i64((passes - 0.5) * math::TAU / settings.return_step_rad);
        let mut seen = RepeatedBumps { from_m: Some(7.0), returns: u32::try_from(returns).unwrap() };
        seen.noise_m2(settings.bump_m / settings.return_step_rad / around, DECLARED_M2, bumps, &settings)
    }

    /// In a least-squares sum, all returns from one bump together weigh as much as their mean.
    #[test]
    fn returns_from_one_bump_together_weigh_as_much_as_their_mean() {
        let bumps = 0.6;
        for around in [1.0, 4.0] {
            let mut information = 0.0;
            for passes in 1..=10 {
                let passes = f64::from(passes);
                information += around / noise_m2(passes, around, bumps);
                let mean_m2 = DECLARED_M2 * (bumps + (1.0 - bumps) / (around * passes));
                assert!((information * mean_m2 - 1.0).abs() < 1e-9, "{passes} of {around}: {information}");
            }
        }
    }

    #[test]
    fn repeated_passes_count_fully_on_a_smooth_wall_but_hardly_on_a_rough_one() {
        assert!((noise_m2(9.0, 1.0, 0.0) - DECLARED_M2).abs() < 1e-15);
        assert!(noise_m2(9.0, 1.0, 1.0) > 100.0 * DECLARED_M2);
        // Even after an hour at rest, returns from repeated bumps keep this small weight.
        assert!((noise_m2(1e6, 1.0, 1.0) - noise_m2(MOST_PASSES, 1.0, 1.0)).abs() < 1e-15);
    }

    /// Passes are counted while the vehicle is stationary. The count restarts after a short motion ahead or astern.
    #[test]
    fn passes_over_a_bump_accumulate_until_the_vehicle_moves_on() {
        let settings = Settings::default();
        let mut seen = RepeatedBumps::default();
        let mut after = |returns: u32, x_m: f64| {
            seen.pass(x_m, &settings);
            (0..returns).for_each(|_| _ = seen.noise_m2(6.0, DECLARED_M2, 0.5, &settings));
            seen.passes(&settings)
        };
        // A turn of a head has 120 returns.
        let passes = [(0, 7.0), (120, 7.01), (240, 7.0), (60, 7.06), (0, 7.03), (0, 7.0)]
            .map(|(n, x_m)| after(n, x_m));
        for (found, right) in passes.iter().zip([1.0, 1.5, 3.5, 1.0, 1.0, 1.0]) {
            assert!((found - right).abs() < 1e-9, "{passes:?}");
        }
    }
}
