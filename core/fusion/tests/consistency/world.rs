//! Dives drawn from seeds: a true motion, and readings of sensors with known errors.
//!
//! This module shares no code with the simulator. With the filter, it shares only the wall, the site and the units.

use headrace_fusion::filter::settings::Settings;
use headrace_geometry::frames::{Body, Mount, Point3, Pose, Rot, Sensor, Tunnel, Vec3, head_direction};
use headrace_geometry::math;
use headrace_geometry::site::Site;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_geometry::tunnel::{Profile, shapes};
use headrace_sensor::device::{BiasSpec, InertialNoise, SensorInfo, SensorKind};
use headrace_sensor::reading::{EchoRange, Level, Reading, SonarReturn, TetherLength, WaterPressure};

pub(crate) const IMU: usize = 0;
pub(crate) const TETHER: usize = 1;
pub(crate) const DEPTH: usize = 2;
/// Source number of the first of four echosounders: left, right, down, up.
pub(crate) const ECHOES: usize = 3;
/// Source number of the first of two heads.
pub(crate) const HEADS: usize = 7;

pub(crate) const VELOCITY_LOG: usize = 9;

const DEGREE: f64 = core::f64::consts::PI / 180.0;
const ORIGIN: MonoNs = MonoNs(5_000_000_000_000);
const GRAVITY_MPS2: f64 = 9.80665;
const IMU_S: f64 = 0.01;
const TETHER_S: f64 = 0.02;
const HEAD_RADPS: f64 = 1.7;

/// Motion of the vehicle along the tunnel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Motion {
    Steady,
    Swaying,
    StopAndGo,
    BackAndForth,
}

/// Fault of a dive: a sensor that hangs, sticks or is silent for a while.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Fault {
    None,
    /// The inertial unit repeats its last readings.
    ImuHangs,
    /// The cable counter's wheel is stuck while the cable runs.
    CableSticks,
    /// The cable counter is silent.
    CableSilent,
    /// The depth sensor repeats its last reading.
    DepthHangs,
    /// An echosounder repeats its last reading.
    EchoHangs,
}

/// Behaviour of the velocity log.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Log {
    /// There is no velocity log.
    None,
    Sound,
    /// The velocity log repeats its last reading for a while.
    Hangs,
    /// The velocity log always shows a fifth too much.
    Scaled,
    /// For a while, the log follows silt that drifts at 0.15 m/s.
    Drifts,
}

impl Log {
    pub(crate) const ALL: [Self; 4] = [Self::Sound, Self::Hangs, Self::Scaled, Self::Drifts];
}

impl Motion {
    pub(crate) const ALL: [Self; 4] = [Self::Steady, Self::Swaying, Self::StopAndGo, Self::BackAndForth];
}

impl Fault {
    pub(crate) const ALL: [Self; 6] =
        [Self::None, Self::ImuHangs, Self::CableSticks, Self::CableSilent, Self::DepthHangs, Self::EchoHangs];
}

/// Parameters of a simulated dive, drawn from its seed.
#[derive(Debug, Clone, Copy)]
#[expect(clippy::struct_excessive_bools, reason = "each is a factor of its own")]
pub(crate) struct Recipe {
    pub(crate) seed: u64,
    pub(crate) quantum_m: f64,
    pub(crate) states_quantum: bool,
    pub(crate) floors: bool,
    pub(crate) speed_mps: f64,
    pub(crate) slack_m: f64,
    pub(crate) slack_period_s: f64,
    /// Whether the cable's slack is a single sine over time instead of a sum of three sines.
    pub(crate) slack_is_sine: bool,
    /// Whether the vehicle file declares slack and inertial noise correctly.
    pub(crate) is_declared: bool,
    /// Class of the inertial unit: 0 has the noise of a good data sheet, 1 is typical of a small vehicle, 2 is
    /// cheap.
    pub(crate) imu_class: usize,
    pub(crate) motion: Motion,
    pub(crate) fault: Fault,
    pub(crate) fault_from_s: f64,
    pub(crate) fault_for_s: f64,
    pub(crate) log: Log,
    pub(crate) start_m: f64,
    pub(crate) duration_s: f64,
}

/// Random number generator (splitmix64).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Draws(u64);

