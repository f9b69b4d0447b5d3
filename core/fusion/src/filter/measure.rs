//! Measurement models: the value that the estimate predicts, and its derivatives with respect to the errors.
//!
//! Derivation: `docs/why/navigation.md`, "Measurements".

use super::state::{
    ATTITUDE, CREEP, DEPTH, ERRORS, Errors, HEADING, POSITION, RANGES, RATE_BIAS, SLACK, State, VELOCITY,
    put, rotation_vector, vec,
};
use headrace_geometry::frames::{Body, Rot, Sensor, Tunnel, Vec3};
use headrace_geometry::math;
use headrace_geometry::tunnel::Profile;

/// Cosine of the beam's incidence above which a head's range may get more weight than declared.
///
/// If the hull is pitched steeply, the beams look along the tunnel, and only few of them determine the attitude.
const SQUARE: f64 = 0.8;

/// A scalar measurement of the filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScalarUpdate {
    /// Change of the expected value per unit of each error.
    pub h: Errors,
    /// Measured value minus expected value.
    pub residual: f64,
    /// Variance of the measurement noise.
    pub noise: f64,
    /// Inclination of the beam along the tunnel; present only if the measurement is a range.
    pub lean: Option<Lean>,
    /// Second derivatives of the expected value, which the update neglects.
    ///
    /// They are taken with respect to position twice, 1/m; to rotation twice, m; and to position and rotation.
    pub bends: [f64; 3],
}

/// Inclination of a beam along the tunnel.
///
/// An inclination to either side lengthens the range equally. So a filter that does not know the side would only
/// confirm its first guess.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lean {
    /// Component of the beam's unit vector along the tunnel.
    pub along: f64,
    /// Change of `along` per unit of each error of the estimate.
    pub by: Errors,
    /// Change of the range per unit of `along`, divided by `along`, m.
    pub slope_m: f64,
}

impl ScalarUpdate {
    fn new(residual: f64, noise: f64) -> Self {
        Self { h: [0.0; ERRORS], residual, noise, lean: None, bends: [0.0; 3] }
    }

    /// Creates a measurement whose expected value depends on one error only, with factor 1.
    pub fn of(error: usize, residual: f64, noise: f64) -> Self {
        Self::new(residual, noise).with_one(error, 1.0)
    }

    fn with<F: Copy>(mut self, from: usize, part: Vec3<F>) -> Self {
        put(&mut self.h, from, part);
        self
    }

    fn with_one(mut self, i: usize, part: f64) -> Self {
        if let Some(slot) = self.h.get_mut(i) {
            *slot = part;
        }
        self
    }

    /// Removes the range's dependence on the beam's inclination if `is_used` is false or the inclination is
    /// uncertain.
    ///
    /// `sd_of` returns the standard deviation of a weighted sum of errors.
    #[must_use]
    pub fn unless_sure(mut self, is_used: bool, sd_of: impl Fn(&Errors) -> f64) -> Self {
        let Some(lean) = self.lean else { return self };
        let sd = sd_of(&lean.by);
        if !is_used || lean.along.abs() < SURE * sd {
            for (h, by) in self.h.iter_mut().zip(&lean.by) {
                *h -= lean.slope_m * lean.along * by;
            }
            let unknown_m = lean.slope_m * sd * (lean.along.abs() + sd / 2.0);
            self.noise += unknown_m * unknown_m;
        }
        self
    }

    /// Whether the beam meets the wall squarely. The change of the range per metre of position shows this, because it
    /// is one over the cosine of incidence.
    pub fn is_square(&self) -> bool {
        vec::<Tunnel>(&self.h, POSITION).norm() < 1.0 / SQUARE
    }

    /// Returns the part of the residual that corrections since `known` explain. `errors` are the corrections so far.
    pub fn found(&self, known: &Errors, errors: &Errors) -> f64 {
        self.h.iter().zip(errors.iter().zip(known)).map(|(h, (error, known))| h * (error - known)).sum()
    }

    /// Returns the update with respect to the errors at a time `later_s` after the measurement.
    #[must_use]
    pub fn seen_later(mut self, later_s: f64) -> Self {
        for k in 0..3 {
            let along = self.h.get(POSITION + k).copied().unwrap_or(0.0);
            if let Some(slot) = self.h.get_mut(VELOCITY + k) {
                *slot -= along * later_s;
            }
        }
        self
    }
}

