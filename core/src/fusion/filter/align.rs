//! The first estimate: what the sensors say within the first second, taken together.

use super::factors::Factors;
use super::running::{Context, in_tunnel};
use super::settings::Settings;
use super::state::{
    ATTITUDE, DEPTH, ERRORS, FORCE_BIAS, HEADING, POSITION, RATE_BIAS, SCALE, SLACK, SLACK_RATE, State,
    VELOCITY,
};
use crate::app::MAX_SOURCES;
use crate::app::reading::Reading;
use crate::frames::{Body, Point3, Rot, Tunnel, Vec3};
use crate::fusion::section::{Echo, settle};
use crate::fusion::{NoFix, SensorInfo, SensorKind};
use crate::math;
use crate::time::{DurNs, MonoNs};

/// How long sensors are listened to.
const LISTENS: DurNs = DurNs(1_000_000_000);
/// Echoes of one sounder of which the middle one is taken.
const ECHOES: usize = 9;
/// Standard deviations at the start: of the place in the section by echoes, and without them; of a chainage that nobody
/// has told; of the yaw of a vehicle that has no compass and is set to look along the tunnel; of velocity; of tilt.
const PLACE_SD_M: f64 = 0.3;
const PLACE_UNSEEN_SD_M: f64 = 2.0;
const CHAINAGE_UNTOLD_SD_M: f64 = 10.0;
const YAW_UNTOLD_SD_RAD: f64 = 0.2;
const VELOCITY_SD_MPS: f64 = 0.5;
const TILT_SD_RAD: f64 = 0.05;

/// What has been heard so far.
#[derive(Debug, Clone)]
pub struct Listening {
    since: Option<MonoNs>,
    attitude: Option<Rot<Tunnel, Body>>,
    force: Option<Vec3<Body>>,
    chainage_m: Option<f64>,
    height_m: Option<f64>,
    echoes: [Heard; MAX_SOURCES],
}

#[derive(Debug, Clone, Copy)]
struct Heard {
    sensor: Option<SensorInfo>,
    ranges_m: [f64; ECHOES],
    count: usize,
}

impl Default for Listening {
    fn default() -> Self {
        Self {
            since: None,
            attitude: None,
            force: None,
            chainage_m: None,
            height_m: None,
            echoes: [Heard { sensor: None, ranges_m: [0.0; ECHOES], count: 0 }; MAX_SOURCES],
        }
    }
}

impl Listening {
    /// Takes a reading.
    pub fn hear(
        &mut self,
        context: &Context,
        source: usize,
        sensor: &SensorInfo,
        at: MonoNs,
        reading: &Reading,
    ) {
        self.since.get_or_insert(at);
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
                self.chainage_m = Some(zero_at_m + scale * length.length_m);
            }
            (SensorKind::Depth, Reading::Pressure(water)) => {
                let up_m = self.attitude.map_or(0.0, |attitude| (attitude * sensor.mount.position).z());
                self.height_m = Some(site.surface_above_floor_m - site.depth_m(water.pressure_pa) - up_m);
            }
            (SensorKind::Echosounder { .. }, Reading::Echo(echo)) => {
                if let (Some(range_m), Some(heard)) = (echo.range_m, self.echoes.get_mut(source)) {
                    heard.hear(sensor, site.rescaled_range_m(range_m, echo.sound_speed_mps));
                }
            }
            _ => {}
        }
    }

    /// What is missing yet.
    pub fn lacks(&self) -> NoFix {
        if self.attitude.is_none() && self.force.is_none() {
            NoFix::Heading
        } else if self.chainage_m.is_none() {
            NoFix::Chainage
        } else {
            NoFix::Section
        }
    }

    /// When the first reading was valid.
    pub fn since(&self) -> Option<MonoNs> {
        self.since
    }

    /// The first estimate as of `at`, once sensors have been listened to for long enough.
    pub fn settle(&self, at: MonoNs, context: &Context) -> Option<(State, Factors<ERRORS>)> {
        if at.since(self.since?).0 < LISTENS.0 {
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
        let body = Point3::new(self.chainage_m.unwrap_or(0.0), place.at_m[0], place.at_m[1]);
        let mut state = State::at_rest(body + attitude * context.unit_at, attitude);
        if let (true, Some(height_m)) = (has_echoes, self.height_m) {
            state.depth_offset_m = height_m - place.at_m[1];
        }
        let place_sd_m = if has_echoes { PLACE_SD_M } else { PLACE_UNSEEN_SD_M };
        Some((state, self.factors(&context.settings, place_sd_m)))
    }

    fn factors(&self, settings: &Settings, place_sd_m: f64) -> Factors<ERRORS> {
        let mut sds = [0.0; ERRORS];
        let chainage_sd_m =
            if self.chainage_m.is_some() { settings.slack.reach } else { CHAINAGE_UNTOLD_SD_M };
        let yaw_sd = match self.attitude {
            Some(_) => math::hypot(settings.heading.reach, settings.heading_sd_rad),
            None => YAW_UNTOLD_SD_RAD,
        };
        let threes = [
            (POSITION, [chainage_sd_m, place_sd_m, place_sd_m]),
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
            (SLACK, settings.slack.reach),
            (SLACK_RATE, settings.slack.drive()),
            (SCALE, settings.scale_sd),
            (DEPTH, settings.depth_offset_sd_m),
            (HEADING, settings.heading.reach),
        ];
        for (i, sd) in ones {
            if let Some(slot) = sds.get_mut(i) {
                *slot = sd;
            }
        }
        Factors::independent(sds.map(|sd| sd * sd))
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

/// The attitude of a body at rest that looks along the tunnel, by which way is up.
fn level(force: Vec3<Body>) -> Rot<Tunnel, Body> {
    let roll = math::atan2(force.y(), force.z());
    let pitch = math::atan2(-force.x(), math::hypot(force.y(), force.z()));
    Rot::from_roll_pitch_yaw(roll, pitch, 0.0)
}
