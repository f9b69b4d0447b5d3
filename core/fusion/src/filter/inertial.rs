//! Inertial propagation of the estimate and its errors.
//!
//! Derivation: `docs/why/navigation.md`, "Propagation".

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::factors::{Factors, Noise};
use super::settings::{GaussMarkov, Settings};
use super::state::{
    ATTITUDE, CREEP, DEPTH, ERRORS, Errors, FORCE_BIAS, HEADING, POSITION, RANGES, RATE_BIAS, SCALE, SLACK,
    SLACK_RATE, State, VELOCITY, cross, matrix, rotation,
};
use headrace_geometry::frames::{Body, Vec3};
use headrace_geometry::math;

/// Mean of an inertial unit's samples over an interval, in the body frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct InertialSample {
    /// Turn rate, rad/s. `None` without gyro data; the attitude is then kept, and its error grows fast.
    pub rate_radps: Option<Vec3<Body>>,
    /// Specific force, m/s^2. `None` without accelerometer data; the velocity is then kept, and its error grows fast.
    pub force_mps2: Option<Vec3<Body>>,
}

/// Number of values in the record of a leg. A leg is the inertial motion of an epoch.
pub const LEG_NUMBERS: usize = 1 + 5 * 9 + 2 * 3 + 2 + 2 + 2 + 2;

/// Inertial motion accumulated since the errors were last propagated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Leg {
    dt_s: f64,
    /// Integral of the rotation matrix over times with gyro data.
    turned: Matrix3<f64>,
    /// Integral (`pushed`) and double integral of the rotation matrix over times with accelerometer data.
    pushed: Matrix3<f64>,
    pushed_twice: Matrix3<f64>,
    /// Velocity change and displacement (`way`) by the specific force. Gravity is not included.
    velocity: Vector3<f64>,
    way: Vector3<f64>,
    /// Effects of a gyro bias on velocity (`tilting`) and displacement. They arise because the bias tilts the estimated
    /// direction of the force.
    tilting: Matrix3<f64>,
    tilting_twice: Matrix3<f64>,
    /// Duration without gyro data, and duration without accelerometer data, s.
    blind_s: [f64; 2],
    /// Distance along the tunnel, m, and the cable's scale error on it, a ratio. Their product adds to the creep.
    creeping: [f64; 2],
    /// Factors that multiply the process noise of gyro and accelerometer biases.
    unrest: [f64; 2],
    /// Standard deviation, m, and time constant, s, of the cable's slack.
    slack: [f64; 2],
}

impl Default for Leg {
    fn default() -> Self {
        Self {
            dt_s: 0.0,
            turned: Matrix3::zeros(),
            pushed: Matrix3::zeros(),
            pushed_twice: Matrix3::zeros(),
            velocity: Vector3::zeros(),
            way: Vector3::zeros(),
            tilting: Matrix3::zeros(),
            tilting_twice: Matrix3::zeros(),
            blind_s: [0.0; 2],
            creeping: [0.0; 2],
            unrest: [1.0; 2],
            slack: [0.0, 1.0],
        }
    }
}

impl State {
    /// Propagates the estimate over `dt_s`, and adds the effect on the estimate's errors to `leg`.
    pub fn go_on(&mut self, felt: &InertialSample, dt_s: f64, gravity_mps2: f64, leg: &mut Leg) {
        let from_m = self.position.x();
        let (turn, force) = self.move_on(felt, dt_s, gravity_mps2);
        leg.creeping = [leg.creeping[0] + self.position.x() - from_m, self.scale];
        leg.add(dt_s, turn, force, felt.rate_radps.is_some());
    }