/// Minimum cosine of the angle between a beam and the wall's normal.
///
/// At a more grazing angle, a range shows the wall's roughness rather than the position.
const LEAST_COSINE: f64 = 0.5;
/// Smallest distance to the wall that is used to compute the curvature of a range, m.
const LEAST_HEIGHT_M: f64 = 0.5;
/// The side to which a beam inclines is certain if its inclination is at least this many sds from zero.
const SURE: f64 = 3.0;

/// A sonar's beam.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Beam {
    /// Position of the sonar relative to the inertial unit, in the body's frame.
    pub offset: Vec3<Body>,
    /// Direction of the beam's axis.
    pub along: Vec3<Body>,
    /// Half angle of a cone around the beam's axis, radians. The nearest part of the wall in this cone echoes first.
    pub first_rad: f64,
    /// Half angle of a wider cone, radians. The first echo may come from any part of the wall within it.
    pub unsure_rad: f64,
}

/// Predicts the range of the first echo from the design wall.
///
/// `None` if the beam misses or grazes the wall.
pub fn range(state: &State, profile: &Profile, beam: &Beam, range_m: f64, sd_m: f64) -> Option<ScalarUpdate> {
    let arm = state.attitude * beam.offset;
    let origin = state.position + arm;
    let along = state.attitude * beam.along;
    let hit = profile.cast([origin.y(), origin.z()], [along.y(), along.z()])?;
    let normal = Vec3::<Tunnel>::new(0.0, hit.normal[0], hit.normal[1]);
    let cosine = -normal.dot(&along);
    if cosine < LEAST_COSINE {
        return None;
    }
    debug_assert!(cosine <= 1.0 + 1e-5, "beam {along:?} and normal {normal:?} are unit vectors");
    // The wall is modelled as a plane at `height_m`. The ray of the cone that is nearest to the plane's normal
    // echoes first.
    let height_m = hit.range_m * cosine;
    let incidence = math::acos(cosine);
    let nearest = (incidence - beam.first_rad).max(0.0);
    let (sin, cos) = math::sin_cos(nearest);
    let stretch = 1.0 + state.range_scale;
    let designed_m = height_m / cos;
    let expected_m = designed_m * stretch;
    // The slope is the derivative of the expected range by the incidence angle. A small rotation `turn` changes this
    // angle by turn . (along x normal) / sin(incidence).
    let slope = if nearest > 0.0 { expected_m * sin / cos / math::sin(incidence) } else { 0.0 };
    let turning = arm.cross(&normal).scaled(stretch / cos) + along.cross(&normal).scaled(slope);
    // The wall may echo as early as along the shortest ray of the wider cone. The true range is assumed to be uniformly
    // distributed between this ray's length and the expected range.
    let soonest_m = stretch * height_m / math::cos((incidence - beam.unsure_rad).max(0.0));
    let unsure_m = (expected_m - soonest_m).max(0.0) / math::sqrt(3.0);
    let mut row = ScalarUpdate::new(range_m - expected_m, sd_m * sd_m + unsure_m * unsure_m);
    let mut by = [0.0; ERRORS];
    put(&mut by, ATTITUDE, Vec3::<Tunnel>::new(0.0, along.z(), -along.y()));
    let across = 1.0 - along.x() * along.x();
    // The second derivative by position is that of the range to a circular wall around the sonar. The one by rotation
    // is that of height / cos(incidence).
    let secant = 1.0 / cosine;
    let by_turn = expected_m * (2.0 * secant * secant - 1.0);
    let tangent = math::sqrt((secant * secant - 1.0).max(0.0));
    row.bends = [secant / height_m.max(LEAST_HEIGHT_M), by_turn, secant * tangent];
    row.lean = Some(Lean { along: along.x(), by, slope_m: expected_m / across });
    let row = row.with(POSITION, normal.scaled(stretch / cos)).with(ATTITUDE, turning);
    Some(row.with_one(RANGES, designed_m))
}

/// Predicts the height of a pressure sensor above the tunnel floor, m; `offset` is its position relative to the
/// inertial unit.
pub fn height(state: &State, offset: Vec3<Body>, height_m: f64, sd_m: f64) -> ScalarUpdate {
    let arm = state.attitude * offset;
    let expected_m = state.position.z() + arm.z() + state.depth_offset_m;
    ScalarUpdate::new(height_m - expected_m, sd_m * sd_m)
        .with(POSITION, Vec3::<Tunnel>::new(0.0, 0.0, 1.0))
        .with(ATTITUDE, Vec3::<Tunnel>::new(arm.y(), -arm.x(), 0.0))
        .with_one(DEPTH, 1.0)
}

