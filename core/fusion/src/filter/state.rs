//! The filter's state vector and error state.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use headrace_geometry::frames::{Body, Point3, Rot, Tunnel, Vec3};
use headrace_geometry::math;

/// Number of errors in the error state.
pub const ERRORS: usize = 22;
/// Index of the position error of the inertial unit, m, in the tunnel's frame.
pub const POSITION: usize = 0;
/// Index of the error of the cable's creep, m.
pub const CREEP: usize = 3;
/// Index of the velocity error of the inertial unit, m/s, in the tunnel's frame.
pub const VELOCITY: usize = 4;
/// Index of the attitude error, radians: the rotation vector from estimate to truth in the tunnel's frame.
pub const ATTITUDE: usize = 7;
/// Index of the error of the accelerometer bias, m/s^2, in the body's frame.
pub const FORCE_BIAS: usize = 10;
/// Index of the error of the gyro bias, rad/s, in the body's frame.
pub const RATE_BIAS: usize = 13;
/// Index of the error of the cable's slack, m.
pub const SLACK: usize = 16;
/// Index of the error of the slack's rate, m/s.
pub const SLACK_RATE: usize = 17;
/// Index of the error of the cable's scale, a ratio.
pub const SCALE: usize = 18;
/// Index of the error of the depth sensor's offset, m of height.
pub const DEPTH: usize = 19;
/// Index of the error of the compass deviation, radians.
pub const HEADING: usize = 20;
/// Index of the error of the scale of all sonar ranges, a ratio.
pub const RANGES: usize = 21;

/// Number of values in the record of a state.
pub const STATE_NUMBERS: usize = ERRORS + 1;

/// The error state, with one number for each error. An error that drives another error has a higher index; see
/// `docs/why/navigation.md`.
pub type Errors = [f64; ERRORS];

/// The estimated state of the filter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Position of the inertial unit.
    pub position: Point3<Tunnel>,
    /// Velocity of the inertial unit, m/s.
    pub velocity_mps: Vec3<Tunnel>,
    /// Rotation from body to tunnel frame.
    pub attitude: Rot<Tunnel, Body>,
    /// Accelerometer bias, m/s^2, to be subtracted from readings.
    pub force_bias_mps2: Vec3<Body>,
    /// Gyro bias, rad/s, to be subtracted from readings.
    pub rate_bias_radps: Vec3<Body>,
    /// Slack of the cable, m; positive if the cable shows too much chainage.
    pub slack_m: f64,
    /// Rate at which the slack grows, apart from its decay, m/s. It decays with the time constant of the slack.
    pub slack_rate_mps: f64,
    /// Creep of the cable, m: the part of the shown chainage that all scale errors and slips so far have added.
    pub creep_m: f64,
    /// Local scale error of the cable, a ratio; positive if the cable shows too much distance.
    pub scale: f64,
    /// Offset of the depth sensor, m; positive if the sensor shows too much height.
    pub depth_offset_m: f64,
    /// Deviation of the compass, radians, positive to the left.
    pub heading_offset_rad: f64,
    /// Scale error of ranges, a ratio; positive if the wall is wider, or sound is slower, than configured.
    pub range_scale: f64,
}

impl State {
    /// Creates a state at rest with zero sensor errors.
    pub fn at_rest(position: Point3<Tunnel>, attitude: Rot<Tunnel, Body>) -> Self {
        Self {
            position,
            velocity_mps: Vec3::zero(),
            attitude,
            force_bias_mps2: Vec3::zero(),
            rate_bias_radps: Vec3::zero(),
            slack_m: 0.0,
            slack_rate_mps: 0.0,
            creep_m: 0.0,
            scale: 0.0,
            depth_offset_m: 0.0,
            heading_offset_rad: 0.0,
            range_scale: 0.0,
        }
    }