impl Draws {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Returns a uniform number between 0 and 1.
    pub(crate) fn uniform(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn between(&mut self, least: f64, most: f64) -> f64 {
        least + (most - least) * self.uniform()
    }

    fn one_of<T: Copy>(&mut self, all: &[T]) -> T {
        let number = (self.uniform() * all.len() as f64) as usize;
        all[number.min(all.len() - 1)]
    }

    /// Returns a normal number with standard deviation 1 (Box and Muller).
    pub(crate) fn normal(&mut self) -> f64 {
        let (a, b) = (self.uniform().max(1e-300), self.uniform());
        math::sqrt(-2.0 * math::ln(a)) * math::cos(math::TAU * b)
    }

    fn normal3<F>(&mut self, sd: f64) -> Vec3<F> {
        Vec3::new(sd * self.normal(), sd * self.normal(), sd * self.normal())
    }
}

impl Recipe {
    /// Returns the dive parameters for a seed.
    pub(crate) fn of(seed: u64) -> Self {
        let mut draws = Draws(seed.wrapping_mul(0xD134_2543_DE82_EF95));
        let log_between = |draws: &mut Draws, least: f64, most: f64| {
            math::exp(draws.between(math::ln(least), math::ln(most)))
        };
        let quantum_m = if draws.uniform() < 0.3 { 0.01 } else { log_between(&mut draws, 5e-4, 0.05) };
        let speed_mps = if draws.uniform() < 0.4 {
            draws.one_of(&[0.05, 0.1, 0.2, 0.3, 0.4, 0.5])
        } else {
            draws.between(0.05, 0.5)
        };
        let duration_s = draws.between(60.0, 300.0);
        let fault = if draws.uniform() < 0.5 { Fault::None } else { draws.one_of(&Fault::ALL[1..]) };
        let fault_for_s = draws.between(3.0, 30.0);
        Self {
            seed,
            quantum_m,
            states_quantum: draws.uniform() < 0.5,
            floors: draws.uniform() < 0.5,
            speed_mps,
            slack_m: if draws.uniform() < 0.15 { 0.0 } else { draws.between(0.0, 0.15) },
            slack_period_s: log_between(&mut draws, 2.0, 60.0),
            slack_is_sine: draws.uniform() < 0.5,
            is_declared: draws.uniform() < 0.5,
            imu_class: draws.one_of(&[0, 1, 2]),
            motion: draws.one_of(&Motion::ALL),
            fault,
            fault_from_s: draws.between(25.0, duration_s - 15.0),
            fault_for_s,
            log: Log::None,
            start_m: draws.one_of(&[10.0, 3000.0, 6900.0]),
            duration_s,
        }
    }

    /// Returns the dive parameters for a seed, with a velocity log. In turn, the log is sound or has one of three
    /// faults.
    pub(crate) fn with_log(seed: u64) -> Self {
        Self { log: Log::ALL[seed as usize % Log::ALL.len()], fault: Fault::None, ..Self::of(seed) }
    }

    /// Returns the parameters of a dive in which the vehicle hovers for five minutes. The vehicle file declares slack
    /// and inertial noise correctly.
    pub(crate) fn hovering(seed: u64) -> Self {
        let recipe = Self::of(seed);
        let slack_m = recipe.slack_m.min(0.06);
        let hovers = Self { speed_mps: 0.0, slack_m, is_declared: true, fault: Fault::None, ..recipe };
        Self { duration_s: 300.0, motion: Motion::ALL[seed as usize % 2], ..hovers }
    }

    /// Fastest change of the cable's slack if the slack is a single sine, m/s.
    pub(crate) fn slack_rate_mps(&self) -> f64 {
        self.slack_m * math::TAU / self.slack_period_s
    }

    /// Noise of the simulated inertial unit.
    pub(crate) fn inertial(&self) -> InertialNoise {
        let unit =
            |rate: f64, turn_on: f64, in_run: f64, force: f64, force_on: f64, force_run: f64| InertialNoise {
                rate_noise: rate * DEGREE,
                rate_bias: BiasSpec { turn_on: turn_on * DEGREE, in_run: in_run * DEGREE, time_s: 300.0 },
                force_noise: force,
                force_bias: BiasSpec { turn_on: force_on, in_run: force_run, time_s: 300.0 },
            };
        match self.imu_class {
            0 => unit(0.0077, 0.05, 8.0 / 3600.0, 6e-4, 0.02, 2e-3),
            1 => unit(0.01, 0.1, 0.02, 2e-3, 0.02, 0.01),
            _ => unit(0.02, 0.2, 0.05, 4e-3, 0.03, 0.02),
        }
    }

