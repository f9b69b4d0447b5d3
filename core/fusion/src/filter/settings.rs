//! Noise settings of the sensors.
//!
//! The defaults suit a small vehicle with a MEMS unit. The `[navigation]` table of a vehicle file overrides them.

use serde::{Deserialize, Serialize};

use headrace_geometry::math;
use headrace_geometry::time::DurNs;
use headrace_sensor::device::{BiasSpec, InertialNoise, SensorKind};

/// One degree in radians.
const DEGREE: f64 = core::f64::consts::PI / 180.0;
/// A Gauss-Markov process with zero mean.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct GaussMarkov {
    /// Standard deviation of the process, in its unit.
    pub reach: f64,
    /// Correlation time of the process, s.
    pub time_s: f64,
}

impl GaussMarkov {
    /// Creates the process of a bias that has a constant part and a drifting part.
    ///
    /// The variance of the process is the sum of both parts' variances. The process drifts as fast as the drifting part
    /// alone.
    pub fn of_bias(bias: &BiasSpec) -> Self {
        let variance = bias.turn_on * bias.turn_on + bias.in_run * bias.in_run;
        Self { reach: math::sqrt(variance), time_s: bias.time_s * variance / (bias.in_run * bias.in_run) }
    }

    /// Variance per second that the driving white noise adds to this process, if the process has a single lag.
    pub fn density(&self) -> f64 {
        2.0 * self.reach * self.reach / self.time_s
    }

    /// Standard deviation of the rate that drives a smooth process with the standard deviation `reach`.
    ///
    /// A smooth process is white noise that passes two equal lags in series.
    pub fn drive(&self) -> f64 {
        core::f64::consts::SQRT_2 * self.reach / self.time_s
    }
}

