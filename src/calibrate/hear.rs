//! The readings of a part of a log, as the loop's decoders give them.

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::messages::Event;
use headrace_monitor::ring::{Port, RingError};
use headrace_monitor::run::Loop;
use headrace_replay::drive::{Coming, Feed, Pace, drive};
use headrace_replay::log::LogError;
use headrace_replay::player::Player;
use headrace_sensor::device::SensorInfo;

use crate::cli::Calibrate;
use crate::failure::Failure;
use crate::progress::Progress;

/// So much of a log is held in memory, s.
const MOST_S: f64 = 1200.0;

/// What was heard.
pub(super) struct Heard {
    /// Time of the log's first message.
    pub(super) first: MonoNs,
    /// The part that was asked for.
    pub(super) from: MonoNs,
    pub(super) to: MonoNs,
    pub(super) at_surface: Option<[MonoNs; 2]>,
    /// The sensors as the vehicle file has them, by source.
    pub(super) sensors: Vec<SensorInfo>,
    /// Readings of that part and of the time at the surface, in order.
    pub(super) events: Vec<Event>,
}

impl Heard {
    /// The readings of the part that was asked for.
    pub(super) fn within(&self) -> impl Iterator<Item = &Event> {
        self.events.iter().filter(|event| event.received >= self.from && event.received < self.to)
    }

    /// Seconds from the log's first message.
    pub(super) fn seconds(&self, at: MonoNs) -> f64 {
        at.since(self.first).as_secs_f64()
    }
}

/// A feed that ends early.
struct Until<'a> {
    player: &'a mut Player,
    end: MonoNs,
}

impl Feed for Until<'_> {
    fn coming(&mut self) -> Result<Option<Coming>, LogError> {
        Ok(self.player.coming()?.filter(|coming| coming.at < self.end))
    }

    fn send(&mut self, port: &mut Port) -> Result<(), RingError> {
        self.player.send(port)
    }
}

/// Runs the log up to the last moment that is needed through the loop, and keeps the readings that are.
///
/// What comes before is run as well: decoders go by it.
pub(super) fn hear(mut dive: Loop, player: &mut Player, args: &Calibrate) -> Result<Heard, Failure> {
    let first = player.coming()?.map_or(MonoNs(0), |coming| coming.at);
    let after = |seconds: f64| first + DurNs::from_secs_f64(seconds);
    let to_s = args.to.unwrap_or(args.from + MOST_S);
    if to_s <= args.from {
        return Err(Failure::Usage(format!("calibrating: --to {to_s} is not after --from {}", args.from)));
    }
    if to_s - args.from > MOST_S {
        let problem = "that is more than can be looked at; the most is";
        return Err(Failure::Usage(format!(
            "calibrating from {} to {to_s} s: {problem} {MOST_S} s",
            args.from
        )));
    }
    let (from, to) = (after(args.from), after(to_s));
    let at_surface = args.at_surface.map(|span| span.map(after));
    let end = at_surface.map_or(to, |[_, surface_to]| to.max(surface_to));
    let is_wanted =
        |at: MonoNs| (at >= from && at < to) || at_surface.is_some_and(|[from, to]| at >= from && at < to);
    let sensors = dive.sensors();
    let mut events: Vec<Event> = Vec::new();
    let mut progress = Progress::start();
    drive(&mut dive, &mut Until { player, end }, Pace::default(), &mut |dive| {
        let heard = dive.readings();
        events.extend(heard.iter().filter(|event| is_wanted(event.received)));
        progress.at(|| format!("{} readings", events.len()));
    })?;
    let last = events.last().map_or(from, |event| event.received + DurNs(1));
    Ok(Heard { first, from, to: to.min(last.max(from)), at_surface, sensors, events })
}