    /// Adds estimated errors to the estimate.
    pub fn correct(&mut self, errors: &Errors) {
        self.position = self.position + vec(errors, POSITION);
        self.velocity_mps = self.velocity_mps + vec(errors, VELOCITY);
        self.attitude = rotation(vec(errors, ATTITUDE)) * self.attitude;
        debug_assert!(self.attitude.is_unit(), "an attitude is a unit quaternion: {:?}", self.attitude);
        self.force_bias_mps2 = self.force_bias_mps2 + vec(errors, FORCE_BIAS);
        self.rate_bias_radps = self.rate_bias_radps + vec(errors, RATE_BIAS);
        let [creep_m, slack_m, slack_rate_mps, scale, depth_m, heading_rad, range_scale] =
            [CREEP, SLACK, SLACK_RATE, SCALE, DEPTH, HEADING, RANGES]
                .map(|i| errors.get(i).copied().unwrap_or(0.0));
        self.range_scale += range_scale;
        self.creep_m += creep_m;
        self.slack_m += slack_m;
        self.slack_rate_mps += slack_rate_mps;
        self.scale += scale;
        self.depth_offset_m += depth_m;
        self.heading_offset_rad += heading_rad;
    }

    /// Returns the errors that change this estimate into another state, for instance the truth.
    pub fn errors_to(&self, truth: &Self) -> Errors {
        let mut errors = [0.0; ERRORS];
        put(&mut errors, POSITION, truth.position - self.position);
        put(&mut errors, VELOCITY, truth.velocity_mps + -self.velocity_mps);
        put(&mut errors, ATTITUDE, rotation_vector(truth.attitude * self.attitude.inverse()));
        put(&mut errors, FORCE_BIAS, truth.force_bias_mps2 + -self.force_bias_mps2);
        put(&mut errors, RATE_BIAS, truth.rate_bias_radps + -self.rate_bias_radps);
        let scalars = [
            (SLACK, truth.slack_m - self.slack_m),
            (SLACK_RATE, truth.slack_rate_mps - self.slack_rate_mps),
            (CREEP, truth.creep_m - self.creep_m),
            (SCALE, truth.scale - self.scale),
            (DEPTH, truth.depth_offset_m - self.depth_offset_m),
            (HEADING, truth.heading_offset_rad - self.heading_offset_rad),
            (RANGES, truth.range_scale - self.range_scale),
        ];
        for (i, value) in scalars {
            if let Some(slot) = errors.get_mut(i) {
                *slot = value;
            }
        }
        errors
    }

    /// Interpolates pose and velocity by `share` towards another estimate. Sensor errors are those of the other
    /// estimate.
    #[must_use]
    pub fn between(&self, other: &Self, share: f64) -> Self {
        let turn = rotation_vector(other.attitude * self.attitude.inverse());
        Self {
            position: self.position + (other.position - self.position).scaled(share),
            velocity_mps: self.velocity_mps + (other.velocity_mps + -self.velocity_mps).scaled(share),
            attitude: rotation(turn.scaled(share)) * self.attitude,
            ..*other
        }
    }

    /// Returns the numbers of the state in the order of the error state. The attitude is a quaternion.
    pub fn numbers(&self) -> [f64; STATE_NUMBERS] {
        let [px, py, pz] = self.position.0.into();
        let [vx, vy, vz] = self.velocity_mps.0.into();
        let [w, x, y, z] = self.attitude.wxyz();
        let [fx, fy, fz] = self.force_bias_mps2.0.into();
        let [rx, ry, rz] = self.rate_bias_radps.0.into();
        let (slack, heading) = ([self.slack_m, self.slack_rate_mps], self.heading_offset_rad);
        let (scale, depth) = (self.scale, self.depth_offset_m);
        let [s, r] = slack;
        let (creep, ranges) = (self.creep_m, self.range_scale);
        [
            px, py, pz, creep, vx, vy, vz, w, x, y, z, fx, fy, fz, rx, ry, rz, s, r, scale, depth, heading,
            ranges,
        ]
    }

