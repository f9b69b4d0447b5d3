//! Noise settings of the sensors. Defaults suit a small vehicle with a MEMS unit; a vehicle file's `[navigation]` table
//! overrides them.

use serde::{Deserialize, Serialize};

use headrace_geometry::math;
use headrace_geometry::time::DurNs;
use headrace_sensor::device::{BiasSpec, InertialNoise, SensorKind};

/// One degree in radians.
const DEGREE: f64 = core::f64::consts::PI / 180.0;
/// A Gauss-Markov process about zero.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Wander {
    /// Standard deviation, in the unit of the process.
    pub reach: f64,
    /// Correlation time, s.
    pub time_s: f64,
}

impl Wander {
    /// The process of a bias with a constant part and a wandering one: its variance is that of both together, and it wanders
    /// as fast as the wandering part does.
    pub fn of_bias(bias: &BiasSpec) -> Self {
        let variance = bias.turn_on * bias.turn_on + bias.in_run * bias.in_run;
        Self { reach: math::sqrt(variance), time_s: bias.time_s * variance / (bias.in_run * bias.in_run) }
    }

    /// Variance by which a process of one lag wanders in a second.
    pub fn density(&self) -> f64 {
        2.0 * self.reach * self.reach / self.time_s
    }

    /// Standard deviation of the driving rate of a smooth process (two equal lags in series) of standard deviation `reach`.
    pub fn drive(&self) -> f64 {
        core::f64::consts::SQRT_2 * self.reach / self.time_s
    }
}

/// See the module's description. Every number is positive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// White noise of the gyros, rad/s/sqrt(Hz).
    pub rate_noise: f64,
    /// White noise of the accelerometers, m/s^2/sqrt(Hz).
    pub force_noise: f64,
    /// The same without gyro, or accelerometer, data: the vehicle's own turning and acceleration.
    pub blind_rate_noise: f64,
    /// See `blind_rate_noise`.
    pub blind_force_noise: f64,
    /// Bias of the gyros, rad/s.
    pub rate_bias: Wander,
    /// Bias of the accelerometers, m/s^2.
    pub force_bias: Wander,
    /// Noise of a tether counter, its quantum excluded, m.
    pub tether_sd_m: f64,
    /// Slack of the cable, m, a smooth process: two lags in series. By default that of one that swings within 16 s: nobody has promised less.
    pub slack: Wander,
    /// Initial scale error of the cable, a ratio, and its random walk, per root of a second.
    pub scale_sd: f64,
    /// See `scale_sd`.
    pub scale_noise: f64,
    /// Noise of a depth sensor, its quantum excluded, m.
    pub depth_sd_m: f64,
    /// Its initial offset, m, and its random walk, m per root of a second: water level, density, surface pressure.
    pub depth_offset_sd_m: f64,
    /// See `depth_offset_sd_m`.
    pub depth_noise: f64,
    /// Noise of an attitude about the vertical, radians.
    pub heading_sd_rad: f64,
    /// A compass's deviation, radians.
    pub heading: Wander,
    /// Noise of an attitude about level axes, radians, with gyro and accelerometer data.
    pub tilt_sd_rad: f64,
    /// The same without these, radians.
    pub attitude_sd_rad: f64,
    /// Noise of an echosounder, m, wall roughness included.
    pub echo_sd_m: f64,
    /// Length of wall along which its bumps are one and the same to an echosounder, m.
    pub bump_m: f64,
    /// Way along the tunnel within which heads see the same bumps again, m.
    pub seen_again_m: f64,
    /// Full width of its beam, radians: which part of the wall within it echoes is uncertain.
    pub echo_beam_rad: f64,
    /// Initial scale error of all ranges against the design, a ratio, and its random walk, per root of a second.
    pub range_scale_sd: f64,
    /// See `range_scale_sd`.
    pub range_scale_noise: f64,
    /// Noise of a head's return, m, wall roughness included.
    pub return_sd_m: f64,
    /// Full width of its beam, radians: the nearest part of the wall echoes first.
    pub return_beam_rad: f64,
    /// Angle between the returns of a head that are used, radians: nearer ones see the same roughness.
    pub return_step_rad: f64,
    /// Noise of a velocity over ground, m/s.
    pub velocity_sd_mps: f64,
    /// Gate: a measurement is rejected when its innovation squared exceeds its variance by this factor.
    pub gate: f64,
    /// Readings older than this on arrival are too late.
    pub window: DurNs,
    /// Length of an epoch, positive, 0.2 s at most for estimates that hold: readings are fused, and errors carried on, once in each.
    /// Epochs begin at its multiples.
    pub epoch: DurNs,
    /// Whether the level of the sources' noise is learnt. Likelihoods can only be compared without.
    pub learns: bool,
    /// Share of a wall's ranges' correction of the attitude, and of what is learnt from it, that is made: 0 to 1, the best estimate.
    /// What matters to coverage is the attitude of one pass relative to the next, which the gyros know better than walls, whose
    /// shape isn't the design's. A smoother needs 1: [`crate::smooth::beside`].
    pub wall_share: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            rate_noise: 0.01 * DEGREE,
            force_noise: 0.003,
            blind_rate_noise: 2.0 * DEGREE,
            blind_force_noise: 0.1,
            rate_bias: Wander { reach: 0.2 * DEGREE, time_s: 1000.0 },
            force_bias: Wander { reach: 0.03, time_s: 300.0 },
            tether_sd_m: 0.005,
            slack: Wander { reach: 0.06, time_s: 2.5 },
            scale_sd: 0.002,
            // Nobody sets it: a wheel's scale doesn't change within a dive. It keeps the variance from becoming zero.
            scale_noise: 1e-9,
            depth_sd_m: 0.02,
            depth_offset_sd_m: 0.5,
            depth_noise: 0.001,
            heading_sd_rad: 1.0 * DEGREE,
            heading: Wander { reach: 4.0 * DEGREE, time_s: 30.0 },
            tilt_sd_rad: 2.0 * DEGREE,
            attitude_sd_rad: 1.0 * DEGREE,
            echo_sd_m: 0.03,
            // Nobody sets it: two thirds of the 0.3 m over which the bumps of field dives follow one another (docs/why/field.md).
            bump_m: 0.2,
            // Nobody sets it: about what a vehicle drives while its heads turn half round.
            seen_again_m: 0.05,
            echo_beam_rad: 25.0 * DEGREE,
            range_scale_sd: 0.03,
            range_scale_noise: 1e-5,
            return_sd_m: 0.03,
            return_beam_rad: 1.4 * DEGREE,
            return_step_rad: 3.0 * DEGREE,
            velocity_sd_mps: 0.02,
            gate: GATE_999,
            window: DurNs::from_millis(200),
            epoch: DurNs::from_millis(100),
            learns: true,
            wall_share: 0.3,
        }
    }
}

/// Chi-square with one degree of freedom is above this once in a thousand times.
const GATE_999: f64 = 10.828;

impl Settings {
    /// The same, with an inertial unit's own noise.
    #[must_use]
    pub fn with_inertial(self, noise: &InertialNoise) -> Self {
        Self {
            rate_noise: noise.rate_noise,
            force_noise: noise.force_noise,
            rate_bias: Wander::of_bias(&noise.rate_bias),
            force_bias: Wander::of_bias(&noise.force_bias),
            ..self
        }
    }

    /// Measurement variance of a kind of sensor, in its unit squared: the reference for innovation variances.
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
