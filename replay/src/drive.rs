//! Drives a loop from a log or a simulation: fills the rings tick by tick, as the ports' threads would.

use std::time::{Duration, Instant};

use headrace_core::app::reading::SourceId;
use headrace_core::app::ring::{Port, RingError};
use headrace_core::app::run::Loop;
use headrace_core::time::{DurNs, MonoNs};

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
    let mut ports = take_ports(dive)?;
    let Some(first) = feed.coming()? else { return Ok(()) };
    let clock = Clock::start(first.at, pace.speed);
    let mut until = first.at + pace.tick;
    let mut result = Ok(());
    loop {
        match send_until(dive, feed, &mut ports, until, after_tick) {
            Ok(Some(_)) => {}
            Ok(None) => {
                work_off(dive, until, after_tick);
                return result;
            }
            Err(error) => {
                result = Err(error);
                work_off(dive, until, after_tick);
                return result;
            }
        }
        clock.wait(until);
        work_off(dive, until, after_tick);
        // After a long silence the next tick begins with what ends it.
        let next = feed.coming()?.map_or(until, |coming| coming.at);
        until = (until + pace.tick).max(next + DurNs(1));
    }
}

fn take_ports(dive: &mut Loop) -> Result<Vec<Port>, DriveError> {
    let ids: Vec<String> = dive.sources().iter().map(|source| source.id.clone()).collect();
    ids.into_iter()
        .enumerate()
        .map(|(index, source_id)| dive.take_port(index).ok_or(DriveError::PortTaken { source_id }))
        .collect()
}

/// Sends what comes before `until`; gives what comes next, or `None` at the end.
fn send_until(
    dive: &mut Loop,
    feed: &mut dyn Feed,
    ports: &mut [Port],
    until: MonoNs,
    after_tick: &mut dyn FnMut(&Loop),
) -> Result<Option<Coming>, DriveError> {
    while let Some(coming) = feed.coming()? {
        if coming.at >= until {
            return Ok(Some(coming));
        }
        let Some(port) = ports.get_mut(coming.source.index()) else { continue };
        if !port.has_room(coming.len) {
            // Results don't depend on where ticks end; a full ring ends one.
            work_off(dive, coming.at, after_tick);
        }
        if let Err(error) = feed.send(port) {
            tracing::error!(%error, "a packet of the feed could not be handed over");
        }
    }
    Ok(None)
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
struct Clock {
    origin: MonoNs,
    paced: Option<(Instant, f64)>,
}

impl Clock {
    #[expect(clippy::disallowed_methods, reason = "pacing is for people who watch; no result depends on it")]
    fn start(origin: MonoNs, speed: Option<f64>) -> Self {
        Self { origin, paced: speed.map(|speed| (Instant::now(), speed)) }
    }

    fn wait(&self, until: MonoNs) {
        let Some((started, speed)) = self.paced else { return };
        let wanted = Duration::try_from_secs_f64(until.since(self.origin).as_secs_f64() / speed);
        if let Some(left) = wanted.ok().and_then(|wanted| wanted.checked_sub(started.elapsed())) {
            std::thread::sleep(left);
        }
    }
}
