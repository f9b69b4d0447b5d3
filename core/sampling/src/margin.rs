//! Margins of a target for position errors, and the speed that each margin costs.
//!
//! Plan, live advice and report use the same functions, so that the planned speed equals the advised speed.
//! Source: docs/decisions/0005-advice-and-plan.md.

use crate::target::Target;
use headrace_geometry::math;
use serde::{Deserialize, Serialize};

/// Largest standard deviation of a hole's size for which no margin is needed, m. Navigation without error estimates
/// causes about this standard deviation.
const NOTHING_M: f64 = 0.002;
/// The margin for position errors leaves at least this share of the allowed distance between passes.
///
/// A larger margin does not help, because no speed compensates for a lost position.
const LEFT_SHARE: f64 = 0.6;
/// Maximum share of the target that the margin for position errors takes.
const MOST_SHARE: f64 = 0.2;
/// Share of the travel time from the foremost to the rearmost head that counts towards the time between passes.
///
/// The share is below 1 for two reasons. Only some neighbouring passes are by the foremost and the rearmost head, and
/// holes between their passes grow by less than the heads' separation. With this share, 93 % of the errors of a hole's
/// size D are within two standard deviations, in the dives of `tests/tests/navigation/fusion.rs` with four heads. In
/// similar dives, it is 80 % of the errors with a share of 0, and 99 % with a share of 1.
pub const APART_SHARE: f64 = 0.4;
/// Speed below which a vehicle counts as at rest, m/s.
const SLOW_MPS: f64 = 0.01;
/// Largest assumed time until the rearmost head reaches the position of the foremost head, seconds.
const LONGEST_APART_S: f64 = 20.0;

/// Time over which position errors accumulate between neighbouring passes of a place, s.
///
/// The time is the sum of two terms: the time between two passes of evenly spread heads, and a share of the time
/// until the rearmost head reaches the position of the foremost head. `passes_per_s` is the sum of the heads' turns per
/// second, above zero; `apart_m` is the length of hull between the foremost and the rearmost head.
pub fn error_time_s(passes_per_s: f64, apart_m: f64, speed_mps: f64, apart_share: f64) -> f64 {
    let apart_s = (apart_m / speed_mps.abs().max(SLOW_MPS)).min(LONGEST_APART_S);
    1.0 / passes_per_s + apart_share * apart_s
}

/// Part of a target reserved for position errors, m.
///
/// The margin is the confidence times the standard deviation `pass_error_m` of a hole's size. `t_y_m` is the largest
/// distance between neighbouring samples of one turn. The margin is continuous in all inputs, and at most a fifth of
/// the target. With the margin, the allowed distance between passes is at least three fifths of the distance allowed
/// without margin. A larger margin costs more speed than it is worth.
pub fn position_margin_m(target: Target, pass_error_m: f64, t_y_m: f64) -> f64 {
    let target_m = target.max_hole_m;
    let along_m2 = (target_m * target_m - t_y_m * t_y_m).max(0.0);
    let least_m = math::sqrt(LEFT_SHARE * LEFT_SHARE * along_m2 + t_y_m * t_y_m);
    let most_m = (target_m - least_m).clamp(0.0, MOST_SHARE * target_m);
    let margin_m = target.error_m((pass_error_m - NOTHING_M).max(0.0)).min(most_m);
    debug_assert!(
        (0.0..=MOST_SHARE * target_m).contains(&margin_m),
        "a margin is at most a fifth of the target of {target_m} m: {margin_m} m"
    );
    margin_m
}

/// Exponent with which position errors grow with the time between two passes.
///
/// The exponent lies between 0.5, for independent noise, and 1, for drifting speeds. On a swaying VITA 2 with two
/// heads, the position error is 21 mm after 8.5 s and 23 to 26 mm after 11.2 s.
const GROWTH: f64 = 0.7;