    /// Creates a state from the numbers that [`Self::numbers`] returns; `None` if the quaternion is invalid.
    pub fn of_numbers(numbers: [f64; STATE_NUMBERS]) -> Option<Self> {
        let [
            px,
            py,
            pz,
            creep,
            vx,
            vy,
            vz,
            w,
            x,
            y,
            z,
            fx,
            fy,
            fz,
            rx,
            ry,
            rz,
            s,
            r,
            scale,
            depth,
            heading,
            ranges,
        ] = numbers;
        Some(Self {
            position: Point3::new(px, py, pz),
            velocity_mps: Vec3::new(vx, vy, vz),
            attitude: Rot::from_wxyz(w, x, y, z)?,
            force_bias_mps2: Vec3::new(fx, fy, fz),
            rate_bias_radps: Vec3::new(rx, ry, rz),
            slack_m: s,
            slack_rate_mps: r,
            creep_m: creep,
            scale,
            depth_offset_m: depth,
            heading_offset_rad: heading,
            range_scale: ranges,
        })
    }

    /// Whether every number of the state is finite.
    pub fn is_sound(&self) -> bool {
        let cable = [self.creep_m, self.slack_m, self.slack_rate_mps, self.scale];
        let offsets = [self.depth_offset_m, self.heading_offset_rad, self.range_scale];
        self.position.is_finite()
            && self.velocity_mps.is_finite()
            && self.attitude.wxyz().iter().all(|c| c.is_finite())
            && self.force_bias_mps2.is_finite()
            && self.rate_bias_radps.is_finite()
            && cable.iter().chain(&offsets).all(|c| c.is_finite())
    }
}

/// Returns three successive errors from index `from` on as a vector.
pub fn vec<F>(errors: &Errors, from: usize) -> Vec3<F> {
    let [x, y, z] = [0, 1, 2].map(|k| errors.get(from + k).copied().unwrap_or(0.0));
    Vec3::new(x, y, z)
}

/// Sets three successive errors from index `from` on to a vector.
pub fn put<F: Copy>(errors: &mut Errors, from: usize, value: Vec3<F>) {
    for (slot, value) in errors.iter_mut().skip(from).zip(value.0.iter()) {
        *slot = *value;
    }
}

/// Returns the errors as they were `by_s` seconds earlier if the velocity was constant.
pub fn earlier(errors: &Errors, by_s: f64) -> Errors {
    let mut then = *errors;
    put(&mut then, POSITION, vec::<Tunnel>(errors, POSITION) + vec::<Tunnel>(errors, VELOCITY).scaled(-by_s));
    then
}

/// Adds an amount to entry `i`; the entries are errors or their variances.
pub fn add_to(errors: &mut Errors, i: usize, amount: f64) {
    if let Some(slot) = errors.get_mut(i) {
        *slot += amount;
    }
}

/// Returns the rotation that has this rotation vector, radians.
pub fn rotation<To: Copy>(by: Vec3<To>) -> Rot<To, To> {
    let angle = by.norm();
    // The factor of the rotation vector is sin(a / 2) / a. At a small angle a, the quotient would lose digits, so a
    // series is used.
    let share = if angle < 1e-4 { 0.5 - angle * angle / 48.0 } else { math::sin(angle / 2.0) / angle };
    let [x, y, z] = [by.x() * share, by.y() * share, by.z() * share];
    Rot::from_wxyz(math::cos(angle / 2.0), x, y, z).unwrap_or_else(Rot::identity)
}

/// Returns the rotation vector of a rotation, radians, with a length of 0 to pi.
pub fn rotation_vector<To: Copy, From: Copy>(rotation: Rot<To, From>) -> Vec3<To> {
    let [w, x, y, z] = rotation.wxyz();
    // Antipodal quaternions are the same rotation. The one with the smaller angle is used.
    let (w, v) = if w < 0.0 { (-w, Vec3::new(-x, -y, -z)) } else { (w, Vec3::new(x, y, z)) };
    let sine = v.norm();
    let share = if sine < 1e-5 { 2.0 + sine * sine / 3.0 } else { 2.0 * math::atan2(sine, w) / sine };
    v.scaled(share)
}

/// Returns the 3 x 3 matrix of a rotation.
pub fn matrix<To: Copy, From: Copy>(rotation: Rot<To, From>) -> Matrix3<f64> {
    *UnitQuaternion::to_rotation_matrix(rotation.0).matrix()
}

/// Returns the matrix of the cross product with `v` on the left.
pub fn cross(v: Vector3<f64>) -> Matrix3<f64> {
    v.cross_matrix()
}
