//! How much the returns of heads say that see bumps which heads have seen before. A vehicle that stands sees the same ones turn after turn:
//! taken for news each time, they turn the estimate as surely as wrongly. Derivation: `docs/why/navigation.md`, "Bumps seen again".

use serde::{Deserialize, Serialize};

use super::settings::Settings;
use headrace_geometry::math;

/// Largest share of bumps in a return's noise.
const MOST_BUMPS: f64 = 0.9;
/// Most passes that count: an estimate that gyros alone would carry away is still held by what is seen again.
const MOST_PASSES: f64 = 10.0;

/// How often heads have passed the bumps that they see.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct SeenAgain {
    /// Where they began to see these: chainage, m.
    from_m: Option<f64>,
    /// Returns since, of all heads.
    returns: u32,
}

impl SeenAgain {
    /// Notes where the vehicle is, m.
    pub(super) fn pass(&mut self, x_m: f64, settings: &Settings) {
        if self.from_m.is_none_or(|from_m| (x_m - from_m).abs() >= settings.seen_again_m) {
            *self = Self { from_m: Some(x_m), returns: 0 };
        }
    }

    /// How often a bump has been seen, this time with it, at least 1: of a turn that has begun, half the bumps have been seen once more.
    fn passes(&self, settings: &Settings) -> f64 {
        (0.5 + f64::from(self.returns) * settings.return_step_rad / math::TAU).clamp(1.0, MOST_PASSES)
    }

    /// Takes a return of this range; variance with which it is fused, m^2: by itself it has the `declared_m2`, of which bumps are a share.
    ///
    /// n looks at one bump say together what their mean does; each has the noise of what it adds to those before.
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
        // So many of one pass see it.
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

    /// The noise of a return after so many passes, at a range at which `around` returns of a turn see one bump.
    fn noise_m2(passes: f64, around: f64, bumps: f64) -> f64 {
        let settings = Settings::default();
        let returns = math::round_to_i64((passes - 0.5) * math::TAU / settings.return_step_rad);
        let mut seen = SeenAgain { from_m: Some(7.0), returns: u32::try_from(returns).unwrap() };
        seen.noise_m2(settings.bump_m / settings.return_step_rad / around, DECLARED_M2, bumps, &settings)
    }

    /// Weighed as least squares would, returns that see one bump say together what their mean says.
    #[test]
    fn returns_that_see_one_bump_say_together_what_their_mean_says() {
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
    fn a_smooth_wall_is_news_each_time_and_a_rough_one_hardly_again() {
        assert!((noise_m2(9.0, 1.0, 0.0) - DECLARED_M2).abs() < 1e-15);
        assert!(noise_m2(9.0, 1.0, 1.0) > 100.0 * DECLARED_M2);
        // What stands for an hour is still held, by as little as this.
        assert!((noise_m2(1e6, 1.0, 1.0) - noise_m2(MOST_PASSES, 1.0, 1.0)).abs() < 1e-15);
    }

    /// Passes add up while the vehicle stands, and begin anew a little way on, ahead or astern.
    #[test]
    fn passes_are_counted_until_the_vehicle_moves_on() {
        let settings = Settings::default();
        let mut seen = SeenAgain::default();
        let mut after = |returns: u32, x_m: f64| {
            seen.pass(x_m, &settings);
            (0..returns).for_each(|_| _ = seen.noise_m2(6.0, DECLARED_M2, 0.5, &settings));
            seen.passes(&settings)
        };
        // 120 returns are a turn.
        let passes = [(0, 7.0), (120, 7.01), (240, 7.0), (60, 7.06), (0, 7.03), (0, 7.0)]
            .map(|(n, x_m)| after(n, x_m));
        for (found, right) in passes.iter().zip([1.0, 1.5, 3.5, 1.0, 1.0, 1.0]) {
            assert!((found - right).abs() < 1e-9, "{passes:?}");
        }
    }
}