    /// Noise settings as the simulated vehicle file states them.
    pub(crate) fn settings(&self) -> Settings {
        let usual = Settings::default();
        if !self.is_declared {
            return usual;
        }
        let mut settings = usual.with_inertial(&self.inertial());
        settings.slack.reach = (self.slack_m / math::sqrt(2.0)).max(0.001);
        settings.slack.time_s = self.slack_period_s / math::TAU;
        settings
    }
}

/// Function that adds the readings of a source. Its inputs are period and phase, s; source number; and a function that
/// returns the reading at a time, s.
type Every<'a> = dyn FnMut(f64, f64, usize, &mut dyn FnMut(f64) -> Option<Reading>) + 'a;

/// A sum of sine functions of time, each with amplitude, angular frequency and phase.
type Sines = Vec<(f64, f64, f64)>;

fn value(sines: &Sines, t: f64) -> f64 {
    sines.iter().map(|(a, w, p)| a * math::sin(w * t + p)).sum()
}

/// A simulated dive, with the true motion that follows from its parameters.
pub(crate) struct Dive {
    pub(crate) recipe: Recipe,
    pub(crate) profile: Profile,
    pub(crate) site: Site,
    /// The vehicle's true distances along the tunnel, m, at times that are [`STEP_S`] apart.
    way_m: Vec<f64>,
    slack: Sines,
    swaying: [Sines; 5],
    biases: (Vec3<Body>, Vec3<Body>),
    wander: [Sines; 6],
    tilts: [Sines; 3],
}

/// Time between two stored points of the true trajectory, s.
const STEP_S: f64 = 0.005;

impl Dive {
    pub(crate) fn new(recipe: Recipe) -> Self {
        let mut draws = Draws(recipe.seed ^ 0x5EED_0FD1);
        let mut sines = |reach: f64, period_s: f64, count: usize| -> Sines {
            let share = 1.0 / math::sqrt(count as f64);
            let one = |k: usize, draws: &mut Draws| {
                let period_s = period_s * if k == 0 { 1.0 } else { draws.between(0.8, 2.0) };
                (reach * share, math::TAU / period_s, draws.between(0.0, math::TAU))
            };
            (0..count).map(|k| one(k, &mut draws)).collect()
        };
        let slack_count = if recipe.slack_is_sine { 1 } else { 3 };
        let slack = sines(recipe.slack_m, recipe.slack_period_s, slack_count);
        let lively = if recipe.motion == Motion::Swaying { 1.0 } else { 0.2 };
        let swaying = [
            sines(0.3 * lively, 17.0, 2),
            sines(0.2 * lively, 23.0, 2),
            sines(0.03 * lively, 7.0, 2),
            sines(0.03 * lively, 9.0, 2),
            sines(0.12 * lively, 14.0, 2),
        ];
        let inertial = recipe.inertial();
        let wander = core::array::from_fn(|k| {
            let bias = if k < 3 { inertial.rate_bias } else { inertial.force_bias };
            sines(math::sqrt(2.0) * bias.in_run, 6.0 * bias.time_s, 2)
        });
        let tilts = core::array::from_fn(|k| sines(if k < 2 { 0.5 } else { 1.5 } * DEGREE, 40.0, 2));
        let biases = (draws.normal3(inertial.rate_bias.turn_on), draws.normal3(inertial.force_bias.turn_on));
        let way_m = way(&recipe, &mut draws);
        let site = Site { axis_yaw_rad: 0.7, ..Site::default() };
        let profile = shapes::ceran().unwrap();
        Self { recipe, profile, site, way_m, slack, swaying, biases, wander, tilts }
    }

    /// Returns the vehicle's true chainage at a time, m.
    pub(crate) fn chainage_m(&self, t: f64) -> f64 {
        let place = (t.max(0.0) / STEP_S).min((self.way_m.len() - 2) as f64);
        let before = place as usize;
        let share = place - before as f64;
        let (a, b) = (self.way_m[before], self.way_m[before + 1]);
        self.recipe.start_m + a + share * (b - a)
    }

    pub(crate) fn pose(&self, t: f64) -> Pose {
        let [y, z, roll, pitch, yaw] = [0, 1, 2, 3, 4].map(|k| value(&self.swaying[k], t));
        Pose {
            position: Point3::new(self.chainage_m(t), y, 4.0 + z),
            attitude: Rot::from_roll_pitch_yaw(roll, pitch, yaw),
        }
    }