/// Target minus the margin for position errors, as a function of speed.
///
/// The position errors are known at the present speed only. At half the present speed, the time between passes of heads
/// that are apart along the hull is twice as long, and the margin is larger.
#[derive(Debug, Clone, Copy)]
pub struct RemainingTarget {
    /// Coverage target, with the confidence of verdicts.
    pub target: Target,
    /// Standard deviation of a hole's size as measured at the present speed, m.
    pub pass_error_m: f64,
    /// Value of [`error_time_s`] when `pass_error_m` was measured, seconds.
    pub measured_s: f64,
    /// Time between two passes of evenly spread heads, seconds.
    pub even_gap_s: f64,
    /// Length of hull between the foremost and the rearmost head, m.
    pub apart_m: f64,
    /// The largest distance between neighbouring samples of one turn, m.
    pub t_y_m: f64,
}

impl RemainingTarget {
    /// Returns the target minus the margin at a speed, m; grows continuously with speed.
    pub fn at_m(&self, speed_mps: f64) -> f64 {
        let time_s = error_time_s(1.0 / self.even_gap_s, self.apart_m, speed_mps, APART_SHARE);
        // If no heads turn, the time between passes is unknown, and the measured error is used unchanged.
        let same = self.measured_s <= 0.0 || (time_s - self.measured_s).abs() <= f64::EPSILON * time_s;
        let growth = if same { 1.0 } else { math::exp(GROWTH * math::ln(time_s / self.measured_s)) };
        let error_m = self.pass_error_m * growth;
        self.target.max_hole_m - position_margin_m(self.target, error_m, self.t_y_m)
    }

    /// Returns the target minus the margin for position errors at unlimited speed, m.
    pub fn most_m(&self) -> f64 {
        self.at_m(f64::INFINITY)
    }
}

/// Expected position errors between two passes, before a dive.
#[derive(Debug, Clone, PartialEq)]
pub struct ExpectedErrors {
    /// Confidence k: the hole in a passed section is smaller than the target by at least k standard deviations of its
    /// size.
    pub confidence_sd: f64,
    /// Times between two passes, s, in ascending order. With each time comes the standard deviation of a hole's size,
    /// m.
    pub by_time: Vec<[f64; 2]>,
}

impl ExpectedErrors {
    /// Returns the standard deviation of a hole's size after a time between passes, m.
    ///
    /// The value is interpolated between the entries, and proportional to time beyond the last entry.
    pub fn pass_error_m(&self, time_s: f64) -> f64 {
        let mut before = [0.0, 0.0];
        for &after in &self.by_time {
            if after[0] >= time_s {
                let share = (time_s - before[0]) / (after[0] - before[0]).max(f64::MIN_POSITIVE);
                return before[1] + share * (after[1] - before[1]);
            }
            before = after;
        }
        if before[0] > 0.0 { before[1] * time_s / before[0] } else { 0.0 }
    }
}

/// A cause that lowers the largest speed below that of the ideal geometry, or the ideal geometry itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Margin {
    /// Ideal geometry: only the distance that the vehicle travels between two passes limits the speed.
    Geometry,
    /// Wall that the vehicle hides from some of its heads, or that is outside their range limits.
    Hidden,
    /// Passes that are unevenly spread, because heads are not evenly phased or are side by side.
    Phase,
    /// Beams that swing along the wall because the vehicle yaws or pitches.
    Swing,
    /// Uncertain position of the vehicle.
    Position,
    /// Sonar returns that the heads lose by chance.
    Losses,
}

impl Margin {
    /// All causes of lower speed, in the order in which their margins are added.
    pub const ALL: [Self; 6] =
        [Self::Geometry, Self::Hidden, Self::Phase, Self::Swing, Self::Position, Self::Losses];

    /// Name of the cause in reports and logs.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Geometry => "geometry",
            Self::Hidden => "hidden",
            Self::Phase => "phase",
            Self::Swing => "swing",
            Self::Position => "position",
            Self::Losses => "losses",
        }
    }
}

