//! Drives a loop from a log or a simulation: fills the packet rings tick by tick, as the threads of the ports do in a
//! dive.

use std::time::{Duration, Instant};

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::feed::{self, Feed, work_off};
use headrace_monitor::ring::{Port, RingError};
use headrace_monitor::run::Loop;
use headrace_sensor::reading::SourceId;

use crate::log::LogError;

/// Time, source and length of a feed's next packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Coming {
    /// Time at which the packet was received.
    pub at: MonoNs,
    /// Number of the packet's source in the loop.
    pub source: SourceId,
    /// Length of the packet, bytes.
    pub len: usize,
}

/// A source of packets in place of open ports.
pub trait PacketSource {
    /// Returns the next packet; `None` at the end.
    ///
    /// Errors: reading the log fails.
    fn coming(&mut self) -> Result<Option<Coming>, LogError>;

    /// Returns the first and last time of the packets, if known.
    fn span(&self) -> Option<(MonoNs, MonoNs)> {
        None
    }

    /// Sends the next packet to the ring of its source.
    ///
    /// Errors: the packet doesn't fit, and remains the next packet.
    fn send(&mut self, port: &mut Port) -> Result<(), RingError>;
}

/// Tick length and playback speed with which a loop is fed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pace {
    /// Length of a tick in packet time; must be positive.
    pub tick: DurNs,
    /// Seconds of packet time per second of wall time; `None` means as fast as possible.
    pub speed: Option<f64>,
}

impl Default for Pace {
    /// Ticks of 20 ms, processed as fast as possible.
    fn default() -> Self {
        Self { tick: DurNs(20_000_000), speed: None }
    }
}

/// Reason why feeding a loop from a log or simulation stopped early.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DriveError {
    /// Reading the log fails.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A port of the loop is in use elsewhere.
    #[error("driving the loop: the port of source {source_id:?} has been taken already")]
    PortTaken {
        /// Id of the source whose port is in use.
        source_id: String,
    },
    /// The loops differ in more than the length of their sections, so they can't share one navigation.
    #[error(
        "driving several loops with one navigation: loop {number}, counted from 0, has other sensors, another tunnel or layout than \
         loop 0, or adds its own processing of pings"
    )]
    Unlike {
        /// Index of the loop that differs from loop 0.
        number: usize,
    },
    /// A thread of the replay has panicked, which is a bug. The loop must not be used afterwards.
    #[error("driving the loop: the thread that {what} has panicked: {message}; please report it")]
    Panicked {
        /// Task of the thread that panicked.
        what: &'static str,
        /// Text of the thread's panic.
        message: String,
    },
}

/// Runs the loop until the source ends; `after_tick` is called after every tick.
///
/// Errors: see [`DriveError`]. Packets fed before the error have been processed.
pub fn drive(
    dive: &mut Loop,
    source: &mut dyn PacketSource,
    pace: Pace,
    after_tick: &mut dyn FnMut(&Loop),
) -> Result<(), DriveError> {
    let driver = Driver::new(dive, pace.tick)?;
    feed::drive(dive, &mut PacedFeed { driver, source, pace, clock: None }, after_tick)
}

/// Feeds a loop from a packet source, at a given pace.
struct PacedFeed<'a> {
    driver: Driver,
    source: &'a mut dyn PacketSource,
    pace: Pace,
    clock: Option<Clock>,
}

impl Feed for PacedFeed<'_> {
    type Error = DriveError;

    fn fill(
        &mut self,
        dive: &mut Loop,
        after_tick: &mut dyn FnMut(&Loop),
    ) -> Result<Option<MonoNs>, DriveError> {
        let Some(until) = self.driver.due(self.source)? else { return Ok(None) };
        let pace = self.pace;
        let clock = self.clock.get_or_insert_with(|| Clock::start(until - pace.tick, pace.speed));
        if let Some(left) = clock.left(until) {
            std::thread::sleep(left);
        }
        self.driver.fill(self.source, until, &mut |now| work_off(dive, now, after_tick, &mut pause))?;
        Ok(Some(until))
    }

    fn pause(&mut self) {
        pause();
    }
}

/// Waits briefly, so that a slow receiver of results can catch up.
pub(crate) fn pause() {
    std::thread::sleep(Duration::from_millis(1));
}

/// Fills the rings and runs the loop, one tick at a time.
pub struct Driver {
    ports: Vec<Port>,
    tick: DurNs,
    /// End of the previous tick, in packet time; `None` before the first.
    until: Option<MonoNs>,
}

impl Driver {
    /// Takes the loop's ports, for ticks of length `tick`.
    ///
    /// Errors: a port is in use elsewhere.
    pub fn new(dive: &mut Loop, tick: DurNs) -> Result<Self, DriveError> {
        Ok(Self { ports: take_ports(dive)?, tick, until: None })
    }