    /// Propagates the estimate over `dt_s`.
    ///
    /// Returns the attitude in the middle of the interval, and the specific force in the tunnel frame.
    pub fn move_on(
        &mut self,
        felt: &InertialSample,
        dt_s: f64,
        gravity_mps2: f64,
    ) -> (Matrix3<f64>, Option<Vector3<f64>>) {
        debug_assert!(dt_s >= 0.0, "an estimate is propagated forwards in time: {dt_s} s");
        let half = felt.rate_radps.map(|rate| rotation((rate + -self.rate_bias_radps).scaled(dt_s / 2.0)));
        let middle = half.map_or(self.attitude, |half| self.attitude * half);
        let turn = matrix(middle);
        let force = felt.force_mps2.map(|force| turn * (force + -self.force_bias_mps2).0);
        let lift = Vector3::new(0.0, 0.0, -gravity_mps2);
        let gain = Vec3::of(force.map_or_else(Vector3::zeros, |force| (force + lift) * dt_s));
        let way = (self.velocity_mps + gain.scaled(0.5)).scaled(dt_s);
        self.position = self.position + way;
        self.creep_m += self.scale * way.x();
        self.velocity_mps = self.velocity_mps + gain;
        self.attitude = half.map_or(self.attitude, |half| middle * half);
        (turn, force)
    }
}

impl Leg {
    fn add(&mut self, dt_s: f64, turn: Matrix3<f64>, force: Option<Vector3<f64>>, turns: bool) {
        let half = dt_s * dt_s / 2.0;
        let turning = if turns { turn } else { Matrix3::zeros() };
        self.way += self.velocity * dt_s;
        self.pushed_twice += self.pushed * dt_s;
        self.tilting_twice += self.tilting * dt_s;
        if let Some(force) = force {
            let tilting = cross(force) * (self.turned + turning * (dt_s / 2.0));
            self.tilting_twice += tilting * half;
            self.tilting += tilting * dt_s;
            self.way += force * half;
            self.velocity += force * dt_s;
            self.pushed_twice += turn * half;
            self.pushed += turn * dt_s;
        }
        self.turned += turning * dt_s;
        self.dt_s += dt_s;
        let [without_rate, without_force] = &mut self.blind_s;
        *without_rate += if turns { 0.0 } else { dt_s };
        *without_force += if force.is_some() { 0.0 } else { dt_s };
    }

    /// Returns the process noise of the cable's slack. The model of slack is white noise that passes two equal lags in
    /// series.
    fn slack_noises(&self) -> [Noise; 2] {
        let slack = self.slack();
        let lags = self.dt_s / slack.time_s;
        let left = math::exp(-2.0 * lags);
        let drive = slack.drive();
        let of_rate = drive * drive * (1.0 - left);
        let of_both = drive * drive * slack.time_s / 2.0 * (1.0 - left * (1.0 + 2.0 * lags));
        let of_slack = slack.reach * slack.reach * (1.0 - left * (1.0 + 2.0 * lags * (1.0 + lags)));
        if of_rate <= 0.0 {
            return [Noise::of_one(SLACK, 0.0); 2];
        }
        [
            Noise::of_two(SLACK_RATE, (SLACK, of_both / of_rate), of_rate),
            Noise::of_one(SLACK, (of_slack - of_both * of_both / of_rate).max(0.0)),
        ]
    }

    fn slack(&self) -> GaussMarkov {
        let [reach, time_s] = self.slack;
        GaussMarkov { reach, time_s }
    }

