//! Equations of Jorge et al. 2021 for the spacing of samples: a rotating head on a moving vehicle.

use super::error::{SamplingError, not_negative, positive};
use super::head::Turn;
use headrace_geometry::math;

/// T_max, m: the longer diagonal of the parallelogram of four neighbouring samples.
///
/// `t_x_m` is the distance between passes, `advance_m` (d) the distance travelled between two pings, and `t_y_m` the
/// largest distance between neighbouring samples of one turn. All arguments are finite.
/// Source: Jorge et al. 2021, Eq. 16.
pub fn t_max_m(t_x_m: f64, advance_m: f64, t_y_m: f64) -> f64 {
    math::hypot(t_x_m + advance_m, t_y_m)
}

/// The speed at which T_max equals the target, m/s.
///
/// `None` if `t_y_m` alone reaches the target, or if the times aren't positive. `pass_gap_s` is the time between passes
/// (T_rev / s for s evenly interleaved heads), `ping_period_s` the time between pings (T_s).
/// Source: Jorge et al. 2021, Eq. 16, solved for v (docs/decisions/0005-advice-and-plan.md).
pub fn speed_for_target_mps(target_m: f64, t_y_m: f64, pass_gap_s: f64, ping_period_s: f64) -> Option<f64> {
    let time_s = pass_gap_s + ping_period_s;
    along_m(target_m, t_y_m).filter(|_| time_s > 0.0).map(|along_m| along_m / time_s)
}

/// Largest allowed sum of the distance between passes and the advance between pings, m: sqrt(T^2 - T_y^2) for the
/// target T.
///
/// `None` if `t_y_m` alone reaches the target.
pub(super) fn along_m(target_m: f64, t_y_m: f64) -> Option<f64> {
    // The form (T - T_y)(T + T_y) avoids cancellation if T_y is close to T.
    (t_y_m < target_m).then(|| math::sqrt((target_m - t_y_m) * (target_m + t_y_m)))
}

/// The spiral of samples that a turning head leaves on the wall at a constant vehicle speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spiral {
    speed_mps: f64,
    turn: Turn,
    passes_per_turn: f64,
}

impl Spiral {
    /// Creates the spiral.
    ///
    /// `passes_per_turn` is the number of passes over a place in the time of one turn: 1 for a single head, s for s
    /// heads in phase shift, s / 2 for s heads in sectors. At a speed of zero, all distances along the tunnel are
    /// zero.
    ///
    /// Errors: a negative speed, passes that are not positive, or a value that is not finite.
    pub fn new(speed_mps: f64, turn: Turn, passes_per_turn: f64) -> Result<Self, SamplingError> {
        not_negative("the speed in m/s", speed_mps)?;
        positive("the number of passes in a turn", passes_per_turn)?;
        Ok(Self { speed_mps, turn, passes_per_turn })
    }

    /// d, m: the distance travelled between two pings. Source: Jorge et al. 2021, Eq. 11.
    pub fn advance_m(&self) -> f64 {
        self.speed_mps * self.turn.ping_period_s()
    }

    /// T_x of one head, m: the distance travelled in a turn. Source: Jorge et al. 2021, Eq. 12.
    pub fn pitch_m(&self) -> f64 {
        self.speed_mps * self.turn.period_s()
    }

    /// Distance along the tunnel between passes over a place, m, for s heads: T_x / s in phase shift, at most 2 T_x / s
    /// in sectors.
    /// Source: Jorge et al. 2021, §5.1 and §5.2.
    pub fn t_x_m(&self) -> f64 {
        self.pitch_m() / self.passes_per_turn
    }

    /// T_ymax, m: largest distance between samples of a turn, computed from `t_y2_m`, the largest distance for a head
    /// at rest.
    /// Source: Jorge et al. 2021, Eq. 13.
    pub fn t_y_max_m(&self, t_y2_m: f64) -> f64 {
        math::hypot(self.advance_m(), t_y2_m)
    }

    /// T_ymin, m: smallest distance between samples of a turn, computed from the smallest distance for a head at rest
    /// (T_y1 or T_c). Source: Jorge et al. 2021, Eq. 14.
    pub fn t_y_min_m(&self, smallest_step_m: f64) -> f64 {
        math::hypot(self.advance_m(), smallest_step_m)
    }