    pub(crate) fn is_faulty(&self, t: f64, fault: Fault) -> bool {
        let Recipe { fault: own, fault_from_s, fault_for_s, .. } = self.recipe;
        own == fault && (fault_from_s..fault_from_s + fault_for_s).contains(&t)
    }

    fn unit_velocity(&self, t: f64) -> Vec3<Tunnel> {
        const H_S: f64 = 0.01;
        let unit = |t: f64| self.pose(t).place(sensor(IMU).mount.position);
        (unit(t + H_S) - unit(t - H_S)).scaled(0.5 / H_S)
    }

    /// Returns the readings of all sensors, in order of time.
    pub(crate) fn events(&self) -> Vec<(MonoNs, usize, Reading)> {
        let mut events = Vec::new();
        let mut every =
            |period_s: f64, phase_s: f64, source: usize, what: &mut dyn FnMut(f64) -> Option<Reading>| {
                let last = (self.recipe.duration_s / period_s) as u64;
                for k in 1..last {
                    let t = k as f64 * period_s + phase_s;
                    if let Some(reading) = what(t) {
                        events.push((at(t), source, reading));
                    }
                }
            };
        self.inertial(&mut every);
        let mut draws = Draws(self.recipe.seed ^ 0xAB1E);
        let stuck_m = std::cell::Cell::new((0.0, 0.0));
        every(TETHER_S, 0.003, TETHER, &mut |t| self.tether(t, &stuck_m));
        let mut held = None;
        every(0.25, 0.029, DEPTH, &mut |t| {
            let reading = self.pressure(t, &mut draws);
            if self.is_faulty(t, Fault::DepthHangs) {
                Some(*held.get_or_insert(reading))
            } else {
                held = None;
                Some(reading)
            }
        });
        for k in 0..4 {
            let mut held = None;
            every(0.1, 0.031 + 0.007 * k as f64, ECHOES + k, &mut |t| {
                let reading = self.echo(ECHOES + k, t, &mut draws);
                if k == 0 && self.is_faulty(t, Fault::EchoHangs) {
                    Some(*held.get_or_insert(reading))
                } else {
                    held = None;
                    Some(reading)
                }
            });
        }
        for k in 0..2 {
            every(0.05, 0.011 + 0.005 * k as f64, HEADS + k, &mut |t| {
                Some(self.sonar(HEADS + k, t, &mut draws))
            });
        }
        let mut draws = Draws(self.recipe.seed ^ 0xD0BB);
        let mut held = None;
        every(0.125, 0.017, VELOCITY_LOG, &mut |t| self.over_ground(t, &mut held, &mut draws));
        events.sort_by_key(|(at, ..)| *at);
        events
    }

    fn over_ground(&self, t: f64, held: &mut Option<Reading>, draws: &mut Draws) -> Option<Reading> {
        const H_S: f64 = 0.01;
        let Recipe { log, fault_from_s, fault_for_s, .. } = self.recipe;
        let mount = sensor(VELOCITY_LOG).mount;
        let at = |t: f64| self.pose(t).place(mount.position);
        let moved = (at(t + H_S) - at(t - H_S)).scaled(0.5 / H_S);
        let moved = self.pose(t).attitude.inverse() * moved + draws.normal3::<Body>(0.01);
        let is_now = (fault_from_s..fault_from_s + fault_for_s).contains(&t);
        let moved = match log {
            Log::None => return None,
            Log::Scaled => moved.scaled(1.2),
            Log::Drifts if is_now => moved + Vec3::new(-0.15, 0.0, 0.0),
            Log::Sound | Log::Hangs | Log::Drifts => moved,
        };
        let reading = Reading::VelocityOverGround(mount.rotation.inverse() * moved);
        if log == Log::Hangs && is_now {
            return Some(*held.get_or_insert(reading));
        }
        *held = None;
        Some(reading)
    }