    /// Returns the values of this leg, from which [`Self::of_numbers`] restores it.
    pub fn numbers(&self) -> impl Iterator<Item = f64> + '_ {
        let squares = [&self.turned, &self.pushed, &self.pushed_twice, &self.tilting, &self.tilting_twice];
        let squares = squares.into_iter().flat_map(|matrix| matrix.iter().copied());
        let ways = [&self.velocity, &self.way].into_iter().flat_map(|way| way.iter().copied());
        let rest = self.blind_s.into_iter().chain(self.creeping).chain(self.unrest).chain(self.slack);
        [self.dt_s].into_iter().chain(squares).chain(ways).chain(rest)
    }

    /// Creates a leg from the values of a record; `None` if there are too few.
    pub fn of_numbers(numbers: &mut impl Iterator<Item = f64>) -> Option<Self> {
        let mut leg = Self { dt_s: numbers.next()?, ..Self::default() };
        let squares = [
            &mut leg.turned,
            &mut leg.pushed,
            &mut leg.pushed_twice,
            &mut leg.tilting,
            &mut leg.tilting_twice,
        ];
        let squares = squares.into_iter().flat_map(|matrix| matrix.iter_mut());
        let ways = [&mut leg.velocity, &mut leg.way].into_iter().flat_map(|way| way.iter_mut());
        let rest = leg.blind_s.iter_mut().chain(&mut leg.creeping).chain(&mut leg.unrest);
        let rest = rest.chain(&mut leg.slack);
        for slot in squares.chain(ways).chain(rest) {
            *slot = numbers.next()?;
        }
        Some(leg)
    }

    /// Returns this leg with other noise factors and another slack model.
    ///
    /// `unrest` multiplies the process noise of gyro and accelerometer biases.
    #[must_use]
    pub fn with_noise(self, unrest: [f64; 2], slack: GaussMarkov) -> Self {
        debug_assert!(unrest.iter().all(|factor| *factor >= 1.0), "noise is only raised: {unrest:?}");
        debug_assert!(
            slack.reach > 0.0 && slack.time_s > 0.0,
            "slack has a size and a time constant: {slack:?}"
        );
        Self { unrest, slack: [slack.reach, slack.time_s], ..self }
    }

    /// Duration of the leg, s.
    pub fn dt_s(&self) -> f64 {
        self.dt_s
    }

    /// Whether inertial data were missing in any part of the leg.
    pub fn is_blind(&self) -> bool {
        self.blind_s.iter().any(|blind_s| *blind_s > 0.0)
    }

    /// Returns the transition of errors from the beginning to the end of the leg.
    pub fn transition(&self, settings: &Settings) -> Transition {
        let fading = |time_s: f64| math::exp(-self.dt_s / time_s).max(LEAST_FADING);
        Transition {
            dt_s: self.dt_s,
            velocity_tilted: -cross(self.velocity),
            way_tilted: -cross(self.way),
            turned: -self.turned,
            velocity_pushed: -self.pushed,
            way_pushed: -self.pushed_twice,
            velocity_turned: self.tilting,
            way_turned: self.tilting_twice,
            creeping: self.creeping,
            fading: [
                (FORCE_BIAS, fading(settings.force_bias.time_s)),
                (FORCE_BIAS + 1, fading(settings.force_bias.time_s)),
                (FORCE_BIAS + 2, fading(settings.force_bias.time_s)),
                (RATE_BIAS, fading(settings.rate_bias.time_s)),
                (RATE_BIAS + 1, fading(settings.rate_bias.time_s)),
                (RATE_BIAS + 2, fading(settings.rate_bias.time_s)),
                (SLACK, fading(self.slack().time_s)),
                (SLACK_RATE, fading(self.slack().time_s)),
                (HEADING, fading(settings.heading.time_s)),
            ],
        }
    }

    /// Adds the process noise: noise of the inertial sensors and drift of the sensor errors.
    pub fn disturb(&self, settings: &Settings, transition: &Transition, factors: &mut Factors<ERRORS>) {
        let [blind_rate_s, blind_force_s] = self.blind_s;
        let variance = |density: f64, blind_density: f64, blind_s: f64| {
            density * density * (self.dt_s - blind_s).max(0.0) + blind_density * blind_density * blind_s
        };
        let force = variance(settings.force_noise, settings.blind_force_noise, blind_force_s);
        let rate = variance(settings.rate_noise, settings.blind_rate_noise, blind_rate_s);
        for k in 0..3 {
            factors.add_all([
                // White force noise over the leg causes a displacement of two parts. One is correlated with the
                // velocity. The other is independent of it; its variance is that of the force noise times dt^2 / 12.
                Noise::of_two(VELOCITY + k, (POSITION + k, self.dt_s / 2.0), force),
                Noise::of_one(POSITION + k, force * self.dt_s * self.dt_s / 12.0),
                Noise::of_one(ATTITUDE + k, rate),
            ]);
        }
        factors.add_all(self.wandering(settings, transition));
    }

    /// Returns the process noise of the sensor errors.
    fn wandering(&self, settings: &Settings, transition: &Transition) -> [Noise; 12] {
        let fading = |i: usize, wander: GaussMarkov| {
            let left = transition.left_of(i);
            Noise::of_one(i, wander.reach * wander.reach * (1.0 - left * left))
        };
        let [rate_unrest, force_unrest] = self.unrest;
        let force = |k: usize| fading(FORCE_BIAS + k, settings.force_bias).scaled(force_unrest);
        let rate = |k: usize| fading(RATE_BIAS + k, settings.rate_bias).scaled(rate_unrest);
        let white = |i: usize, noise: f64| Noise::of_one(i, noise * noise * self.dt_s);
        let [slack, slack_alone] = self.slack_noises();
        [
            slack,
            slack_alone,
            force(0),
            force(1),
            force(2),
            rate(0),
            rate(1),
            rate(2),
            fading(HEADING, settings.heading),
            white(SCALE, settings.scale_noise),
            white(DEPTH, settings.depth_noise),
            white(RANGES, settings.range_scale_noise),
        ]
    }
}