    /// Returns the end of the next tick; `None` at the end of the feed.
    ///
    /// If the feed has a gap, the tick ends just after the first packet that follows the gap.
    ///
    /// Errors: reading the feed fails.
    pub fn due(&self, feed: &mut dyn PacketSource) -> Result<Option<MonoNs>, DriveError> {
        let Some(next) = feed.coming()? else { return Ok(None) };
        let begun = self.until.map(|until| until + self.tick);
        Ok(Some(begun.map_or(next.at + self.tick, |until| until.max(next.at + DurNs(1)))))
    }

    /// Feeds packets up to the end of the next tick, and runs the tick.
    ///
    /// Errors: see [`DriveError`]. Packets fed before the error have been processed.
    pub fn tick(
        &mut self,
        dive: &mut Loop,
        feed: &mut dyn PacketSource,
        after_tick: &mut dyn FnMut(&Loop),
    ) -> Result<(), DriveError> {
        let Some(until) = self.due(feed)? else { return Ok(()) };
        let work_off = &mut |now| work_off(dive, now, after_tick, &mut pause);
        self.fill(feed, until, work_off)?;
        work_off(until);
        Ok(())
    }

    /// Feeds packets received before `until`. Whenever a ring is full, calls `work_off`, which runs a tick to empty the
    /// ring.
    ///
    /// After an error, the packets fed so far have been processed.
    pub(crate) fn fill(
        &mut self,
        feed: &mut dyn PacketSource,
        until: MonoNs,
        work_off: &mut dyn FnMut(MonoNs),
    ) -> Result<(), DriveError> {
        self.until = Some(until);
        let sent = send_until(feed, &mut self.ports, until, work_off);
        if sent.is_err() {
            work_off(until);
        }
        sent
    }

    /// Sets the end of the previous tick to `until`, after the feed and the loop have jumped to this time.
    pub fn jump_to(&mut self, until: MonoNs) {
        self.until = Some(until);
    }
}

/// Takes the ports of all sensors. Also takes the port of the operator's input, unless an operator is already
/// connected.
fn take_ports(dive: &mut Loop) -> Result<Vec<Port>, DriveError> {
    let ids: Vec<String> = dive.sources().iter().map(|source| source.id.clone()).collect();
    let sensors = ids.into_iter().enumerate();
    let mut ports = sensors
        .map(|(index, source_id)| dive.take_port(index).ok_or(DriveError::PortTaken { source_id }))
        .collect::<Result<Vec<_>, _>>()?;
    ports.extend(dive.take_console());
    Ok(ports)
}

/// Sends all packets received before `until`. Runs a tick whenever a ring is full.
fn send_until(
    feed: &mut dyn PacketSource,
    ports: &mut [Port],
    until: MonoNs,
    work_off: &mut dyn FnMut(MonoNs),
) -> Result<(), DriveError> {
    // No packet can have a timestamp above the clock's largest value, so a packet with that timestamp belongs to the
    // last tick.
    let is_due = |coming: &Coming| coming.at < until || until == MonoNs(u64::MAX);
    while let Some(coming) = feed.coming()?.filter(is_due) {
        let Some(port) = ports.get_mut(coming.source.index()) else { continue };
        if !port.has_room(coming.len) {
            // The ring is full, so a tick is run now to empty it. Results don't depend on where ticks end.
            work_off(coming.at);
        }
        if let Err(error) = feed.send(port) {
            tracing::error!(%error, "a packet of the feed could not be handed over");
        }
    }
    Ok(())
}

/// Maps packet time to wall time at the playback speed.
pub(crate) struct Clock {
    origin: MonoNs,
    paced: Option<(Instant, f64)>,
}

impl Clock {
    /// Starts the clock: packet time is now `origin`, and advances by `speed` seconds per second of wall time.
    ///
    /// If `speed` is `None`, the clock never waits.
    #[expect(clippy::disallowed_methods, reason = "pacing is for people who watch; no result depends on it")]
    pub(crate) fn start(origin: MonoNs, speed: Option<f64>) -> Self {
        Self { origin, paced: speed.map(|speed| (Instant::now(), speed)) }
    }

    /// Returns the wall time that is left until packet time reaches `until`; `None` if that time has been reached.
    pub(crate) fn left(&self, until: MonoNs) -> Option<Duration> {
        let (started, speed) = self.paced?;
        let wanted = Duration::try_from_secs_f64(until.since(self.origin).as_secs_f64() / speed).ok()?;
        wanted.checked_sub(started.elapsed()).filter(|left| !left.is_zero())
    }
}