    fn inertial(&self, every: &mut Every<'_>) {
        let mut draws = Draws(self.recipe.seed ^ 0x1A77);
        let noise = self.recipe.inertial();
        let mut held: [Option<Reading>; 3] = [None; 3];
        let hold = |held: &mut Option<Reading>, t: f64, reading: Reading| {
            if self.is_faulty(t, Fault::ImuHangs) {
                Some(*held.get_or_insert(reading))
            } else {
                *held = None;
                Some(reading)
            }
        };
        let mount = sensor(IMU).mount.rotation;
        every(IMU_S, 0.0, IMU, &mut |t| {
            let (then, now) = (self.pose(t - IMU_S).attitude, self.pose(t).attitude);
            let turn = log::<Body>(then.inverse() * now).scaled(1.0 / IMU_S);
            let bias = self.biases.0
                + Vec3::new(value(&self.wander[0], t), value(&self.wander[1], t), value(&self.wander[2], t));
            let white = draws.normal3::<Body>(noise.rate_noise / math::sqrt(IMU_S));
            hold(&mut held[0], t, Reading::AngularRate(mount.inverse() * (turn + bias + white)))
        });
        every(IMU_S, 0.0, IMU, &mut |t| {
            let then = t - IMU_S;
            let gain = (self.unit_velocity(t) + -self.unit_velocity(then)).scaled(1.0 / IMU_S);
            let force = gain + Vec3::new(0.0, 0.0, GRAVITY_MPS2);
            let middle = self.pose(t - IMU_S / 2.0).attitude;
            let bias = self.biases.1
                + Vec3::new(value(&self.wander[3], t), value(&self.wander[4], t), value(&self.wander[5], t));
            let white = draws.normal3::<Body>(noise.force_noise / math::sqrt(IMU_S));
            hold(
                &mut held[1],
                t,
                Reading::SpecificForce(mount.inverse() * (middle.inverse() * force + bias + white)),
            )
        });
        every(0.1, 0.003, IMU, &mut |t| {
            let [roll, pitch, yaw] =
                [0, 1, 2].map(|k| value(&self.tilts[k], t) + 0.1 * DEGREE * draws.normal());
            let axis = Rot::<Level, Tunnel>::from_roll_pitch_yaw(0.0, 0.0, self.site.axis_yaw_rad);
            let off = Rot::<Tunnel, Tunnel>::from_roll_pitch_yaw(roll, pitch, yaw);
            hold(&mut held[2], t, Reading::Attitude(axis * (off * self.pose(t).attitude) * mount))
        });
    }

    fn tether(&self, t: f64, stuck: &std::cell::Cell<(f64, f64)>) -> Option<Reading> {
        if self.is_faulty(t, Fault::CableSilent) {
            return None;
        }
        let payout_m = self.chainage_m(t) + value(&self.slack, t);
        let (stuck_m, lost_m) = stuck.get();
        // A stuck wheel that is free again does not count the distance that it has missed.
        let shown_m = if self.is_faulty(t, Fault::CableSticks) {
            stuck.set((stuck_m, payout_m - stuck_m));
            stuck_m
        } else {
            stuck.set((payout_m - lost_m, lost_m));
            payout_m - lost_m
        };
        let quantum_m = self.recipe.quantum_m;
        let steps = shown_m / quantum_m;
        let whole = if self.recipe.floors { math::floor_to_i64(steps) } else { math::round_to_i64(steps) };
        let resolution_m = if self.recipe.states_quantum { quantum_m } else { 5e-4 };
        // The wheel counts in coarse steps, and the converter rounds these counts to fine steps.
        let length_m = math::round_to_i64(whole as f64 * quantum_m / resolution_m) as f64 * resolution_m;
        Some(Reading::TetherLength(TetherLength { length_m, resolution_m, restart: None }))
    }

    fn pressure(&self, t: f64, draws: &mut Draws) -> Reading {
        let height_m = self.pose(t).place(sensor(DEPTH).mount.position).z() + 0.01 * draws.normal();
        Reading::Pressure(WaterPressure {
            pressure_pa: self.site.pressure_pa(self.site.surface_above_floor_m - height_m),
            resolution_pa: 20.0,
            temperature_degc: 10.0,
        })
    }

    fn range_m(&self, source: usize, t: f64, along: Vec3<Sensor>) -> f64 {
        let (pose, mount) = (self.pose(t), sensor(source).mount);
        let (from, beam) = (pose.place(mount.position), pose.attitude * (mount.rotation * along));
        self.profile.cast([from.y(), from.z()], [beam.y(), beam.z()]).unwrap().range_m
    }

    fn echo(&self, source: usize, t: f64, draws: &mut Draws) -> Reading {
        let range_m = self.range_m(source, t, Vec3::new(1.0, 0.0, 0.0)) + 0.01 * draws.normal();
        let sound_speed_mps = self.site.sound_speed_mps;
        Reading::Echo(EchoRange { range_m: Some(range_m), confidence: 1.0, sound_speed_mps })
    }