/// Minimum decay factor of an error over a leg, to avoid a division by zero. An error that decays by more is
/// negligible.
const LEAST_FADING: f64 = 1e-3;

/// Transition of errors between two times: e' = F e.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transition {
    dt_s: f64,
    velocity_tilted: Matrix3<f64>,
    way_tilted: Matrix3<f64>,
    turned: Matrix3<f64>,
    velocity_pushed: Matrix3<f64>,
    way_pushed: Matrix3<f64>,
    velocity_turned: Matrix3<f64>,
    way_turned: Matrix3<f64>,
    /// Distance along the tunnel, m, and the cable's scale error on this distance.
    creeping: [f64; 2],
    /// Indices of the errors that decay over time, each with its decay factor.
    fading: [(usize, f64); 9],
}

impl Transition {
    /// Propagates the covariance of the errors through this transition.
    pub fn carry(&self, factors: &mut Factors<ERRORS>) {
        factors.shear(|column, len| self.shear(column, len));
        for (i, fading) in self.fading {
            factors.scale(i, fading);
        }
    }

    /// Propagates the estimated sensor errors, which decay towards zero.
    pub fn fade(&self, state: &mut State) {
        state.force_bias_mps2 = state.force_bias_mps2.scaled(self.left_of(FORCE_BIAS));
        state.rate_bias_radps = state.rate_bias_radps.scaled(self.left_of(RATE_BIAS));
        state.slack_m = (state.slack_m + state.slack_rate_mps * self.dt_s) * self.left_of(SLACK);
        state.slack_rate_mps *= self.left_of(SLACK_RATE);
        state.heading_offset_rad *= self.left_of(HEADING);
    }

    /// Decay factor of an error; 1 for an error that does not decay.
    fn left_of(&self, error: usize) -> f64 {
        self.fading.iter().find(|(i, _)| *i == error).map_or(1.0, |(_, left)| *left)
    }

    /// Propagates one vector of errors.
    pub fn apply(&self, errors: &mut Errors) {
        self.shear(errors, ERRORS);
        for (i, fading) in self.fading {
            if let Some(error) = errors.get_mut(i) {
                *error *= fading;
            }
        }
    }

    /// Applies the error transition without the decay of errors. Errors from index `len` on are zero.
    fn shear(&self, e: &mut Errors, len: usize) {
        if len <= VELOCITY {
            return;
        }
        let part = |from: usize| Vector3::from_fn(|k, _| e.get(from + k).copied().unwrap_or(0.0));
        let mut way = part(VELOCITY) * self.dt_s;
        let mut velocity = Vector3::zeros();
        let mut turn = Vector3::zeros();
        if len > ATTITUDE {
            let tilt = part(ATTITUDE);
            way += self.way_tilted * tilt;
            velocity += self.velocity_tilted * tilt;
        }
        if len > FORCE_BIAS {
            let (force, rate) = (part(FORCE_BIAS), part(RATE_BIAS));
            way += self.way_pushed * force + self.way_turned * rate;
            velocity += self.velocity_pushed * force + self.velocity_turned * rate;
            turn += self.turned * rate;
        }
        let [along_m, scale] = self.creeping;
        let creep = along_m * e.get(SCALE).copied().unwrap_or(0.0) + scale * way.x;
        if let Some(slot) = e.get_mut(CREEP) {
            *slot += creep;
        }
        if let Some([slack, rate]) =
            e.get_mut(SLACK..=SLACK_RATE).and_then(|pair| <&mut [f64; 2]>::try_from(pair).ok())
        {
            *slack += *rate * self.dt_s;
        }
        for (from, change) in [(POSITION, way), (VELOCITY, velocity), (ATTITUDE, turn)] {
            for (e, change) in e.iter_mut().skip(from).zip(change.iter()) {
                *e += change;
            }
        }
    }
}