/// Predicts the chainage that the cable shows; `offset` is the position of the cable's end relative to the inertial
/// unit.
pub fn chainage(state: &State, offset: Vec3<Body>, chainage_m: f64, sd_m: f64) -> ScalarUpdate {
    let arm = state.attitude * offset;
    let expected_m = state.position.x() + arm.x() + state.creep_m + state.slack_m;
    ScalarUpdate::new(chainage_m - expected_m, sd_m * sd_m)
        .with(POSITION, Vec3::<Tunnel>::new(1.0, 0.0, 0.0))
        .with(ATTITUDE, Vec3::<Tunnel>::new(0.0, arm.z(), -arm.y()))
        .with_one(CREEP, 1.0)
        .with_one(SLACK, 1.0)
}

/// Predicts the attitude that an inertial unit computes, as rotations about the tunnel's x, y and z axes. About z, the
/// unit is modelled as a compass with a deviation.
///
/// The model compares rotations, not angles, so it is smooth at any attitude, including a pitch of 90 degrees.
pub fn attitude(
    state: &State,
    measured: Rot<Tunnel, Body>,
    tilt_sd: f64,
    heading_sd: f64,
) -> [ScalarUpdate; 3] {
    let off = rotation_vector(measured * state.attitude.inverse());
    let row = |residual: f64, axis: usize, sd: f64| {
        ScalarUpdate::new(residual, sd * sd).with_one(ATTITUDE + axis, 1.0)
    };
    [
        row(off.x(), 0, tilt_sd),
        row(off.y(), 1, tilt_sd),
        row(off.z() - state.heading_offset_rad, 2, heading_sd).with_one(HEADING, 1.0),
    ]
}

/// Predicts the velocity over ground in the frame of a sensor, m/s; `offset` is its position relative to the inertial
/// unit.
///
/// `rate_radps` is the turn rate of the body.
pub fn velocity(
    state: &State,
    (offset, mounted): (Vec3<Body>, Rot<Body, Sensor>),
    rate_radps: Vec3<Body>,
    measured_mps: Vec3<Sensor>,
    sd_mps: f64,
) -> [ScalarUpdate; 3] {
    let moved = state.velocity_mps;
    let in_body = state.attitude.inverse() * moved + rate_radps.cross(&offset);
    let off = measured_mps + -(mounted.inverse() * in_body);
    let axes = [Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.0, 0.0, 1.0)];
    let residuals = [off.x(), off.y(), off.z()];
    core::array::from_fn(|k| {
        // One axis of the sensor's frame, in the tunnel frame.
        let axis = state.attitude * (mounted * axes.get(k).copied().unwrap_or_else(Vec3::zero));
        let residual = residuals.get(k).copied().unwrap_or(0.0);
        ScalarUpdate::new(residual, sd_mps * sd_mps).with(VELOCITY, axis).with(ATTITUDE, axis.cross(&moved))
    })
}

/// Returns measurements of the gyro bias, rad/s: the mean turn rate of an inertial unit that does not turn.
pub fn no_turn(state: &State, mean_radps: Vec3<Body>, sd_radps: f64) -> [ScalarUpdate; 3] {
    let off = mean_radps + -state.rate_bias_radps;
    let off = [off.x(), off.y(), off.z()];
    core::array::from_fn(|k| {
        ScalarUpdate::of(RATE_BIAS + k, off.get(k).copied().unwrap_or(0.0), sd_radps * sd_radps)
    })
}

/// Returns the measurement of zero velocity (ZUPT), one scalar for each axis.
pub fn rest(state: &State, sd_mps: f64) -> [ScalarUpdate; 3] {
    let moved = [state.velocity_mps.x(), state.velocity_mps.y(), state.velocity_mps.z()];
    core::array::from_fn(|k| {
        ScalarUpdate::new(-moved.get(k).copied().unwrap_or(0.0), sd_mps * sd_mps).with_one(VELOCITY + k, 1.0)
    })
}

/// Returns the standard deviation that noise and the rounding to a quantum cause together.
pub fn with_quantum(sd: f64, quantum: f64) -> f64 {
    math::hypot(sd, quantum / math::sqrt(12.0))
}
