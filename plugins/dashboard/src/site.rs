//! Constants of a dive: tunnel, heads and sensors. The page receives them in the first message.

use headrace_coverage::{Cause, Unsure};
use headrace_geometry::math::{self, TAU};
use headrace_geometry::tunnel::Profile;
use headrace_sampling::Target;
use serde::Serialize;

/// Number of points of the tunnel's profile sent to the page, spaced equally in arc length.
const POINTS: u32 = 128;

/// Kind of source of a dive's data.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Mode {
    /// The data comes from sensors on ports.
    Live,
    /// The data comes from a simulation.
    Demo,
    /// The data comes from a log.
    Replay,
    /// A page that embeds the dive in its own file.
    File,
}

/// A profiling head, as described in the first message to the page.
#[derive(Debug, Clone, Serialize)]
pub struct HeadSite {
    /// Sensor id.
    pub id: String,
    /// Number of the head's packet source.
    pub source: u16,
    /// Sectors in which the vehicle hides the wall from the head, in the vehicle's cross-section: from and
    /// to, degrees. 0 is down, and angles grow to the left; `to` may exceed 360.
    pub hidden_deg: Vec<[f64; 2]>,
}

/// A sensor, as described in the first message to the page.
#[derive(Debug, Clone, Serialize)]
pub struct SensorSite {
    /// Sensor id.
    pub id: String,
    /// Plugin of the sensor's device.
    pub plugin: String,
    /// Kind of sensor: `head`, `echosounder`, `depth`, `imu`, `velocity_log`, `tether` or `other`.
    pub kind: &'static str,
}

/// Constants of tunnel, vehicle and dive.
#[derive(Debug, Clone)]
pub struct Site {
    /// Source of the dive's data.
    pub mode: Mode,
    /// Name of the log or scene from which the dive comes.
    pub dive: String,
    /// Name of the vehicle.
    pub vehicle: String,
    /// Coverage target, with the confidence of verdicts.
    pub target: Target,
    /// Second target, for which all sections are judged too, m; `None` without one.
    pub compared_m: Option<f64>,
    /// Length of a section, m.
    pub section_m: f64,
    /// Length of the tunnel, m.
    pub length_m: f64,
    /// Design profile of the tunnel's cross-section.
    pub profile: Profile,
    /// The heads, in the order of their source numbers.
    pub heads: Vec<HeadSite>,
    /// All sensors, in the order of their source numbers.
    pub sensors: Vec<SensorSite>,
    /// UTC at time zero of the log's clock, seconds; `None` if unknown.
    pub utc_of_zero_s: Option<f64>,
    /// First and last time of the replayed log, seconds.
    pub span_s: Option<[f64; 2]>,
    /// Whether the dive accepts operator commands.
    pub takes_commands: bool,
    /// Whether the dive can be paused and supports seeks.
    pub is_playback: bool,
    /// Path of the recording.
    pub recorded_to: Option<String>,
}

/// The first message to a viewer. Its field names are part of the feed's interface.
#[derive(Debug, Serialize)]
pub(crate) struct Hello<'a> {
    #[serde(rename = "type")]
    kind: &'static str,
    pub(crate) seq: u64,
    version: u32,
    program: &'static str,
    instance: &'a str,
    mode: Mode,
    dive: &'a str,
    vehicle: &'a str,
    target_m: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    compared_m: Option<f64>,
    section_m: f64,
    confidence_sd: f64,
    length_m: f64,
    perimeter_m: f64,
    profile: Vec<[f64; 2]>,
    clock_arc_m: Vec<f64>,
    heads: &'a [HeadSite],
    sensors: &'a [SensorSite],
    may: May,
    begun_utc_s: Option<f64>,
    causes: Vec<&'static str>,
    whys: Vec<&'static str>,
    span_s: Option<[f64; 2]>,
    tokens_needed: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    thinned: Option<usize>,
}

/// Rights of a viewer.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct May {
    /// Whether the viewer may acknowledge and silence alerts, and add notes.
    pub operate: bool,
    /// Whether the viewer may control the playback of a replay.
    pub playback: bool,
}

/// Fields of the first message that depend on the viewer and the time.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Greeting<'a> {
    pub(crate) seq: u64,
    pub(crate) instance: &'a str,
    pub(crate) may: May,
    pub(crate) begun_utc_s: Option<f64>,
    pub(crate) tokens_needed: bool,
    /// Thinning step of the samples in an exported file; `None` if the file has all samples.
    pub(crate) thinned: Option<usize>,
}

impl Site {
    pub(crate) fn hello<'a>(&'a self, to: &Greeting<'a>) -> Hello<'a> {
        let perimeter_m = self.profile.perimeter_m();
        let points = (0..POINTS).map(|k| perimeter_m * f64::from(k) / f64::from(POINTS));
        Hello {
            kind: "hello",
            seq: to.seq,
            version: 3,
            program: concat!("headrace ", env!("CARGO_PKG_VERSION")),
            instance: to.instance,
            mode: self.mode,
            dive: &self.dive,
            vehicle: &self.vehicle,
            target_m: self.target.max_hole_m,
            compared_m: self.compared_m,
            section_m: self.section_m,
            confidence_sd: self.target.confidence_sd,
            length_m: self.length_m,
            perimeter_m,
            profile: points.map(|arc_m| self.profile.point_at(arc_m).map(millimetres)).collect(),
            clock_arc_m: (0..12).map(|hour| millimetres(self.arc_at_hour_m(hour))).collect(),
            heads: &self.heads,
            sensors: &self.sensors,
            may: to.may,
            begun_utc_s: to.begun_utc_s,
            causes: Cause::ALL.iter().map(|cause| cause.as_str()).collect(),
            whys: Unsure::ALL.iter().map(|why| why.as_str()).collect(),
            span_s: self.span_s,
            tokens_needed: to.tokens_needed,
            thinned: to.thinned,
        }
    }

    /// Returns the arc length at a clock hour, looking inwards. 0 is 12 o'clock, the crown.
    fn arc_at_hour_m(&self, hour: u32) -> f64 {
        // The minus is needed because 9 o'clock is the left wall, and y grows to the left.
        let (sin, cos) = math::sin_cos(f64::from(hour) / 12.0 * TAU);
        let [y, z] = self.profile.reference();
        self.profile.arc_of([y - sin, z + cos])
    }
}

fn millimetres(value: f64) -> f64 {
    (value * 1000.0).round() / 1000.0
}
