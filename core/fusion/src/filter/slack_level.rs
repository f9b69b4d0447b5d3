//! Size and speed of the cable's slack, measured by comparing the counter with inertial motion.
//!
//! The difference between counter and inertial motion contains the slack. It also contains the effect of the inertial
//! unit's constant errors, which is a polynomial of second degree in time. So the third differences of counter minus
//! inertial motion show the slack alone. They are taken at several lags and compared with those of the slack model. If
//! the observed ones are larger, the slack is larger or faster than declared. A single third difference far above the
//! usual size means that the counter or the inertial unit has failed. The comparison does not depend on the filter's
//! use of cable readings, because it uses only the heading of the estimate. Summary: `docs/why/navigation.md`, "Slack".
//!
//! With u the counter minus the inertial track, and c(x T) = (1 + x) e^-x the correlation of slack of time constant T:
//!
//! ```text
//! d(L) = u(t) - 3 u(t - L) + 3 u(t - 2 L) - u(t - 3 L)
//!
//! mean square of d(L), the sum of:
//!     slack                                                    sd^2 (20 - 30 c(L) + 12 c(2 L) - 2 c(3 L))
//!     counter noise of variance n                              20 n
//!     force noise f; walk w of tilt and accelerometer bias     f^2 L^3 + 0.55 w^2 L^5
//!     gyro bias of variance P that wanders by q per second     g^2 P (1 - e^(-40 s q / P)) L^6
//! ```

use super::inertial::InertialSample;
use super::settings::{GaussMarkov, Settings};
use super::state::{State, matrix, rotation, rotation_vector};
use headrace_geometry::frames::{Body, Rot, Tunnel, Vec3};
use headrace_geometry::math;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::{DurNs, MonoNs};

/// Time lags over which third differences are taken, s.
const LAGS_S: [f64; 4] = [0.5, 1.0, 2.0, 4.0];
/// Capacity for differences between counter and inertial motion: ten per second for three times the longest lag.
const ROOM: usize = 256;
/// Maximum number of inertial samples in an epoch.
const KNOTS: usize = 256;
/// Averaging time for the mean squares of third differences, s.
const MEMORY_S: f64 = 40.0;
/// Multiple of the rms at which a third difference is clipped. Rare large values come from faults, not from slack.
const MOST_SDS: f64 = 3.0;
/// Before noise is subtracted from a mean square, the noise is raised by this many sds of the mean square.
///
/// The margin is needed because few of the averaged differences are independent.
const MARGIN_SDS: f64 = 1.5;
/// Time constant with which the inertial velocity decays, s. The decay bounds the integrated motion, and hardly changes
/// a third difference.
const FORGETS_S: f64 = 1000.0;
/// Time constant for levelling the attitude and aligning it with the estimate's heading, s.
///
/// It may be long, because only changes within a lag of a few seconds matter.
const LEVELS_S: f64 = 100.0;
/// Largest difference between the integrated and the estimated attitude, rad. Beyond it, the integration restarts.
const MOST_OFF_RAD: f64 = 0.3;
/// Multiple of its usual size up to which a third difference shows that counter and inertial motion agree.
///
/// Agreement is judged after `FEW` third differences. Their usual size counts as known after `ENOUGH`.
const AGREES_SDS: f64 = 4.0;
const FEW: u32 = 50;
const ENOUGH: u32 = 200;
/// Until the first comparison, slack is assumed to be faster than declared by this factor.
const AT_FIRST: f64 = 2.0;
/// Third differences up to `AGREES_SDS` times this always count as usual, m. A lever arm or the tilt of the vehicle
/// causes such differences.
const LEAST_M: f64 = 0.01;
/// Possible delay between counter and inertial unit during a change of speed, s.
const LATE_S: f64 = 0.1;
/// Rms third difference at a lag of 1 s, in counter steps, above which slack is assumed to keep the count changing.
const LIVELY_STEPS: f64 = 4.0;
/// Time between two comparisons of the averaged third differences with the slack model.
const COMPARES: DurNs = DurNs(1_000_000_000);
/// Maximum time between two counter readings that are compared.
const GAP: DurNs = DurNs(1_500_000_000);
/// Least time constant of slack, s, and largest standard deviation, m. Faster changes are counter noise, and larger
/// changes are a fault.
const LEAST_TIME_S: f64 = 0.15;
pub(super) const MOST_REACH_M: f64 = 0.15;