    fn sonar(&self, source: usize, t: f64, draws: &mut Draws) -> Reading {
        let angle_rad = math::wrap(t * HEAD_RADPS + source as f64, math::TAU);
        let range_m = self.range_m(source, t, head_direction(angle_rad)) + 0.015 * draws.normal();
        Reading::Sonar(SonarReturn {
            angle_rad,
            range_m: Some(range_m),
            resolution_m: 0.01,
            max_range_m: 20.0,
            sound_speed_mps: self.site.sound_speed_mps,
        })
    }
}

/// Returns the vehicle's true distance along the tunnel at times [`STEP_S`] apart, m.
fn way(recipe: &Recipe, draws: &mut Draws) -> Vec<f64> {
    let steps = (recipe.duration_s / STEP_S) as usize + 4;
    let speed = recipe.speed_mps;
    let sway = (math::TAU / draws.between(5.0, 20.0), draws.between(0.0, math::TAU), draws.between(0.1, 0.4));
    let mut legs = Vec::new();
    let mut t = 12.0;
    while t < recipe.duration_s {
        let (go_s, stop_s) = (draws.between(5.0, 25.0), draws.between(2.0, 12.0));
        legs.push((t, t + go_s));
        t += go_s + stop_s;
    }
    let wanted = |t: f64| match recipe.motion {
        _ if t < 10.0 => 0.0,
        Motion::Steady => speed,
        Motion::Swaying => speed * (1.0 + sway.2 * math::sin(sway.0 * t + sway.1)),
        Motion::StopAndGo => {
            if legs.iter().any(|(from, to)| (*from..*to).contains(&t)) {
                speed
            } else {
                0.0
            }
        }
        Motion::BackAndForth => {
            let phase = math::wrap(t - 10.0, 80.0);
            match phase {
                ..45.0 => speed,
                50.0..75.0 => -speed,
                _ => 0.0,
            }
        }
    };
    // The vehicle's speed follows the demanded speed with two lags of 0.5 s each.
    let (mut first, mut second, mut x) = (0.0, 0.0, 0.0);
    let mut way_m = Vec::with_capacity(steps);
    for k in 0..steps {
        way_m.push(x);
        let share = STEP_S / 0.5;
        first += share * (wanted(k as f64 * STEP_S) - first);
        second += share * (first - second);
        x += second * STEP_S;
    }
    way_m
}

/// Returns the rotation vector of a small rotation.
fn log<To: Copy>(rotation: Rot<To, To>) -> Vec3<To> {
    let [w, x, y, z] = rotation.wxyz();
    let sign = if w < 0.0 { -2.0 } else { 2.0 };
    Vec3::new(sign * x, sign * y, sign * z)
}

pub(crate) fn at(seconds: f64) -> MonoNs {
    ORIGIN + DurNs::from_secs_f64(seconds)
}

pub(crate) fn seconds(at: MonoNs) -> f64 {
    at.since(ORIGIN).as_secs_f64()
}

pub(crate) fn sensor(source: usize) -> SensorInfo {
    let at = |x: f64, y: f64, z: f64, roll: f64, pitch: f64, yaw: f64| Mount {
        position: Vec3::new(x, y, z),
        rotation: Rot::from_roll_pitch_yaw(roll, pitch, yaw),
    };
    let quarter = math::FRAC_PI_2;
    let echosounder = SensorKind::Echosounder { min_confidence: 0.5 };
    let (mount, kind) = match source {
        IMU => (at(0.1, -0.02, 0.05, 0.0, 0.0, 0.3), SensorKind::Imu),
        TETHER => (at(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), SensorKind::Tether { zero_at_m: 0.0, scale: 1.0 }),
        DEPTH => (at(-0.2, 0.0, 0.1, 0.0, 0.0, 0.0), SensorKind::Depth),
        3 => (at(0.1, 0.2, 0.0, 0.0, 0.0, quarter), echosounder),
        4 => (at(0.1, -0.2, 0.0, 0.0, 0.0, -quarter), echosounder),
        5 => (at(0.1, 0.0, -0.1, 0.0, quarter, 0.0), echosounder),
        6 => (at(0.1, 0.0, 0.1, 0.0, -quarter, 0.0), echosounder),
        HEADS => (at(0.4, 0.0, 0.0, 0.0, 0.0, 0.0), SensorKind::Head),
        8 => (at(-0.4, 0.0, 0.0, 0.0, 0.0, math::PI), SensorKind::Head),
        VELOCITY_LOG => (at(-0.1, 0.0, -0.1, 0.0, 0.0, 0.0), SensorKind::VelocityLog),
        _ => unreachable!(),
    };
    SensorInfo { mount, kind }
}