/// Noise settings of the sensors. Numbers are positive; only `mount_sd_rad` and `wall_share` may also be zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// White noise of the gyros, rad/s/sqrt(Hz).
    pub rate_noise: f64,
    /// White noise of the accelerometers, m/s^2/sqrt(Hz).
    pub force_noise: f64,
    /// White noise assumed for the vehicle's own turning without gyro data, rad/s/sqrt(Hz).
    pub blind_rate_noise: f64,
    /// White noise assumed for the vehicle's own acceleration without accelerometer data, m/s^2/sqrt(Hz).
    pub blind_force_noise: f64,
    /// Bias of the gyros, rad/s.
    pub rate_bias: GaussMarkov,
    /// Bias of the accelerometers, m/s^2.
    pub force_bias: GaussMarkov,
    /// Noise of a tether counter without the rounding to its step, m.
    pub tether_sd_m: f64,
    /// Slack of the cable, m: a smooth process of two lags in series. The default suits slack with periods of 16 s.
    pub slack: GaussMarkov,
    /// Initial standard deviation of the cable's scale error, a ratio.
    pub scale_sd: f64,
    /// Random walk of the cable's scale error, per root of a second.
    pub scale_noise: f64,
    /// Noise of a depth sensor without the rounding to its quantum, m.
    pub depth_sd_m: f64,
    /// Initial standard deviation of the depth sensor's offset, m.
    ///
    /// The offset contains errors of water level, density and surface pressure.
    pub depth_offset_sd_m: f64,
    /// Random walk of the depth sensor's offset, m per root of a second.
    pub depth_noise: f64,
    /// Noise of a measured attitude, about the vertical axis, radians.
    pub heading_sd_rad: f64,
    /// Deviation of a compass, radians.
    pub heading: GaussMarkov,
    /// Noise of a measured attitude about horizontal axes, radians, if there are both gyro and accelerometer data.
    pub tilt_sd_rad: f64,
    /// Noise of a measured attitude about horizontal axes, radians, if gyro or accelerometer data are missing.
    pub attitude_sd_rad: f64,
    /// Noise of an echosounder's range, m, wall roughness included.
    pub echo_sd_m: f64,
    /// Length of a bump along the wall, m. Within this length, an echosounder sees the same bump.
    pub bump_m: f64,
    /// Distance along the tunnel within which heads see the same bumps again, m.
    pub seen_again_m: f64,
    /// Full width of an echosounder's beam, radians. Any part of the wall within the beam may echo.
    pub echo_beam_rad: f64,
    /// Initial standard deviation of the scale error of all ranges against the design, a ratio.
    pub range_scale_sd: f64,
    /// Random walk of the scale error of ranges, per root of a second.
    pub range_scale_noise: f64,
    /// Noise of the range of a head's return, m, wall roughness included.
    pub return_sd_m: f64,
    /// Full width of a head's beam, radians. The nearest part of the wall within the beam echoes first.
    pub return_beam_rad: f64,
    /// Minimum angle between two used returns of a head, radians. Returns at a smaller angle to each other see the same
    /// roughness of the wall.
    pub return_step_rad: f64,
    /// Noise of a velocity log's velocity over ground, m/s.
    pub velocity_sd_mps: f64,
    /// Declared standard deviation of a head's pitch and yaw on its mount, radians.
    pub mount_sd_rad: f64,
    /// Gate: a measurement is rejected if its squared innovation exceeds this factor times the innovation's variance.
    pub gate: f64,
    /// Maximum age of a reading on arrival. Older readings are rejected as too late.
    pub window: DurNs,
    /// Length of an epoch, positive; at most 0.2 s for reliable estimates.
    ///
    /// Readings are fused, and errors propagated, once per epoch. Epochs begin at whole multiples of this length.
    pub epoch: DurNs,
    /// Whether noise levels of the sources are learnt. Likelihoods of different settings can be compared only without
    /// learning.
    pub learns: bool,
    /// Share of a wall range's computed correction that is applied to the attitude and related errors.
    ///
    /// With 0, ranges do not correct the attitude; with 1, the estimate is optimal. Coverage depends on the attitude of
    /// one pass relative to the next. Gyros measure this relative attitude more accurately than ranges do, because
    /// walls differ in shape from the design. A smoother needs 1: see [`crate::smooth::two_filters`].
    pub wall_share: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            rate_noise: 0.01 * DEGREE,
            force_noise: 0.003,
            blind_rate_noise: 2.0 * DEGREE,
            blind_force_noise: 0.1,
            rate_bias: GaussMarkov { reach: 0.2 * DEGREE, time_s: 1000.0 },
            force_bias: GaussMarkov { reach: 0.03, time_s: 300.0 },
            tether_sd_m: 0.005,
            slack: GaussMarkov { reach: 0.06, time_s: 2.5 },
            scale_sd: 0.002,
            // Not configurable, because a wheel's scale does not change within a dive. The value is small; it only
            // keeps the variance above zero.
            scale_noise: 1e-9,
            depth_sd_m: 0.02,
            depth_offset_sd_m: 0.5,
            depth_noise: 0.001,
            heading_sd_rad: 1.0 * DEGREE,
            heading: GaussMarkov { reach: 4.0 * DEGREE, time_s: 30.0 },
            tilt_sd_rad: 2.0 * DEGREE,
            attitude_sd_rad: 1.0 * DEGREE,
            echo_sd_m: 0.03,
            // Not configurable. In field dives, bumps were 0.3 m apart; two thirds of this count as the length of a
            // bump (docs/why/field.md).
            bump_m: 0.2,
            // Not configurable: about the distance that the vehicle travels during half a turn of a head.
            seen_again_m: 0.05,
            echo_beam_rad: 25.0 * DEGREE,
            range_scale_sd: 0.03,
            range_scale_noise: 1e-5,
            return_sd_m: 0.03,
            return_beam_rad: 1.4 * DEGREE,
            return_step_rad: 3.0 * DEGREE,
            velocity_sd_mps: 0.02,
            mount_sd_rad: 0.0,
            gate: GATE_999,
            window: DurNs::from_millis(200),
            epoch: DurNs::from_millis(100),
            learns: true,
            wall_share: 0.3,
        }
    }
}

/// Value that a chi-square variable with one degree of freedom exceeds once in a thousand times.
const GATE_999: f64 = 10.828;

impl Settings {
    /// Returns the settings with the inertial unit's own noise in place of the default noise.
    #[must_use]
    pub fn with_inertial(self, noise: &InertialNoise) -> Self {
        Self {
            rate_noise: noise.rate_noise,
            force_noise: noise.force_noise,
            rate_bias: GaussMarkov::of_bias(&noise.rate_bias),
            force_bias: GaussMarkov::of_bias(&noise.force_bias),
            ..self
        }
    }

    /// Declared noise variance of a kind of sensor, in the square of the measurement's unit. Innovation variances are
    /// compared with it.
    pub fn usual_variance(&self, kind: SensorKind) -> f64 {
        let sd = match kind {
            SensorKind::Head => self.return_sd_m,
            SensorKind::Echosounder { .. } => self.echo_sd_m,
            SensorKind::Depth => self.depth_sd_m,
            SensorKind::Imu => self.tilt_sd_rad,
            SensorKind::VelocityLog => self.velocity_sd_mps,
            SensorKind::Tether { .. } => self.tether_sd_m,
            SensorKind::Other => 1.0,
        };
        sd * sd
    }
}
