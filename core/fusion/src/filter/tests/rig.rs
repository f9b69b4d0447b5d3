//! A vehicle on a known trajectory with the readings of its sensors, for tests that feed readings to the filter.

use super::super::FilterNavigation;
use super::super::settings::{GaussMarkov, Settings};
use super::super::state::{ATTITUDE, ERRORS, POSITION, VELOCITY, rotation, rotation_vector};
use crate::{Fix, Navigation as _, NoFix, Times};
use headrace_geometry::frames::{Body, Mount, Point3, Pose, Rot, Sensor, Tunnel, Vec3, head_direction};
use headrace_geometry::math;
use headrace_geometry::site::Site;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_geometry::tunnel::{Profile, shapes};
use headrace_sensor::device::{SensorInfo, SensorKind};
use headrace_sensor::reading::{EchoRange, Level, Reading, SonarReturn, TetherLength, WaterPressure};

pub(super) const IMU: usize = 0;
pub(super) const TETHER: usize = 1;
pub(super) const DEPTH: usize = 2;
/// Source number of the first of four echosounders: left, right, down, up.
pub(super) const ECHOES: usize = 3;
/// Source number of the first of two heads. The first head faces ahead, and the second head astern.
pub(super) const HEADS: usize = 7;
pub(super) const VELOCITY_LOG: usize = 9;
/// Source number of a sensor that navigation does not use.
pub(super) const OTHER: usize = 10;

/// Timestamp at time 0 s of the simulated vehicle.
const ORIGIN: MonoNs = MonoNs(5_000_000_000_000);
const DEVICE_MPS: f64 = 1500.0;
/// Maximum allowed error of the filter's estimate, in standard deviations.
const MOST_SDS: f64 = 4.0;

/// A sensor reading with its time of arrival and its time of validity.
#[derive(Debug, Clone, Copy)]
pub(super) struct Event {
    pub(super) received: MonoNs,
    pub(super) valid: MonoNs,
    pub(super) source: usize,
    pub(super) reading: Reading,
}

/// Trajectory: pose of the vehicle at a time, s.
pub(super) type Way = fn(f64) -> Pose;

/// A simulated vehicle with its sensors.
pub(super) struct Rig {
    pub(super) profile: Profile,
    pub(super) site: Site,
    pub(super) settings: Settings,
    pub(super) way: Way,
    /// Noise of the simulated sensors as a multiple of the noise in the settings.
    pub(super) noise: f64,
    /// Time between samples of the inertial unit, s.
    pub(super) imu_s: f64,
    pub(super) seed: u64,
    /// True yaw of the first head on its mount, radians. The filter does not know it.
    pub(super) head_yaw_rad: f64,
}

pub(super) fn at(seconds: f64) -> MonoNs {
    ORIGIN + DurNs::from_secs_f64(seconds)
}

pub(super) fn seconds(at: MonoNs) -> f64 {
    at.since(ORIGIN).as_secs_f64()
}

/// Pose of a vehicle that moves ahead at 0.2 m/s with a little sway and yaw.
pub(super) fn cruise(t: f64) -> Pose {
    Pose {
        position: Point3::new(3.0 + 0.2 * t, 0.4 * math::sin(t / 7.0), 4.0 + 0.3 * math::sin(t / 11.0)),
        attitude: Rot::from_roll_pitch_yaw(
            0.05 * math::sin(t / 3.0),
            0.06 * math::sin(t / 5.0),
            0.2 * math::sin(t / 9.0),
        ),
    }
}

/// Pose of a vehicle that swings 5 degrees left and right while it drives slowly.
pub(super) fn swing(t: f64) -> Pose {
    let yaw_rad = 0.087 * math::sin(math::TAU * t / 20.0);
    let position = Point3::new(3.0 + 0.05 * t, 0.4, 4.0);
    Pose { position, attitude: Rot::from_roll_pitch_yaw(0.0, 0.0, yaw_rad) }
}

/// Pose of a vehicle that swings in place.
pub(super) fn swing_in_place(t: f64) -> Pose {
    Pose { position: rest(t).position, ..swing(t) }
}

/// Pose of a vehicle at rest that is level and faces along the tunnel.
pub(super) fn rest(_: f64) -> Pose {
    Pose { position: Point3::new(3.0, 0.4, 4.0), attitude: Rot::identity() }
}

impl Rig {
    pub(super) fn new(way: Way, seed: u64) -> Self {
        // With these settings, beams are so narrow that they equal rays, and the cable's slack changes slowly.
        let slack = GaussMarkov { reach: 0.06, time_s: 10.0 };
        let settings = Settings { slack, return_beam_rad: 1e-6, echo_beam_rad: 1e-6, ..Settings::default() };
        let site = Site { axis_yaw_rad: 0.7, ..Site::default() };
        Self {
            profile: shapes::ceran().unwrap(),
            site,
            settings,
            way,
            noise: 1.0,
            imu_s: 0.02,
            seed,
            head_yaw_rad: 0.0,
        }
    }

