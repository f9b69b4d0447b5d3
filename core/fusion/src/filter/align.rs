//! Alignment: computes the first estimate from about a second of readings.

use serde::{Deserialize, Serialize};

use super::context::Context;
use super::factors::Factors;
use super::measure::with_quantum;
use super::settings::Settings;
use super::state::{
    ATTITUDE, CREEP, DEPTH, ERRORS, FORCE_BIAS, HEADING, POSITION, RANGES, RATE_BIAS, SCALE, SLACK,
    SLACK_RATE, State, VELOCITY,
};
use super::updates::in_tunnel;
use crate::fix::NoFix;
use crate::section::{Echo, settle};
use headrace_geometry::frames::{Body, Point3, Rot, Tunnel, Vec3};
use headrace_geometry::math;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::device::{SensorInfo, SensorKind};
use headrace_sensor::reading::{MAX_SOURCES, Reading};

/// Duration of the filter's alignment.
pub const LISTENS: DurNs = DurNs(1_000_000_000);
/// Maximum number of echoes kept per echosounder; the median of their ranges is used.
const ECHOES: usize = 9;
/// Initial standard deviations of the estimate, in the order of this list:
///
/// - Position in the cross-section with echoes.
/// - Position in the cross-section without echoes.
/// - Chainage without a cable reading.
/// - Yaw without a compass. The vehicle is then assumed to face along the tunnel.
/// - Velocity.
/// - Tilt.
const PLACE_SD_M: f64 = 0.3;
const PLACE_UNSEEN_SD_M: f64 = 2.0;
const CHAINAGE_UNTOLD_SD_M: f64 = 10.0;
const YAW_UNTOLD_SD_RAD: f64 = 0.2;
const VELOCITY_SD_MPS: f64 = 0.5;
const TILT_SD_RAD: f64 = 0.05;
/// Initial standard deviation of the cable's local scale error, a ratio. It is practically zero.
///
/// Only a velocity log could distinguish a scale error from a speed error. With a larger value, the filter would take
/// the smallest persistent speed error for a scale error, and the chainage would become wrong by metres.
const SCALE_SD: f64 = 1e-6;

/// Readings collected during the alignment.
#[derive(Debug, Clone)]
pub struct Listening {
    since: Option<MonoNs>,
    /// Chainage of the previous estimate, which was lost, and its standard deviation, m.
    before: Option<(f64, f64)>,
    hears_wall: bool,
    attitude: Option<Rot<Tunnel, Body>>,
    force: Option<Vec3<Body>>,
    counted: Option<Counted>,
    height_m: Option<f64>,
    echoes: [Heard; MAX_SOURCES],
}

stateful!(Listening { state: since, before, hears_wall, attitude, force, counted, height_m; slots: echoes; });

/// A reading of the cable counter.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Counted {
    at: MonoNs,
    chainage_m: f64,
    /// Length of cable since the zero of the cable counter, m.
    way_m: f64,
    sd_m: f64,
}

#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Heard {
    sensor: Option<SensorInfo>,
    ranges_m: [f64; ECHOES],
    count: usize,
}

impl Default for Listening {
    fn default() -> Self {
        Self {
            since: None,
            before: None,
            hears_wall: false,
            attitude: None,
            force: None,
            counted: None,
            height_m: None,
            echoes: [Heard { sensor: None, ranges_m: [0.0; ECHOES], count: 0 }; MAX_SOURCES],
        }
    }
}

impl Listening {
    /// Adds a sensor reading to the alignment.
    pub fn hear(
        &mut self,
        context: &Context,
        source: usize,
        sensor: &SensorInfo,
        at: MonoNs,
        reading: &Reading,
    ) {
        self.since.get_or_insert(at);
        let heard_wall = self.hears_wall;
        let site = &context.site;
        match (sensor.kind, reading) {
            (SensorKind::Imu, Reading::Attitude(level)) => {
                self.attitude = Some(in_tunnel(site, *level) * sensor.mount.rotation.inverse());
            }
            (SensorKind::Imu, Reading::SpecificForce(force)) => {
                let force = sensor.mount.rotation * *force;
                self.force = Some(self.force.map_or(force, |mean| mean + (force + -mean).scaled(0.05)));
            }
            (SensorKind::Tether { zero_at_m, scale }, Reading::TetherLength(length)) => {
                let way_m = scale * length.length_m;
                let sd_m = with_quantum(context.settings.tether_sd_m, length.resolution_m * scale.abs());
                self.counted = Some(Counted { at, chainage_m: zero_at_m + way_m, way_m, sd_m });
            }
            (SensorKind::Depth, Reading::Pressure(water)) => {
                let up_m = self.attitude.map_or(0.0, |attitude| (attitude * sensor.mount.position).z());
                self.height_m = Some(site.surface_above_floor_m - site.depth_m(water.pressure_pa) - up_m);
            }
            (SensorKind::Head, Reading::Sonar(sonar)) => self.hears_wall |= sonar.range_m.is_some(),
            (SensorKind::Echosounder { min_confidence }, Reading::Echo(echo))
                if echo.confidence >= min_confidence =>
            {
                self.hears_wall |= echo.range_m.is_some();
                if let (Some(range_m), Some(heard)) = (echo.range_m, self.echoes.get_mut(source)) {
                    heard.hear(sensor, site.rescaled_range_m(range_m, echo.sound_speed_mps));
                }
            }
            _ => {}
        }
        if self.before.is_some() && self.hears_wall && !heard_wall {
            // All sensors were silent, so the earlier estimate was lost. Other sensors may begin to send again only at
            // this echo, so the alignment restarts here.
            self.since = Some(at);
        }
    }

