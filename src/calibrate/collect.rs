//! Collects the readings of a part of a log, as the loop decodes them. They are the input of the calibration.

use headrace_fusion::filter::settings::Settings;
use headrace_geometry::site::Site;
use headrace_geometry::time::{DiveClock, DurNs, MonoNs};
use headrace_geometry::tunnel::Profile;
use headrace_monitor::messages::Event;
use headrace_monitor::ring::{Port, RingError};
use headrace_monitor::run::Loop;
use headrace_replay::drive::{Coming, DriveError, Pace, PacketSource, drive};
use headrace_replay::log::LogError;
use headrace_sensor::device::SensorInfo;

/// Maximum length of the processed part of a log, s. It is limited because the readings are held in memory.
const MOST_S: f64 = 1200.0;

/// Time window of the readings, in seconds from the log's first message.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Window {
    /// Start of the window.
    pub(crate) from_s: f64,
    /// End of the window; `None` for the longest window whose readings fit into memory.
    pub(crate) to_s: Option<f64>,
    /// Beginning and end of the time that the vehicle spent at the water's surface.
    pub(crate) at_surface_s: Option<[f64; 2]>,
    /// Clock of the dive.
    pub(crate) clock: DiveClock,
}

/// Reason why readings can't be collected.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub(crate) enum CollectError {
    /// The end of the window is before its beginning.
    #[error("calibrating: --to {to_s} must be after --from {from_s}")]
    Backwards {
        /// Beginning of the window, s.
        from_s: f64,
        /// End of the window, s.
        to_s: f64,
    },
    /// The window is too long for its readings to be held in memory.
    #[error("calibrating from {from_s} to {to_s} s: at most {MOST_S} s are allowed; give a shorter window")]
    TooLong {
        /// Beginning of the window, s.
        from_s: f64,
        /// End of the window, s.
        to_s: f64,
    },
    /// The log can't be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// The replay loop that decodes the log can't be run.
    #[error(transparent)]
    Drive(#[from] DriveError),
}

/// Readings of a part of a log.
#[derive(Debug)]
pub(crate) struct Collected {
    /// Clock of the dive.
    pub(crate) clock: DiveClock,
    /// Start of the requested part.
    pub(crate) from: MonoNs,
    /// End of the requested part.
    pub(crate) to: MonoNs,
    /// Beginning and end of the time that the vehicle spent at the water's surface.
    pub(crate) at_surface: Option<[MonoNs; 2]>,
    /// Sensors of the vehicle file. The index is the number of the packet source.
    pub(crate) sensors: Vec<SensorInfo>,
    /// Readings of the requested part and of the time at the surface, in order.
    pub(crate) events: Vec<Event>,
}

impl Collected {
    /// Readings of the requested part.
    pub(crate) fn within(&self) -> impl Iterator<Item = &Event> {
        self.events.iter().filter(|event| event.received >= self.from && event.received < self.to)
    }

    /// Dive time of a timestamp, seconds.
    pub(crate) fn seconds(&self, at: MonoNs) -> f64 {
        self.clock.seconds(at)
    }
}

/// A packet source that ends at the time `end`, even if the inner source has more packets.
struct Until<'a> {
    feed: &'a mut dyn PacketSource,
    end: MonoNs,
}

impl PacketSource for Until<'_> {
    fn coming(&mut self) -> Result<Option<Coming>, LogError> {
        Ok(self.feed.coming()?.filter(|coming| coming.at < self.end))
    }

    fn send(&mut self, port: &mut Port) -> Result<(), RingError> {
        self.feed.send(port)
    }
}

/// Runs a log through the loop up to the end of the window, and keeps the readings in the window.
///
/// `progress` receives the number of readings kept so far. The part before the window runs as well, because
/// the decoders' state depends on it.
///
/// Errors: see [`CollectError`].
pub(crate) fn collect(
    mut dive: Loop,
    feed: &mut dyn PacketSource,
    window: &Window,
    progress: &mut dyn FnMut(usize),
) -> Result<Collected, CollectError> {
    let clock = window.clock;
    let after = |seconds: f64| clock.timestamp(DurNs::from_secs_f64(seconds));
    let from_s = window.from_s;
    let to_s = window.to_s.unwrap_or(from_s + MOST_S);
    if to_s <= from_s {
        return Err(CollectError::Backwards { from_s, to_s });
    }
    if to_s - from_s > MOST_S {
        return Err(CollectError::TooLong { from_s, to_s });
    }
    let (from, to) = (after(from_s), after(to_s));
    let at_surface = window.at_surface_s.map(|span| span.map(after));
    let end = at_surface.map_or(to, |[_, surface_to]| to.max(surface_to));
    let is_wanted =
        |at: MonoNs| (at >= from && at < to) || at_surface.is_some_and(|[from, to]| at >= from && at < to);
    let sensors = dive.sensors();
    let mut events: Vec<Event> = Vec::new();
    drive(&mut dive, &mut Until { feed, end }, Pace::default(), &mut |dive| {
        let heard = dive.view().readings();
        events.extend(heard.iter().filter(|event| is_wanted(event.received)));
        progress(events.len());
    })?;
    let last = events.last().map_or(from, |event| event.received + DurNs(1));
    Ok(Collected { clock, from, to: to.min(last.max(from)), at_surface, sensors, events })
}

/// Readings of a log, with the sensors and settings that the vehicle file describes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Material<'a> {
    /// Design profile of the tunnel's cross-section.
    pub(crate) profile: &'a Profile,
    /// Water and location, from the vehicle file.
    pub(crate) site: Site,
    /// Measurement noise of the sensors, as the navigation filter assumes it.
    pub(crate) settings: Settings,
    /// Sensors of the vehicle file. The index is the number of the packet source.
    pub(crate) sensors: &'a [SensorInfo],
    /// All readings, in the order in which the loop processed them.
    pub(crate) events: &'a [Event],
}

impl<'a> Material<'a> {
    /// Readings received from `from` (inclusive) to `to` (exclusive), each with its sensor.
    pub(crate) fn during(
        &self,
        from: MonoNs,
        to: MonoNs,
    ) -> impl Iterator<Item = (&'a Event, &'a SensorInfo)> {
        let sensors = self.sensors;
        let within = self.events.iter().filter(move |event| event.received >= from && event.received < to);
        within.filter_map(move |event| sensors.get(event.source.index()).map(|sensor| (event, sensor)))
    }
}