    pub(super) fn navigation(&self) -> FilterNavigation {
        FilterNavigation::new(self.profile.clone(), self.site, self.settings)
    }

    pub(super) fn sensor(source: usize) -> SensorInfo {
        let at = |x: f64, y: f64, z: f64, roll: f64, pitch: f64, yaw: f64| Mount {
            position: Vec3::new(x, y, z),
            rotation: Rot::from_roll_pitch_yaw(roll, pitch, yaw),
        };
        let quarter = math::FRAC_PI_2;
        let echosounder = SensorKind::Echosounder { min_confidence: 0.5 };
        let (mount, kind) = match source {
            IMU => (at(0.1, -0.02, 0.05, 0.0, 0.0, 0.3), SensorKind::Imu),
            TETHER => (at(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), SensorKind::Tether { zero_at_m: 2.0, scale: 1.0 }),
            DEPTH => (at(-0.2, 0.0, 0.1, 0.0, 0.0, 0.0), SensorKind::Depth),
            3 => (at(0.1, 0.2, 0.0, 0.0, 0.0, quarter), echosounder),
            4 => (at(0.1, -0.2, 0.0, 0.0, 0.0, -quarter), echosounder),
            5 => (at(0.1, 0.0, -0.1, 0.0, quarter, 0.0), echosounder),
            6 => (at(0.1, 0.0, 0.1, 0.0, -quarter, 0.0), echosounder),
            HEADS => (at(0.4, 0.0, 0.0, 0.0, 0.0, 0.0), SensorKind::Head),
            8 => (at(-0.4, 0.0, 0.0, 0.0, 0.0, math::PI), SensorKind::Head),
            VELOCITY_LOG => (at(-0.1, 0.0, -0.1, 0.0, 0.0, 0.0), SensorKind::VelocityLog),
            _ => (at(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), SensorKind::Other),
        };
        SensorInfo { mount, kind }
    }

    /// Returns the readings of all sensors except the velocity log in a time span, in order of validity.
    pub(super) fn events(&self, from_s: f64, to_s: f64) -> Vec<Event> {
        let mut events = Vec::new();
        let mut every = |period_s: f64, phase_s: f64, source: usize, what: &dyn Fn(f64) -> Reading| {
            let first = math::floor_to_i64((from_s - phase_s) / period_s) + 1;
            let last = math::floor_to_i64((to_s - phase_s) / period_s);
            for k in first..=last {
                let t = k as f64 * period_s + phase_s;
                events.push(Event { received: at(t), valid: at(t), source, reading: what(t) });
            }
        };
        every(self.imu_s, 0.0, IMU, &|t| self.rate(t));
        every(self.imu_s, 0.0, IMU, &|t| self.force(t));
        every(0.1, 0.003, IMU, &|t| self.attitude(t));
        every(0.1, 0.017, TETHER, &|t| self.tether(t));
        every(0.25, 0.029, DEPTH, &|t| self.pressure(t));
        for k in 0..4 {
            every(0.1, 0.031 + 0.007 * k as f64, ECHOES + k, &|t| self.echo(ECHOES + k, t));
        }
        for k in 0..2 {
            every(0.05, 0.011 + 0.005 * k as f64, HEADS + k, &|t| self.sonar(HEADS + k, t));
        }
        events.sort_by_key(|event| event.valid);
        events
    }

    pub(super) fn hear(nav: &mut FilterNavigation, event: &Event) {
        let times = Times { received: event.received, valid: event.valid };
        nav.update(event.source, &Self::sensor(event.source), times, &event.reading);
    }

    /// Feeds all readings to the filter, and checks the filter after each reading.
    pub(super) fn run(&self, nav: &mut FilterNavigation, events: &[Event]) -> Tally {
        let mut tally = Tally::default();
        for event in events {
            Self::hear(nav, event);
            self.check(nav, event.received, &mut tally);
        }
        tally
    }