    /// Creates an alignment after an estimate was lost. `before` is that estimate's chainage and its standard
    /// deviation, m.
    pub fn after(before: Option<(f64, f64)>) -> Self {
        Self { before, ..Self::default() }
    }

    /// Returns the chainage of the previous estimate, which was lost, and its standard deviation, m.
    pub fn before(&self) -> Option<(f64, f64)> {
        self.before
    }

    /// Returns the part of a fix that is still missing.
    pub fn missing_part(&self) -> NoFix {
        if self.attitude.is_none() && self.force.is_none() {
            NoFix::Heading
        } else if self.counted.is_none() {
            NoFix::Chainage
        } else {
            NoFix::Section
        }
    }

    /// Returns the start time of the alignment, as a time of validity.
    pub fn since(&self) -> Option<MonoNs> {
        self.since
    }

    /// Returns the first estimate, valid at `at`; `None` until the alignment has lasted long enough.
    pub fn settle(&self, at: MonoNs, context: &Context) -> Option<(State, Factors<ERRORS>)> {
        // After the loss of an estimate, the alignment waits for an echo of the wall. Without an echo, the new
        // estimate would be no better than the lost one.
        if at.since(self.since?).0 < LISTENS.0 || (self.before.is_some() && !self.hears_wall) {
            return None;
        }
        let attitude = self.attitude.or_else(|| self.force.map(level))?;
        let [reference_y, reference_z] = context.profile.reference();
        let start = [reference_y, reference_z];
        let echoes = self.echoes.iter().filter_map(Heard::middle);
        let has_echoes = echoes.clone().count() > 0;
        let weak = [PLACE_UNSEEN_SD_M; 2];
        let echo_sd_m = context.settings.echo_sd_m;
        let place = settle(&context.profile, attitude, start, (start, weak), echo_sd_m, &echoes);
        let before_m = self.before.map_or(0.0, |(chainage_m, _)| chainage_m);
        let chainage_m = self.counted.map_or(before_m, |counted| counted.chainage_m);
        let body = Point3::new(chainage_m, place.at_m[0], place.at_m[1]);
        let mut state = State::at_rest(body + attitude * context.unit_at, attitude);
        if let (true, Some(height_m)) = (place.is_height_seen, self.height_m) {
            state.depth_offset_m = height_m - place.at_m[1];
        }
        let sd_m = |is_seen: bool| if is_seen { PLACE_SD_M } else { PLACE_UNSEEN_SD_M };
        let place_sd_m = [sd_m(has_echoes), sd_m(place.is_height_seen)];
        Some((state, self.factors(at, &context.settings, place_sd_m)))
    }

    /// Builds the initial covariance.
    ///
    /// The chainage error is correlated with the cable's errors, and the yaw error with the compass's. So repeated
    /// readings of cable and compass do not reduce the uncertainty of chainage and yaw below these errors. The slack
    /// error is correlated with the error of the slack rate.
    fn factors(&self, at: MonoNs, settings: &Settings, [y_sd_m, z_sd_m]: [f64; 2]) -> Factors<ERRORS> {
        let mut sds = [0.0; ERRORS];
        let uncounted_sd_m = self.before.map_or(0.0, |(_, sd_m)| sd_m).max(CHAINAGE_UNTOLD_SD_M);
        let chainage_sd_m = self.counted.map_or(uncounted_sd_m, |counted| {
            math::hypot(counted.sd_m, VELOCITY_SD_MPS * at.since(counted.at).as_secs_f64())
        });
        let yaw_sd = self.attitude.map_or(YAW_UNTOLD_SD_RAD, |_| settings.heading_sd_rad);
        let threes = [
            (POSITION, [chainage_sd_m, y_sd_m, z_sd_m]),
            (VELOCITY, [VELOCITY_SD_MPS; 3]),
            (ATTITUDE, [TILT_SD_RAD, TILT_SD_RAD, yaw_sd]),
            (FORCE_BIAS, [settings.force_bias.reach; 3]),
            (RATE_BIAS, [settings.rate_bias.reach; 3]),
        ];
        for (from, three) in threes {
            for (slot, sd) in sds.iter_mut().skip(from).zip(three) {
                *slot = sd;
            }
        }
        let ones = [
            // Standard deviation of the part of the slack that is not correlated with the slack rate.
            (SLACK, settings.slack.reach / core::f64::consts::SQRT_2),
            (SLACK_RATE, settings.slack.drive()),
            // Standard deviation of the chainage error that the cable's scale has caused between the counter's zero and
            // the present position. Later scale errors add to it.
            (CREEP, settings.scale_sd * self.counted.map_or(0.0, |counted| counted.way_m.abs())),
            (SCALE, SCALE_SD),
            (DEPTH, settings.depth_offset_sd_m),
            (HEADING, settings.heading.reach),
            (RANGES, settings.range_scale_sd),
        ];
        for (i, sd) in ones {
            if let Some(slot) = sds.get_mut(i) {
                *slot = sd;
            }
        }
        let mut factors = Factors::independent(sds.map(|sd| sd * sd));
        factors.shear(|e, _| {
            let [slack, rate, creep, heading] =
                [SLACK, SLACK_RATE, CREEP, HEADING].map(|i| e.get(i).copied().unwrap_or(0.0));
            let slack = slack + rate * settings.slack.time_s / 2.0;
            let shown = self.counted.map_or(0.0, |_| slack + creep);
            let deviates = if self.attitude.is_some() { heading } else { 0.0 };
            for (i, change) in [(POSITION, -shown), (ATTITUDE + 2, -deviates)] {
                if let Some(slot) = e.get_mut(i) {
                    *slot += change;
                }
            }
            if let Some(slot) = e.get_mut(SLACK) {
                *slot = slack;
            }
        });
        factors
    }
}