/// Largest speeds without margins, with one margin, with two margins, and so on, m/s; they never increase.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Margins {
    /// Speed for evenly phased heads at one place, without hidden wall, swing and position errors.
    pub geometry_mps: f64,
    /// Speed after hidden wall is also taken into account.
    pub hidden_mps: f64,
    /// Speed after the phases and positions of the heads are also taken into account.
    pub phase_mps: f64,
    /// Speed after the swing of beams is also taken into account.
    pub swing_mps: f64,
    /// Speed after position errors are also taken into account.
    pub position_mps: f64,
    /// Speed after lost returns are also taken into account: the largest speed that meets the target.
    pub losses_mps: f64,
    /// Standard deviation, m, of the size of a hole between two passes, as assumed for `position_mps`.
    pub pass_error_m: f64,
}

impl Margins {
    /// Creates margins from speeds in the order of [`Margin::ALL`], m/s.
    ///
    /// In the result, no speed exceeds the speed before it.
    pub fn of(speeds_mps: [f64; 6], pass_error_m: f64) -> Self {
        // Each speed is raised to the largest later speed, so that a margin with a negative cost counts as zero.
        let mut most = 0.0_f64;
        let mut speeds = speeds_mps;
        for speed in speeds.iter_mut().rev() {
            most = most.max(*speed);
            *speed = most;
        }
        let [geometry_mps, hidden_mps, phase_mps, swing_mps, position_mps, losses_mps] = speeds;
        Self { geometry_mps, hidden_mps, phase_mps, swing_mps, position_mps, losses_mps, pass_error_m }
    }

    /// Returns the largest speeds in the order of [`Margin::ALL`], m/s.
    pub fn speeds_mps(&self) -> [f64; 6] {
        let Self { geometry_mps, hidden_mps, phase_mps, swing_mps, position_mps, losses_mps, .. } = *self;
        [geometry_mps, hidden_mps, phase_mps, swing_mps, position_mps, losses_mps]
    }

    /// Returns the speed that each margin costs, m/s, in the order of [`Margin::ALL`] without its first entry.
    pub fn prices_mps(&self) -> [(Margin, f64); 5] {
        let [geometry, hidden, phase, swing, position, losses] = self.speeds_mps();
        [
            (Margin::Hidden, geometry - hidden),
            (Margin::Phase, hidden - phase),
            (Margin::Swing, phase - swing),
            (Margin::Position, swing - position),
            (Margin::Losses, position - losses),
        ]
    }