    /// Checks that all numbers are finite and no variance is negative. If there is a fix, its errors must be within
    /// `MOST_SDS`.
    ///
    /// The checks run once per epoch, because the estimate does not change in between.
    pub(super) fn check(&self, nav: &FilterNavigation, now: MonoNs, tally: &mut Tally) {
        let Some(running) = nav.running() else {
            assert!(nav.fix(now).is_err());
            return;
        };
        if tally.checked == Some(running.at) {
            return;
        }
        tally.checked = Some(running.at);
        assert!(running.is_sound(), "{running:?}");
        for i in 0..ERRORS {
            let variance = running.factors.variance(i);
            assert!(variance.is_finite() && variance >= 0.0, "variance {i} is {variance}");
            for j in 0..i {
                let (there, back) = (running.factors.covariance(i, j), running.factors.covariance(j, i));
                let limit = variance * running.factors.variance(j);
                assert!((there - back).abs() <= 1e-14 * math::sqrt(limit), "{i} and {j}: {there}, {back}");
                assert!(there * there <= limit * (1.0 + 1e-9) + 1e-300, "{i} and {j}: {there}");
            }
        }
        let length: f64 = running.state.attitude.wxyz().iter().map(|c| c * c).sum();
        assert!((length - 1.0).abs() < 1e-9, "attitude of length {length}");
        match nav.fix(now) {
            Ok(fix) => {
                tally.fixes += 1;
                self.check_fix(nav, now, &fix, tally);
            }
            Err(no_fix) => {
                tally.without_fix += 1;
                tally.no_fix = Some(no_fix);
            }
        }
    }

