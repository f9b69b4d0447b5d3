//! The speed relative to its limit.

use serde::{Deserialize, Serialize};

/// Ratio of the speed to v_max above which the speed is over v_max.
///
/// The margin covers the measurement error and the advice's own margin.
const OVER: f64 = 1.02;
/// Ratio of the speed to v_max above which the speed is too fast. A pilot who follows the advice stays below
/// this ratio.
const TOO_FAST: f64 = 1.05;
/// A band is left only this far below the ratio at which it begins, so that a steady speed stays in one band.
const HOLD: f64 = 0.02;

/// The speed relative to v_max.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
pub enum SpeedBand {
    /// The speed is at most v_max, or there is no v_max.
    #[default]
    Within,
    /// The speed is slightly over v_max.
    Over,
    /// The speed is well over v_max.
    TooFast,
}

impl SpeedBand {
    /// Band for a ratio of speed to v_max. `before` is the previous band.
    pub(super) fn after(before: Self, share: f64) -> Self {
        let begins = |band: Self, at: f64| share > if before >= band { at - HOLD } else { at };
        if begins(Self::TooFast, TOO_FAST) {
            Self::TooFast
        } else if begins(Self::Over, OVER) {
            Self::Over
        } else {
            Self::Within
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A speed that varies by one percent around the limit of a band stays in one band.
    #[test]
    fn steady_speed_stays_in_one_band() {
        for about in [OVER, TOO_FAST] {
            let mut band = SpeedBand::Within;
            let bands = (0..20).map(|k| {
                band = SpeedBand::after(band, about + if k % 2 == 0 { 0.009 } else { -0.009 });
                band
            });
            let bands: Vec<SpeedBand> = bands.collect();
            assert!(bands.iter().all(|band| *band == bands[0]), "{bands:?}");
        }
        assert_eq!(SpeedBand::after(SpeedBand::TooFast, 1.0), SpeedBand::Within);
    }
}