/// Estimate of the cable's slack from third differences.
#[derive(Debug, Clone)]
pub(super) struct SlackEstimate {
    attitude: Option<Rot<Tunnel, Body>>,
    /// Position (`way_m`) and velocity along the tunnel by inertial data, each up to an unknown constant.
    way_m: f64,
    speed_mps: f64,
    /// Inertial positions along the tunnel within the last epoch.
    knots: Vec<(MonoNs, [f64; 1])>,
    /// Differences between counter and inertial position, m, each with the counter's reading, m.
    differences: Vec<(MonoNs, [f64; 2])>,
    /// Third differences at each lag: mean square (`squares_m2`), mean (`means_m`), and number so far (`seen`).
    squares_m2: [f64; LAGS_S.len()],
    means_m: [f64; LAGS_S.len()],
    seen: [u32; LAGS_S.len()],
    /// Time of the last comparison with the slack model.
    compared: MonoNs,
    slack: Option<GaussMarkov>,
}

stateful!(SlackEstimate { state: attitude, way_m, speed_mps, squares_m2, means_m, seen, compared, slack; lists: knots, differences; });

impl Default for SlackEstimate {
    /// Creates the estimate with allocated buffers, but no readings.
    fn default() -> Self {
        Self {
            attitude: None,
            way_m: 0.0,
            speed_mps: 0.0,
            knots: Vec::with_capacity(KNOTS),
            differences: Vec::with_capacity(ROOM),
            squares_m2: [0.0; LAGS_S.len()],
            means_m: [0.0; LAGS_S.len()],
            seen: [0; LAGS_S.len()],
            compared: MonoNs(0),
            slack: None,
        }
    }
}

impl SlackEstimate {
    /// Returns the slack model: as declared, or larger and faster if so observed.
    pub(super) fn slack(&self, settings: &Settings) -> GaussMarkov {
        let declared = settings.slack;
        self.slack.unwrap_or(GaussMarkov { time_s: declared.time_s / AT_FIRST, ..declared })
    }

    /// Whether slack keeps the count of a counter with this step, m, changing.
    ///
    /// True if the rms third difference at a lag of 1 s exceeds [`LIVELY_STEPS`] steps and the noise.
    pub(super) fn is_lively(&self, step_m: f64, noises: Noises, settings: &Settings) -> bool {
        let least_m = LIVELY_STEPS * step_m;
        self.squares_m2[1] > (least_m * least_m).max(noises.third_square_m2(1.0, settings))
    }

    /// Begins the integration of inertial motion in an epoch.
    pub(super) fn begin(&mut self, at: MonoNs) {
        self.knots.clear();
        self.knots.push((at, [self.way_m]));
    }

