//! Drives a loop from a log or a simulation: fills the rings tick by tick, as the ports' threads would.

use std::time::{Duration, Instant};

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::ring::{Port, RingError};
use headrace_monitor::run::Loop;
use headrace_sensor::reading::SourceId;

use crate::log::LogError;

/// What comes next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Coming {
    /// Its receive time.
    pub at: MonoNs,
    /// The loop's source.
    pub source: SourceId,
    /// Its length in bytes.
    pub len: usize,
}

/// Where packets come from when no port is open.
pub trait Feed {
    /// The next packet, or `None` at the end.
    ///
    /// Errors: the log can't be read on.
    fn coming(&mut self) -> Result<Option<Coming>, LogError>;

    /// Puts that packet into its source's ring.
    ///
    /// Errors: it doesn't fit; it is still the next one.
    fn send(&mut self, port: &mut Port) -> Result<(), RingError>;
}

/// How to drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pace {
    /// Length of a tick in the packets' own time, positive.
    pub tick: DurNs,
    /// Seconds of the packets' time for a second of ours; `None` goes as fast as it can.
    pub speed: Option<f64>,
}

impl Default for Pace {
    /// Ticks of 20 ms, as fast as it can.
    fn default() -> Self {
        Self { tick: DurNs(20_000_000), speed: None }
    }
}

/// Why a dive could not be driven to its end.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DriveError {
    /// The log can't be read on.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A port of the loop is in use elsewhere.
    #[error("driving the loop: the port of source {source_id:?} has been taken already")]
    PortTaken {
        /// The source.
        source_id: String,
    },
}

/// Runs the loop until the feed ends; `after_tick` sees it after every tick.
///
/// Errors: see [`DriveError`]. What had been fed until then has been worked off.
pub fn drive(
    dive: &mut Loop,
    feed: &mut dyn Feed,
    pace: Pace,
    after_tick: &mut dyn FnMut(&Loop),
) -> Result<(), DriveError> {
    let mut driver = Driver::new(dive, pace.tick)?;
    let mut clock = None;
    while let Some(until) = driver.due(feed)? {
        let clock = clock.get_or_insert_with(|| Clock::start(until - pace.tick, pace.speed));
        if let Some(left) = clock.left(until) {
            std::thread::sleep(left);
        }
        driver.tick(dive, feed, after_tick)?;
    }
    Ok(())
}

/// Fills the rings and runs the loop, a tick at a time.
pub struct Driver {
    ports: Vec<Port>,
    tick: DurNs,
    /// The end of the tick before; `None` at the beginning.
    until: Option<MonoNs>,
}

impl Driver {
    /// Takes the loop's ports, for ticks of a length.
    ///
    /// Errors: a port is in use elsewhere.
    pub fn new(dive: &mut Loop, tick: DurNs) -> Result<Self, DriveError> {
        Ok(Self { ports: take_ports(dive)?, tick, until: None })
    }

    /// When the next tick ends; `None` at the end of the feed. After a long silence it begins with what ends that.
    ///
    /// Errors: the feed can't be read on.
    pub fn due(&self, feed: &mut dyn Feed) -> Result<Option<MonoNs>, DriveError> {
        let Some(next) = feed.coming()? else { return Ok(None) };
        let begun = self.until.map(|until| until + self.tick);
        Ok(Some(begun.map_or(next.at + self.tick, |until| until.max(next.at + DurNs(1)))))
    }

    /// Feeds what comes until the next tick ends, and runs it.
    ///
    /// Errors: see [`DriveError`]. What had been fed until then has been worked off.
    pub fn tick(
        &mut self,
        dive: &mut Loop,
        feed: &mut dyn Feed,
        after_tick: &mut dyn FnMut(&Loop),
    ) -> Result<(), DriveError> {
        let Some(until) = self.due(feed)? else { return Ok(()) };
        self.until = Some(until);
        let sent = send_until(dive, feed, &mut self.ports, until, after_tick);
        work_off(dive, until, after_tick);
        sent
    }

    /// The feed goes on from elsewhere, and the loop with it: after a tick that ended at `until`.
    pub fn jump_to(&mut self, until: MonoNs) {
        self.until = Some(until);
    }
}

fn take_ports(dive: &mut Loop) -> Result<Vec<Port>, DriveError> {
    let ids: Vec<String> = dive.sources().iter().map(|source| source.id.clone()).collect();
    ids.into_iter()
        .enumerate()
        .map(|(index, source_id)| dive.take_port(index).ok_or(DriveError::PortTaken { source_id }))
        .collect()
}

/// Sends what comes before `until`.
fn send_until(
    dive: &mut Loop,
    feed: &mut dyn Feed,
    ports: &mut [Port],
    until: MonoNs,
    after_tick: &mut dyn FnMut(&Loop),
) -> Result<(), DriveError> {
    while let Some(coming) = feed.coming()?.filter(|coming| coming.at < until) {
        let Some(port) = ports.get_mut(coming.source.index()) else { continue };
        if !port.has_room(coming.len) {
            // Results don't depend on where ticks end; a full ring ends one.
            work_off(dive, coming.at, after_tick);
        }
        if let Err(error) = feed.send(port) {
            tracing::error!(%error, "a packet of the feed could not be handed over");
        }
    }
    Ok(())
}

/// Ticks until nothing waits. An outlet that is behind holds packets back; it is given time.
fn work_off(dive: &mut Loop, now: MonoNs, after_tick: &mut dyn FnMut(&Loop)) {
    loop {
        let consumed = dive.tick(now);
        after_tick(dive);
        if !dive.has_waiting() {
            return;
        }
        if consumed == 0 {
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

/// Relates the packets' time to ours.
pub(crate) struct Clock {
    origin: MonoNs,
    paced: Option<(Instant, f64)>,
}

impl Clock {
    /// That the packets' time is `origin` now, and goes so many seconds for a second of ours; `None` goes without waiting.
    #[expect(clippy::disallowed_methods, reason = "pacing is for people who watch; no result depends on it")]
    pub(crate) fn start(origin: MonoNs, speed: Option<f64>) -> Self {
        Self { origin, paced: speed.map(|speed| (Instant::now(), speed)) }
    }

    /// How long it is, of our time, until that moment of the packets'; `None` when it is over.
    pub(crate) fn left(&self, until: MonoNs) -> Option<Duration> {
        let (started, speed) = self.paced?;
        let wanted = Duration::try_from_secs_f64(until.since(self.origin).as_secs_f64() / speed).ok()?;
        wanted.checked_sub(started.elapsed()).filter(|left| !left.is_zero())
    }
}