    /// Mean distance between samples of a turn, m, by Eq. 15 as printed; `t_yp_m` is the mean distance for a head at
    /// rest.
    ///
    /// The term (n d)^2 under the root of Eq. 15 combines a whole turn's advance with the distance of a single step.
    /// [`Spiral::t_y_mean_m`] uses the advance between two pings instead.
    /// Source: Jorge et al. 2021, Eq. 15.
    pub fn t_y_mean_printed_m(&self, t_yp_m: f64) -> f64 {
        math::hypot(f64::from(self.turn.steps()) * self.advance_m(), t_yp_m)
    }

    /// Mean distance between samples of a turn, m. It combines `t_yp_m`, the mean distance for a head at rest, with the
    /// advance between two pings.
    pub fn t_y_mean_m(&self, t_yp_m: f64) -> f64 {
        math::hypot(self.advance_m(), t_yp_m)
    }

    /// T_max: largest spacing of samples, m, from `t_y2_m`, the largest distance between samples of a turn for a head
    /// at rest. Source: Jorge et al. 2021, Eq. 16.
    pub fn t_max_m(&self, t_y2_m: f64) -> f64 {
        t_max_m(self.t_x_m(), self.advance_m(), t_y2_m)
    }

    /// T_mean: mean spacing of samples, m, from the mean distance between samples of a turn, which includes the advance
    /// between pings. Source: Jorge et al. 2021, Eq. 17.
    pub fn t_mean_m(&self, t_y_mean_m: f64) -> f64 {
        t_max_m(self.t_x_m(), self.advance_m(), t_y_mean_m)
    }

    /// T_min: smallest spacing of samples, m, from the smallest distance between samples of a turn, which includes the
    /// advance between pings.
    /// Source: Jorge et al. 2021, Eq. 18.
    pub fn t_min_m(&self, t_y_min_m: f64) -> f64 {
        t_max_m(self.t_x_m(), self.advance_m(), t_y_min_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formulas_equal_hand_computed_values() {
        let fast = Turn::new(f64::to_radians(0.9), 8.0).unwrap();
        let one = Spiral::new(0.197, fast, 1.0).unwrap();
        assert!((one.advance_m() - 0.003_94).abs() < 1e-15);
        assert!((one.pitch_m() - 1.576).abs() < 1e-12 && (one.t_x_m() - 1.576).abs() < 1e-12);
        let four = Spiral::new(0.197, fast, 4.0).unwrap();
        assert!((four.t_x_m() - 0.394).abs() < 1e-12);
        // The expected T_max is sqrt(0.39794^2 + 0.18^2).
        assert!((four.t_max_m(0.18) - 0.436_756_6).abs() < 1e-6);
        assert!((one.t_y_mean_printed_m(0.085) - math::hypot(1.576, 0.085)).abs() < 1e-12);
        assert!((one.t_y_mean_m(0.085) - 0.085_091_3).abs() < 1e-6);
    }

    #[test]
    fn distances_along_the_tunnel_are_zero_at_rest() {
        let turn = Turn::new(f64::to_radians(0.9), 8.0).unwrap();
        let rest = Spiral::new(0.0, turn, 2.0).unwrap();
        assert_eq!((rest.advance_m(), rest.t_x_m(), rest.t_max_m(0.2)), (0.0, 0.0, 0.2));
        for speed in [-0.1, f64::NAN, f64::INFINITY] {
            let why = Spiral::new(speed, turn, 2.0).unwrap_err().to_string();
            assert!(why.starts_with("the speed in m/s is"), "{why}");
        }
        assert!(Spiral::new(0.2, turn, 0.0).is_err());
    }

    #[test]
    fn spacing_at_the_speed_for_a_target_equals_the_target() {
        let v = speed_for_target_mps(0.5, 0.12, 2.0, 0.02).unwrap();
        assert!((t_max_m(v * 2.0, v * 0.02, 0.12) - 0.5).abs() < 1e-12);
        assert_eq!(speed_for_target_mps(0.5, 0.5, 2.0, 0.02), None);
        assert_eq!(speed_for_target_mps(0.5, 0.1, 0.0, 0.0), None);
        assert_eq!(speed_for_target_mps(f64::NAN, 0.1, 2.0, 0.02).filter(|v| v.is_finite()), None);
    }
}