    /// Integrates inertial data from the last position to `until`. `about` supplies heading and gyro bias.
    ///
    /// Without inertial data, the comparison restarts.
    ///
    /// Allocates: never.
    pub(super) fn go_on(&mut self, felt: &InertialSample, until: MonoNs, about: &State, gravity_mps2: f64) {
        let Some((from, _)) = self.knots.last().copied() else {
            debug_assert!(false, "an epoch that ends at {until:?} has begun");
            return;
        };
        let dt_s = until.since(from).as_secs_f64();
        let (Some(rate), Some(force)) = (felt.rate_radps, felt.force_mps2) else {
            self.differences.clear();
            self.attitude = None;
            return;
        };
        let rate = rate + -about.rate_bias_radps;
        let before = self.attitude.unwrap_or(about.attitude);
        let off = rotation_vector(about.attitude * before.inverse());
        if off.norm() > MOST_OFF_RAD {
            self.skip();
            self.attitude = None;
            return;
        }
        let middle = before * rotation(rate.scaled(dt_s / 2.0));
        let up = matrix(middle) * force.0;
        let gain = up.x - self.speed_mps / FORGETS_S;
        self.way_m += (self.speed_mps + gain * dt_s / 2.0) * dt_s;
        self.speed_mps += gain * dt_s;
        // On average, the specific force points up. If the mean force leans, the attitude is wrong by this lean, so the
        // lean is removed slowly.
        let back = Vec3::<Tunnel>::new(up.y / gravity_mps2, -up.x / gravity_mps2, off.z());
        let back = rotation(back.scaled(dt_s / LEVELS_S));
        self.attitude = Some(back * (middle * rotation(rate.scaled(dt_s / 2.0))));
        if self.knots.len() < KNOTS {
            self.knots.push((until, [self.way_m]));
        }
    }

    /// Processes a counter reading in the current epoch.
    ///
    /// Returns whether counter and inertial motion agree as well as usual.
    ///
    /// Allocates: never.
    pub(super) fn hear(&mut self, at: MonoNs, shown_m: f64, noises: Noises, settings: &Settings) -> bool {
        let Some([inertial_m]) = at_time(&self.knots, at).filter(|_| self.attitude.is_some()) else {
            return true;
        };
        let since = self.differences.last().map(|(last, _)| at.since(*last));
        if since.is_some_and(|since| !(1..GAP.0).contains(&since.0)) {
            self.differences.clear();
        }
        if self.differences.len() == ROOM {
            self.differences.remove(0);
        }
        self.differences.push((at, [shown_m - inertial_m, shown_m]));
        let mut agrees = true;
        for (k, lag_s) in LAGS_S.into_iter().enumerate() {
            let Some([third_m, spread_m]) = self.third_difference_m(at, lag_s) else { continue };
            let late_m = LATE_S * spread_m / lag_s;
            let floor_m2 = noises.third_square_m2(lag_s, settings);
            let dt_s = since.map_or(0.0, DurNs::as_secs_f64);
            agrees &= self.note(k, third_m, dt_s, [floor_m2, late_m * late_m]);
        }
        if self.seen[0] >= FEW && !(0..COMPARES.0).contains(&at.since(self.compared).0) {
            self.compared = at;
            self.slack = Some(self.shown(noises, settings));
        }
        agrees
    }

    /// Restarts the comparison with inertial motion, because the counter has stuck or slipped, or a force is missing.
    pub(super) fn skip(&mut self) {
        self.differences.clear();
    }

    /// Returns the third difference of counter minus inertial position, m.
    ///
    /// The second value, m, is the longest minus the shortest distance that the counter shows in one of the three lags.
    fn third_difference_m(&self, at: MonoNs, lag_s: f64) -> Option<[f64; 2]> {
        let then = |lags: f64| at_time(&self.differences, at - DurNs::from_secs_f64(lags * lag_s));
        let [[u0, z0], [u1, z1], [u2, z2], [u3, z3]] = [then(0.0)?, then(1.0)?, then(2.0)?, then(3.0)?];
        let ways_m = [z0 - z1, z1 - z2, z2 - z3];
        let most_m = ways_m.into_iter().fold(f64::NEG_INFINITY, f64::max);
        let least_m = ways_m.into_iter().fold(f64::INFINITY, f64::min);
        Some([u0 - 3.0 * u1 + 3.0 * u2 - u3, most_m - least_m])
    }