    fn check_fix(&self, nav: &FilterNavigation, now: MonoNs, fix: &Fix, tally: &mut Tally) {
        let running = nav.running().unwrap();
        let truth = (self.way)(seconds(now));
        let since_s = now.since(running.at).as_secs_f64();
        let arm = fix.pose.attitude * -Self::sensor(IMU).mount.position;
        let turned = rotation_vector(truth.attitude * fix.pose.attitude.inverse());
        let moved = truth.position - fix.pose.position;
        let axes = [Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.0, 0.0, 1.0)];
        for (k, axis) in axes.iter().enumerate() {
            let mut h = [0.0; ERRORS];
            (h[POSITION + k], h[VELOCITY + k]) = (1.0, since_s);
            // A small rotation about an axis moves the body's origin. The displacement is the cross product of axis and
            // lever arm.
            for (j, other) in axes.iter().enumerate() {
                h[ATTITUDE + j] = other.cross(&arm).dot(axis);
            }
            let place = (moved.dot(axis), math::sqrt(running.factors.variance_along(&h)));
            let turn = (turned.dot(axis), math::sqrt(running.factors.variance(ATTITUDE + k)));
            for (what, (off, sigma)) in [("place", place), ("turn", turn)] {
                let share = off.abs() / sigma;
                tally.sd = tally.sd.max(share);
                assert!(share <= MOST_SDS, "{what} {k} at {} s is off by {off}, sigma {sigma}", seconds(now));
            }
        }
        assert!(fix.speed_mps.is_finite() && fix.relative.sd_m(Vec3::new(0.0, 3.0, 3.0)).is_finite());
    }

    pub(super) fn noisy(&self, t: f64, salt: u64, sd: f64) -> f64 {
        // The noise is a sum of twelve uniform random numbers from a hashed counter (splitmix64).
        let mut state = self.seed ^ at(t).0.wrapping_mul(31) ^ (salt << 50);
        let sum: f64 = (0..12)
            .map(|_| {
                state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
                let mut z = state;
                z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
                z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
                ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
            })
            .sum();
        self.noise * sd * (sum - 6.0)
    }

    pub(super) fn noisy_vector<F>(&self, t: f64, salt: u64, sd: f64) -> Vec3<F> {
        Vec3::new(self.noisy(t, salt, sd), self.noisy(t, salt + 1, sd), self.noisy(t, salt + 2, sd))
    }

    /// True position of the inertial unit.
    pub(super) fn unit(&self, t: f64) -> Point3<Tunnel> {
        (self.way)(t).place(Self::sensor(IMU).mount.position)
    }

    fn velocity_at(&self, t: f64) -> Vec3<Tunnel> {
        const H_S: f64 = 1e-4;
        (self.unit(t + H_S) - self.unit(t - H_S)).scaled(0.5 / H_S)
    }

    /// Mean turn rate over the inertial unit's preceding sample period.
    pub(super) fn rate(&self, t: f64) -> Reading {
        let (then, now) = ((self.way)(t - self.imu_s).attitude, (self.way)(t).attitude);
        let turn: Vec3<Body> = rotation_vector(then.inverse() * now).scaled(1.0 / self.imu_s);
        let noise = self.noisy_vector(t, 10, self.settings.rate_noise / math::sqrt(self.imu_s));
        Reading::AngularRate(Self::sensor(IMU).mount.rotation.inverse() * turn + noise)
    }

    /// Mean specific force over the inertial unit's preceding sample period.
    pub(super) fn force(&self, t: f64) -> Reading {
        let then = t - self.imu_s;
        let gain = (self.velocity_at(t) + -self.velocity_at(then)).scaled(1.0 / self.imu_s);
        let force = gain + Vec3::new(0.0, 0.0, self.site.gravity_mps2);
        let (first, last) = ((self.way)(then).attitude, (self.way)(t).attitude);
        let half: Rot<Body, Body> = rotation(rotation_vector(first.inverse() * last).scaled(0.5));
        let noise = self.noisy_vector(t, 20, self.settings.force_noise / math::sqrt(self.imu_s));
        let in_body = (first * half).inverse() * force;
        Reading::SpecificForce(Self::sensor(IMU).mount.rotation.inverse() * in_body + noise)
    }

    /// Attitude that the inertial unit computes, with noise and without a compass deviation.
    pub(super) fn attitude(&self, t: f64) -> Reading {
        Reading::Attitude(self.level(t, 0.0))
    }

    /// Attitude that the inertial unit computes with a compass deviation.
    pub(super) fn level(&self, t: f64, off_rad: f64) -> Rot<Level, Sensor> {
        let noise = Vec3::new(
            self.noisy(t, 30, self.settings.tilt_sd_rad / 2.0),
            self.noisy(t, 31, self.settings.tilt_sd_rad / 2.0),
            self.noisy(t, 32, self.settings.heading_sd_rad),
        );
        let axis = Rot::<Level, Tunnel>::from_roll_pitch_yaw(0.0, 0.0, self.site.axis_yaw_rad + off_rad);
        axis * (rotation(noise) * (self.way)(t).attitude) * Self::sensor(IMU).mount.rotation
    }

    pub(super) fn tether(&self, t: f64) -> Reading {
        let length_m = (self.way)(t).position.x() - 2.0 + self.noisy(t, 40, self.settings.tether_sd_m);
        Reading::TetherLength(TetherLength { length_m, resolution_m: 0.001, restart: None })
    }

    pub(super) fn pressure(&self, t: f64) -> Reading {
        let height_m = (self.way)(t).place(Self::sensor(DEPTH).mount.position).z();
        let height_m = height_m + self.noisy(t, 50, self.settings.depth_sd_m);
        Reading::Pressure(WaterPressure {
            pressure_pa: self.site.pressure_pa(self.site.surface_above_floor_m - height_m),
            resolution_pa: 20.0,
            temperature_degc: 10.0,
        })
    }

    fn range_m(&self, source: usize, t: f64, along: Vec3<Sensor>) -> f64 {
        let (pose, mount) = ((self.way)(t), Self::sensor(source).mount);
        let (from, beam) = (pose.place(mount.position), pose.attitude * (mount.rotation * along));
        let hit = self.profile.cast([from.y(), from.z()], [beam.y(), beam.z()]).unwrap();
        let noise_m = self.noisy(t, 60 + source as u64, self.settings.echo_sd_m);
        (hit.range_m + noise_m) * DEVICE_MPS / self.site.sound_speed_mps
    }

    pub(super) fn echo(&self, source: usize, t: f64) -> Reading {
        let range_m = Some(self.range_m(source, t, Vec3::new(1.0, 0.0, 0.0)));
        Reading::Echo(EchoRange { range_m, confidence: 1.0, sound_speed_mps: DEVICE_MPS })
    }

    pub(super) fn sonar(&self, source: usize, t: f64) -> Reading {
        let angle_rad = math::wrap(t * 1.7, math::TAU);
        let yaw_rad = if source == HEADS { self.head_yaw_rad } else { 0.0 };
        let along = Rot::<Sensor, Sensor>::from_roll_pitch_yaw(0.0, 0.0, yaw_rad) * head_direction(angle_rad);
        Reading::Sonar(SonarReturn {
            angle_rad,
            range_m: Some(self.range_m(source, t, along)),
            resolution_m: 0.01,
            max_range_m: 20.0,
            sound_speed_mps: DEVICE_MPS,
        })
    }

    pub(super) fn velocity(&self, t: f64) -> Reading {
        let (mount, h_s) = (Self::sensor(VELOCITY_LOG).mount, 1e-4);
        let place = |t: f64| (self.way)(t).place(mount.position);
        let moved = (place(t + h_s) - place(t - h_s)).scaled(0.5 / h_s);
        let in_sensor = mount.rotation.inverse() * ((self.way)(t).attitude.inverse() * moved);
        Reading::VelocityOverGround(in_sensor + self.noisy_vector(t, 80, self.settings.velocity_sd_mps))
    }
}

/// Results of the checks of the filter against the known trajectory.
#[derive(Debug, Default, Clone, Copy)]
pub(super) struct Tally {
    checked: Option<MonoNs>,
    /// Number of epochs with a fix (`fixes`), and number of epochs without a fix.
    pub(super) fixes: u32,
    pub(super) without_fix: u32,
    /// Part of the fix that was missing in the last epoch without a fix.
    pub(super) no_fix: Option<NoFix>,
    /// Largest error of the estimate so far, in standard deviations.
    pub(super) sd: f64,
}