    /// Returns the margin with the highest cost.
    ///
    /// The result is [`Margin::Geometry`] if no margin costs more than a twentieth of the speed.
    pub fn costliest(&self) -> Margin {
        const NOTABLE: f64 = 0.05;
        let costly = self.prices_mps().into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
        costly
            .filter(|(_, price_mps)| *price_mps > NOTABLE * self.geometry_mps)
            .map_or(Margin::Geometry, |(margin, _)| margin)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TARGET: Target = Target { max_hole_m: 0.5, confidence_sd: 2.0 };

    #[test]
    fn position_margin_is_a_limited_multiple_of_the_standard_deviation() {
        let margin_m = |pass_error_m: f64, t_y_m: f64| position_margin_m(TARGET, pass_error_m, t_y_m);
        assert!((margin_m(0.017, 0.1) - 0.03).abs() < 1e-12);
        assert!(margin_m(0.002, 0.1).abs() <= 0.0 && margin_m(0.0, 0.1).abs() <= 0.0);
        assert!((margin_m(1.0, 0.1) - 0.1).abs() < 1e-12, "at most a fifth of the target");
        // Here the distance between samples of one turn nearly equals the target. The margin then reduces the allowed
        // distance between passes to three fifths of the distance without margin.
        let sure_m = 0.5 - margin_m(1.0, 0.48);
        assert!((math::sqrt(sure_m * sure_m - 0.48 * 0.48) / 0.14 - 0.6).abs() < 1e-9);
        assert!(margin_m(0.1, 0.5).abs() <= 0.0 && margin_m(0.1, 0.6).abs() <= 0.0);
    }

    #[test]
    fn position_margin_is_continuous() {
        let mut before = position_margin_m(TARGET, 0.0, 0.3);
        for k in 1..=2000 {
            let now = position_margin_m(TARGET, 1e-4 * f64::from(k), 0.3);
            assert!((0.0..=2.1e-4).contains(&(now - before)), "{k}");
            before = now;
        }
    }

    #[test]
    fn expected_error_grows_with_the_time_between_passes() {
        let errors = ExpectedErrors { confidence_sd: 2.0, by_time: vec![[2.0, 0.006], [4.0, 0.01]] };
        let all = [1.0, 2.0, 3.0, 4.0, 8.0].map(|time_s| errors.pass_error_m(time_s));
        assert!(all.iter().zip([0.003, 0.006, 0.008, 0.01, 0.02]).all(|(a, b)| (a - b).abs() < 1e-12));
        let unknown = ExpectedErrors { by_time: Vec::new(), ..errors };
        assert!(unknown.pass_error_m(3.0).abs() <= 0.0);
        assert!((error_time_s(0.5, 1.0, 0.1, 0.4) - 6.0).abs() < 1e-12);
        assert!((error_time_s(0.5, 1.0, 0.0, 0.4) - 10.0).abs() < 1e-12, "at rest");
    }

    /// The margin at a speed is the same, whether the errors were measured at this speed or at another speed.
    #[test]
    fn margin_does_not_depend_on_the_speed_at_which_errors_were_measured() {
        let sure = RemainingTarget {
            target: TARGET,
            pass_error_m: 0.012,
            measured_s: error_time_s(0.25, 0.8, 0.1, APART_SHARE),
            even_gap_s: 4.0,
            apart_m: 0.8,
            t_y_m: 0.1,
        };
        assert!((sure.at_m(0.1) - (0.5 - 2.0 * 0.01)).abs() < 1e-9);
        // Each expected error time is 4 s plus 0.4 of 16 s, 8 s or 0 s.
        let times_s = [10.4, 7.2, 4.0];
        let error_m = |time_s: f64| 0.012 * math::exp(GROWTH * math::ln(time_s / times_s[1]));
        let at = [0.05, 0.1, f64::INFINITY].map(|speed_mps| sure.at_m(speed_mps));
        let expected = times_s.map(|time_s| 0.5 - 2.0 * (error_m(time_s) - NOTHING_M));
        assert!(at.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{at:?} {expected:?}");
        let elsewhere = RemainingTarget {
            pass_error_m: error_m(times_s[0]),
            measured_s: error_time_s(0.25, 0.8, -0.05, APART_SHARE),
            ..sure
        };
        let speeds_mps = (1..100).map(|k| 0.003 * f64::from(k));
        assert!({ speeds_mps }.all(|v_mps| (elsewhere.at_m(v_mps) - sure.at_m(v_mps)).abs() < 1e-12));
        let side_by_side = RemainingTarget { apart_m: 0.0, measured_s: 4.0, ..sure };
        assert!((side_by_side.at_m(0.02) - side_by_side.most_m()).abs() <= 0.0);
        let without_heads = RemainingTarget { even_gap_s: 0.0, measured_s: 0.0, apart_m: 0.0, ..sure };
        assert!((without_heads.at_m(0.1) - (0.5 - 2.0 * 0.01)).abs() < 1e-12);
    }

    #[test]
    fn margin_costs_add_up_and_the_costliest_is_named() {
        let margins = Margins::of([0.23, 0.118, 0.117, 0.118, 0.108, 0.1], 0.02);
        // A negative cost of swing is set to zero, and does not reduce the cost of phase.
        let expected = [0.23, 0.118, 0.118, 0.118, 0.108, 0.1];
        assert!(margins.speeds_mps().iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12));
        let sum: f64 = margins.prices_mps().iter().map(|(_, price)| price).sum();
        assert!((sum - (0.23 - 0.1)).abs() < 1e-12);
        assert_eq!(margins.costliest(), Margin::Hidden);
        assert_eq!(Margins::of([0.1; 6], 0.0).costliest(), Margin::Geometry);
    }
}