    /// Adds a third difference to the averages.
    ///
    /// Returns whether the difference has the usual size. A larger difference also counts as usual if noise
    /// (`noise_m2`) and late readings (`late_m2`) explain it.
    fn note(&mut self, lag: usize, third_m: f64, dt_s: f64, [noise_m2, late_m2]: [f64; 2]) -> bool {
        let (Some(square_m2), Some(mean_m), Some(seen)) =
            (self.squares_m2.get_mut(lag), self.means_m.get_mut(lag), self.seen.get_mut(lag))
        else {
            return true;
        };
        // The mean square of few third differences may miss the noise. The mean square of enough of them includes it.
        let seen_m2 = if *seen < ENOUGH { square_m2.max(noise_m2) } else { *square_m2 };
        let usual_m2 = seen_m2 + late_m2 + LEAST_M * LEAST_M;
        let off_m = third_m - *mean_m;
        let agrees = *seen < FEW || off_m * off_m < AGREES_SDS * AGREES_SDS * usual_m2;
        *seen = seen.saturating_add(1);
        let share = (dt_s / MEMORY_S).max(1.0 / f64::from(*seen)).min(1.0);
        *mean_m += share * off_m;
        let most_m2 = MOST_SDS * MOST_SDS * square_m2.max(1e-4);
        let counted_m2 = if *seen > 20 { (off_m * off_m).min(most_m2) } else { off_m * off_m };
        *square_m2 += share * (counted_m2 - *square_m2);
        debug_assert!(*square_m2 >= 0.0, "a mean square isn't negative: {square_m2} m2");
        agrees
    }

    /// Returns the slack model with the longest time constant whose third differences are as large as observed.
    ///
    /// Its slack is at least as large as declared.
    fn shown(&self, noises: Noises, settings: &Settings) -> GaussMarkov {
        let declared = settings.slack;
        let seen_m2: [f64; LAGS_S.len()] = core::array::from_fn(|k| {
            let (lag_s, square_m2) = (LAGS_S[k], self.squares_m2[k]);
            let margin = 1.0 + MARGIN_SDS * math::sqrt(3.0 * lag_s / MEMORY_S);
            square_m2 - margin * noises.third_square_m2(lag_s, settings)
        });
        let least_reach =
            seen_m2.iter().map(|seen| math::sqrt(seen.max(0.0) / 20.0)).fold(declared.reach, f64::max);
        let most_reach = MOST_REACH_M.max(declared.reach);
        // Faster slack gets a larger standard deviation. Sinusoidal slack needs it, because its spectrum has a peak.
        let model = |time_s: f64| {
            let reach = declared.reach * math::sqrt(math::sqrt(math::sqrt(declared.time_s / time_s)));
            GaussMarkov { reach: reach.max(least_reach).min(most_reach), time_s }
        };
        let is_enough = |slack: GaussMarkov| {
            let shares = LAGS_S.iter().map(|lag_s| third_square(lag_s / slack.time_s));
            let seen = seen_m2.iter().map(|seen| seen / (slack.reach * slack.reach));
            shares.zip(seen).all(|(share, seen)| share >= seen)
        };
        let (mut slow_s, mut fast_s) = (declared.time_s, LEAST_TIME_S.min(declared.time_s));
        if is_enough(model(slow_s)) {
            return model(slow_s);
        }
        for _ in 0..12 {
            let middle_s = math::sqrt(slow_s * fast_s);
            if is_enough(model(middle_s)) { fast_s = middle_s } else { slow_s = middle_s }
        }
        model(fast_s)
    }
}

/// Mean square of the slack's third difference divided by the slack's variance, at a lag of `x` time constants.
///
/// The autocorrelation of the slack is (1 + x) e^-x.
fn third_square(x: f64) -> f64 {
    let correlation = |x: f64| (1.0 + x) * math::exp(-x);
    20.0 - 30.0 * correlation(x) + 12.0 * correlation(2.0 * x) - 2.0 * correlation(3.0 * x)
}

/// Noise in the difference between cable counter and inertial motion.
#[derive(Debug, Clone, Copy)]
pub(super) struct Noises {
    /// Variance of the counter's noise and rounding, m^2.
    pub counter_m2: f64,
    /// Variance of the change of a gyro bias within [`MEMORY_S`], rad^2/s^2. The change tilts the direction of gravity.
    pub rate_bias_rad2ps2: f64,
}