impl Heard {
    fn hear(&mut self, sensor: &SensorInfo, range_m: f64) {
        self.sensor = Some(*sensor);
        if let Some(slot) = self.ranges_m.get_mut(self.count % ECHOES) {
            *slot = range_m;
            self.count += 1;
        }
    }

    fn middle(&self) -> Option<Echo> {
        let mut ranges_m = self.ranges_m;
        let heard = ranges_m.get_mut(..self.count.min(ECHOES))?;
        heard.sort_unstable_by(f64::total_cmp);
        let range_m = heard.get(heard.len() / 2).copied()?;
        Some(Echo { mount: self.sensor?.mount, range_m })
    }
}

/// Computes the attitude of a body at rest that faces along the tunnel, from the direction of gravity.
fn level(force: Vec3<Body>) -> Rot<Tunnel, Body> {
    let roll = math::atan2(force.y(), force.z());
    let pitch = math::atan2(-force.x(), math::hypot(force.y(), force.z()));
    Rot::from_roll_pitch_yaw(roll, pitch, 0.0)
}

#[cfg(test)]
mod tests {
    use super::super::measure;
    use super::*;
    use headrace_geometry::frames::{Mount, Sensor};
    use headrace_geometry::site::Site;
    use headrace_geometry::tunnel::shapes;
    use headrace_sensor::reading::{Level, TetherLength};

    /// The errors of cable and compass are the same in every reading, so repeated readings do not make the estimate
    /// more certain.
    ///
    /// Slack and scale errors limit the certainty of the chainage. The compass deviation limits that of the yaw.
    #[test]
    fn repeated_readings_do_not_reduce_systematic_errors_of_cable_and_compass() {
        let context = Context {
            profile: shapes::ceran().unwrap(),
            site: Site::default(),
            settings: Settings::default(),
            unit_at: Vec3::zero(),
        };
        let mount = Mount { position: Vec3::zero(), rotation: Rot::<Body, Sensor>::identity() };
        let tether = SensorInfo { mount, kind: SensorKind::Tether { zero_at_m: 20.0, scale: 1.0 } };
        let imu = SensorInfo { mount, kind: SensorKind::Imu };
        let mut listening = Listening::default();
        let at = MonoNs(1_000_000_000);
        let level = Reading::Attitude(Rot::<Level, Sensor>::identity());
        let length =
            Reading::TetherLength(TetherLength { length_m: 100.0, resolution_m: 0.001, restart: None });
        listening.hear(&context, 0, &imu, MonoNs(0), &level);
        listening.hear(&context, 1, &tether, at, &length);
        let (state, mut factors) = listening.settle(at, &context).unwrap();
        assert!((state.position.x() - 120.0).abs() < 1e-12);
        let Settings { slack, scale_sd, heading, tether_sd_m, .. } = context.settings;
        let chainage = slack.reach * slack.reach + 1e4 * scale_sd * scale_sd;
        let yaw = heading.reach * heading.reach;
        let both = factors.covariance(SLACK, SLACK_RATE);
        assert!((factors.variance(SLACK) / (slack.reach * slack.reach) - 1.0).abs() < 1e-12);
        assert!((both * slack.time_s / (slack.reach * slack.reach) - 1.0).abs() < 1e-12);
        for _ in 0..50 {
            let row = measure::chainage(&state, Vec3::zero(), 120.0, tether_sd_m);
            factors.measure(&row.h, row.noise);
            for row in measure::attitude(&state, state.attitude, 0.03, 0.01) {
                factors.measure(&row.h, row.noise);
            }
            for (is, least) in [(POSITION, chainage), (ATTITUDE + 2, yaw)] {
                let is = factors.variance(is);
                assert!(is >= 0.999 * least && is < 1.1 * least, "{is}, not {least}");
            }
        }
    }
}