impl Noises {
    /// Creates the noise from the counter's variance, m^2, and the gyro bias.
    ///
    /// `known` is the variance of the bias, rad^2/s^2, and `wander` its random walk, rad^2/s^3. A constant bias error
    /// does not count, because it changes only the mean of third differences.
    pub(super) fn of(counter_m2: f64, known: f64, wander: f64) -> Self {
        let renewed = 1.0 - math::exp(-MEMORY_S * wander / known.max(f64::MIN_POSITIVE));
        Self { counter_m2, rate_bias_rad2ps2: renewed * known }
    }

    /// Mean square of the noise's third difference at a lag, m^2.
    ///
    /// The noise contains the white noise of the counter and the declared noise of the inertial unit. The noise of the
    /// inertial unit is white force noise, a random walk of tilt and bias, and a rotation of gravity.
    fn third_square_m2(self, lag_s: f64, settings: &Settings) -> f64 {
        const GRAVITY_MPS2: f64 = 9.81;
        let tilting = GRAVITY_MPS2 * settings.rate_noise;
        let cubed = lag_s * lag_s * lag_s;
        let walk = tilting * tilting + settings.force_bias.density();
        let turn = GRAVITY_MPS2 * GRAVITY_MPS2 * self.rate_bias_rad2ps2;
        let inertial =
            settings.force_noise * settings.force_noise + 0.55 * walk * lag_s * lag_s + turn * cubed;
        20.0 * self.counter_m2 + inertial * cubed
    }
}

/// Interpolates the values at a time between their neighbours; `None` outside their time span.
pub(super) fn at_time<const N: usize>(values: &[(MonoNs, [f64; N])], at: MonoNs) -> Option<[f64; N]> {
    let next = values.partition_point(|(then, _)| *then < at);
    let (after, to) = *values.get(next)?;
    if after == at {
        return Some(to);
    }
    let (before, from) = *values.get(next.checked_sub(1)?)?;
    let share = at.since(before).as_secs_f64() / after.since(before).as_secs_f64();
    Some(core::array::from_fn(|k| from[k] + share * (to[k] - from[k])))
}

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_geometry::frames::Point3;

    const GRAVITY_MPS2: f64 = 9.806_65;
    const NOISES: Noises = Noises { counter_m2: 1e-6, rate_bias_rad2ps2: 0.0 };

    fn still() -> State {
        State::at_rest(Point3::zero(), Rot::identity())
    }

    /// Returns the estimate after two minutes of a known motion, and the number of unusual readings.
    ///
    /// The counter shows `slack_m` too much at a time, s.
    fn level_after(slack_m: impl Fn(f64) -> f64) -> (SlackEstimate, u32) {
        let (mut level, mut unusual) = (SlackEstimate::default(), 0);
        let at = |t: f64| MonoNs(7_000_000_000) + DurNs::from_secs_f64(t);
        let way_m = |t: f64| 0.2 * t + 0.3 * math::sin(t / 6.0);
        for epoch in 1..1200_u32 {
            let from_s = f64::from(epoch) / 10.0;
            level.begin(at(from_s - 0.1));
            for k in 1..=10_u32 {
                let t = from_s - 0.1 + f64::from(k) / 100.0;
                // The inertial unit is tilted by a degree, and its gyros and accelerometers have errors.
                let force_mps2 = -0.3 / 36.0 * math::sin((t - 0.005) / 6.0);
                let force = Vec3::new(force_mps2 + 0.17 + 0.02, 0.01, GRAVITY_MPS2);
                let felt =
                    InertialSample { rate_radps: Some(Vec3::new(1e-4, 2e-4, 0.0)), force_mps2: Some(force) };
                level.go_on(&felt, at(t), &still(), GRAVITY_MPS2);
            }
            let is_usual =
                level.hear(at(from_s), way_m(from_s) + slack_m(from_s), NOISES, &Settings::default());
            unusual += u32::from(!is_usual);
        }
        (level, unusual)
    }

    #[test]
    fn taut_cable_and_slowly_varying_slack_keep_the_declared_slack() {
        let declared = Settings::default().slack;
        for slack_m in [0.0, 0.02] {
            let (level, unusual) = level_after(|t| slack_m * math::sin(t / 6.0));
            assert_eq!((level.slack(&Settings::default()), unusual), (declared, 0), "{slack_m}");
        }
    }

    /// The fastest change of a sine is its amplitude times its angular frequency.
    ///
    /// Three standard deviations of the slack model's rate must exceed it.
    #[test]
    fn estimated_slack_covers_slack_larger_and_faster_than_declared() {
        for (amplitude_m, period_s) in [(0.06, 8.0), (0.06, 3.0), (0.15, 4.0), (0.03, 2.0)] {
            let omega = math::TAU / period_s;
            let (level, _) = level_after(|t| amplitude_m * math::sin(omega * t));
            let GaussMarkov { reach, time_s } = level.slack(&Settings::default());
            let (rate_mps, needed_mps) = (reach / time_s, amplitude_m * omega);
            assert!(3.0 * rate_mps > needed_mps, "{amplitude_m} {period_s}: {rate_mps} for {needed_mps}");
            assert!(3.0 * reach > amplitude_m && reach <= MOST_REACH_M, "{reach}");
        }
    }

    #[test]
    fn readings_of_a_stuck_counter_count_as_unusual_within_1_s() {
        let sticks = |t: f64| {
            if (60.0..70.0).contains(&t) {
                -0.2 * (t - 60.0)
            } else if t < 60.0 {
                0.0
            } else {
                -2.0
            }
        };
        assert_eq!(level_after(|_| 0.0).1, 0);
        let (_, unusual) = level_after(sticks);
        assert!(unusual > 50, "{unusual}");
        let (_, unusual) = level_after(|t| if t < 119.0 { 0.0 } else { -0.2 * (t - 119.0) });
        assert!(unusual > 2, "{unusual}");
    }

    #[test]
    fn counter_readings_without_inertial_data_count_as_usual() {
        let (mut level, _) = level_after(|_| 0.0);
        level.begin(MonoNs(127_000_000_000));
        level.go_on(
            &InertialSample { rate_radps: None, force_mps2: None },
            MonoNs(127_100_000_000),
            &still(),
            GRAVITY_MPS2,
        );
        assert!(level.hear(MonoNs(127_100_000_000), 900.0, NOISES, &Settings::default()));
        assert!(level.differences.is_empty());
    }

    /// The slack process itself is simulated: two lags in series, in steps of a hundredth of their time constant.
    #[test]
    fn slack_model_has_the_third_differences_of_the_process() {
        let (mut seed, mut rate, mut slack) = (3_u64, 0.0, 0.0);
        let mut draw = || {
            (0..12).fold(-6.0, |sum, _| {
                seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                sum + (seed >> 11) as f64 / (1_u64 << 53) as f64
            })
        };
        let step = 0.01;
        let mut values = Vec::new();
        for _ in 0..400_000 {
            slack += step * (rate - slack);
            rate += -step * rate + 2.0 * math::sqrt(step) * draw();
            values.push(slack);
        }
        for lag in [30_usize, 100, 300] {
            let third = |k: usize| {
                values[k] - 3.0 * values[k - lag] + 3.0 * values[k - 2 * lag] - values[k - 3 * lag]
            };
            let mean = (3 * lag..values.len()).map(|k| third(k) * third(k)).sum::<f64>()
                / (values.len() - 3 * lag) as f64;
            let expected = third_square(lag as f64 * step);
            assert!((mean / expected - 1.0).abs() < 0.1, "{lag}: {mean} for {expected}");
        }
    }
}
