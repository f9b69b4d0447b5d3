//! Interactive playback of a recorded dive: pause, single ticks, other speeds, and jumps to any time.

use std::time::{Duration, Instant};

use crossbeam::channel::{Receiver, RecvTimeoutError};
use headrace_geometry::snapshot::{Restorer, Saver, SnapshotError};
use headrace_geometry::time::{DiveClock, DurNs, MonoNs};
use headrace_monitor::messages::Notice;
use headrace_monitor::run::Loop;

use crate::drive::{Clock, DriveError, Driver, Pace};
use crate::log::LogError;
use crate::player::Player;
use crate::snapshot_store::SnapshotStore;

/// Name of a snapshot's first part, which holds the player's position in the log. The loop's state follows.
const PLACE_PART: &str = "place in the log";

/// A command that controls playback. Commands are executed in order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PlaybackCommand {
    /// Pauses between two ticks.
    Pause,
    /// Resumes playing after a pause.
    Go,
    /// Runs this many ticks, then pauses.
    Step(u32),
    /// Plays until a section is judged, then pauses.
    StepSection,
    /// Sets the speed, seconds of the dive per second of wall time; `None` means as fast as possible.
    Speed(Option<f64>),
    /// Jumps to a time on the log's clock, forward or back. Playback stays playing or paused.
    Seek(MonoNs),
    /// Jumps by a duration, which is negative for a jump back.
    Skip(DurNs),
    /// Ends playback at the current tick, before the end of the log.
    End,
}

/// Reason why playback failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlaybackError {
    /// Feeding the monitor's loop from the log fails.
    #[error(transparent)]
    Drive(#[from] DriveError),
    /// The log can't be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A snapshot of the loop can't be taken or restored.
    #[error(transparent)]
    Snapshot(#[from] SnapshotError),
}

/// Receives the events of playback, for display.
pub trait PlaybackObserver {
    /// Called after each tick that is played.
    fn after_tick(&mut self, dive: &Loop);

    /// Called after each tick that a jump skips. The results of a skipped tick must not be displayed.
    fn after_skipped_tick(&mut self, dive: &Loop);

    /// Called when playback pauses, after a jump, and at the end of the log. `ended` is true only at the end of the
    /// log.
    ///
    /// `at` is the end of the latest tick.
    fn stopped(&mut self, dive: &Loop, at: MonoNs, ended: bool);

    /// Called when playback pauses or resumes, and when its speed changes.
    fn mode(&mut self, _paused: bool, _speed: Option<f64>) {}
}

/// Playback of a log through the loop.
pub struct Playback<'a> {
    dive: &'a mut Loop,
    player: &'a mut Player,
    store: SnapshotStore,
    driver: Driver,
    clock: Clock,
    speed: Option<f64>,
    /// End of the latest tick that was run, on the log's clock.
    now: MonoNs,
    /// Receive time of the log's first packet.
    begun: MonoNs,
    mode: Mode,
    /// Wall time spent on ticks since the latest snapshot.
    worked: Duration,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Mode {
    Playing,
    Paused,
    /// Number of ticks left to run before playback pauses.
    Stepping(u32),
    /// Plays until the next section is judged, then pauses.
    SteppingSection,
}

impl<'a> Playback<'a> {
    /// Creates a playback that starts at the beginning of the log. The player must already be connected to the loop.
    ///
    /// A snapshot is taken whenever processing since the previous snapshot has taken longer than the store's interval.
    /// A jump therefore takes hardly longer than this interval.
    ///
    /// Errors: the log can't be read, or the first snapshot can't be taken.
    pub fn new(
        dive: &'a mut Loop,
        player: &'a mut Player,
        store: SnapshotStore,
        pace: Pace,
    ) -> Result<Self, PlaybackError> {
        let driver = Driver::new(dive, pace.tick)?;
        let begun = driver.due(player)?.map_or(MonoNs(0), |until| until - pace.tick);
        let clock = Clock::start(begun, pace.speed);
        let mut playback = Self {
            dive,
            player,
            store,
            driver,
            clock,
            speed: pace.speed,
            now: begun,
            begun,
            mode: Mode::Playing,
            worked: Duration::ZERO,
        };
        playback.take_snapshot()?;
        Ok(playback)
    }

    /// Returns the dive's clock.
    pub fn dive_clock(&self) -> DiveClock {
        self.player.dive_clock()
    }

    /// Plays until [`PlaybackCommand::End`], or until the log has ended and the command channel is closed.
    ///
    /// Errors: see [`PlaybackError`].
    pub fn play(
        &mut self,
        commands: &Receiver<PlaybackCommand>,
        observer: &mut dyn PlaybackObserver,
    ) -> Result<(), PlaybackError> {
        loop {
            let due = self.driver.due(self.player)?;
            let command = match due {
                None => {
                    // At the log's end, the steps that are still to be run are discarded, so that a later jump back
                    // doesn't run them.
                    if let Mode::Stepping(_) | Mode::SteppingSection = self.mode {
                        self.mode = Mode::Paused;
                    }
                    observer.mode(true, self.speed);
                    observer.stopped(self.dive, self.now, true);
                    match commands.recv() {
                        Ok(command) => Some(command),
                        Err(_) => return Ok(()),
                    }
                }
                Some(until) => self.wait(until, commands),
            };
            match command {
                Some(PlaybackCommand::End) => return Ok(()),
                Some(command) => self.execute(command, observer)?,
                None => self.tick(observer)?,
            }
        }
    }

    /// Waits until the next tick is due or, if paused, for a command. Returns a command that arrives before the tick is
    /// due.
    fn wait(&mut self, until: MonoNs, commands: &Receiver<PlaybackCommand>) -> Option<PlaybackCommand> {
        match self.mode {
            Mode::Paused => {
                // If the command channel is closed, playback continues to the end.
                let command = commands.recv().ok();
                if command.is_none() {
                    (self.mode, self.clock) = (Mode::Playing, Clock::start(self.now, self.speed));
                }
                command
            }
            Mode::Stepping(_) => None,
            // Checks for a command without waiting. The next section whose verdict is settled may be far away, so a
            // command must be able to end the search for it.
            Mode::SteppingSection => commands.try_recv().ok(),
            Mode::Playing => match self.clock.left(until) {
                None => commands.try_recv().ok(),
                Some(left) => match commands.recv_timeout(left) {
                    Ok(command) => Some(command),
                    Err(RecvTimeoutError::Timeout) => None,
                    Err(RecvTimeoutError::Disconnected) => {
                        std::thread::sleep(self.clock.left(until).unwrap_or(Duration::ZERO));
                        None
                    }
                },
            },
        }
    }

    fn tick(&mut self, observer: &mut dyn PlaybackObserver) -> Result<(), PlaybackError> {
        let mut is_judged = false;
        self.advance(&mut |dive| {
            is_judged |= dive.view().notices().any(|notice| matches!(notice, Notice::Section { .. }));
            observer.after_tick(dive);
        })?;
        self.mode = match self.mode {
            Mode::Stepping(left) if left > 1 => Mode::Stepping(left - 1),
            Mode::SteppingSection if !is_judged => Mode::SteppingSection,
            Mode::Stepping(_) | Mode::SteppingSection => {
                observer.mode(true, self.speed);
                observer.stopped(self.dive, self.now, false);
                Mode::Paused
            }
            mode => mode,
        };
        Ok(())
    }

    #[expect(
        clippy::disallowed_methods,
        reason = "when snapshots are taken decides how fast jumps are; no result depends on it"
    )]
    fn advance(&mut self, after_tick: &mut dyn FnMut(&Loop)) -> Result<(), PlaybackError> {
        let Some(until) = self.driver.due(self.player)? else { return Ok(()) };
        let (begun, before) = (Instant::now(), self.now);
        self.driver.tick(self.dive, self.player, after_tick)?;
        self.now = until;
        self.worked += begun.elapsed();
        if self.store.latest(until).is_some_and(|latest| latest > before) {
            self.worked = Duration::ZERO;
        } else if self.worked >= self.store.interval() {
            self.take_snapshot()?;
        }
        Ok(())
    }

    fn take_snapshot(&mut self) -> Result<(), PlaybackError> {
        let mut saver = Saver::default();
        saver.part(PLACE_PART);
        saver.value(&self.player.place());
        saver.raw(&self.dive.save()?);
        self.store.insert(self.now, &saver.finish()?);
        self.worked = Duration::ZERO;
        Ok(())
    }

    /// Restores the snapshot of time `at`, which must be a time that the snapshot store has returned.
    fn restore(&mut self, at: MonoNs) -> Result<(), PlaybackError> {
        let Some(snapshot) = self.store.load(at) else { return Ok(()) };
        let mut restorer = Restorer::new(&snapshot);
        restorer.part(PLACE_PART)?;
        self.player.go_to(&restorer.value()?)?;
        self.dive.restore(restorer.raw()?)?;
        self.driver.jump_to(at);
        (self.now, self.worked) = (at, Duration::ZERO);
        Ok(())
    }

    fn execute(
        &mut self,
        command: PlaybackCommand,
        observer: &mut dyn PlaybackObserver,
    ) -> Result<(), PlaybackError> {
        match command {
            PlaybackCommand::Pause => self.mode = Mode::Paused,
            PlaybackCommand::Go => self.mode = Mode::Playing,
            PlaybackCommand::Step(ticks) => {
                self.mode = if ticks > 0 { Mode::Stepping(ticks) } else { Mode::Paused };
            }
            PlaybackCommand::StepSection => self.mode = Mode::SteppingSection,
            PlaybackCommand::Speed(speed) => self.speed = speed,
            PlaybackCommand::Seek(to) => self.seek(to, observer)?,
            PlaybackCommand::Skip(by) => self.seek(self.now + by, observer)?,
            PlaybackCommand::End => {}
        }
        observer.mode(self.mode == Mode::Paused, self.speed);
        if matches!(command, PlaybackCommand::Pause | PlaybackCommand::Seek(_) | PlaybackCommand::Skip(_)) {
            observer.stopped(self.dive, self.now, false);
        }
        self.clock = Clock::start(self.now, self.speed);
        Ok(())
    }

    /// Jumps to the last tick that ends at or before `to`. Starts from the current position, or from the nearest
    /// earlier snapshot.
    ///
    /// Errors: see [`PlaybackError`].
    pub fn seek(&mut self, to: MonoNs, observer: &mut dyn PlaybackObserver) -> Result<(), PlaybackError> {
        let to = to.max(self.begun);
        let latest = self.store.latest(to);
        if let Some(at) = latest.filter(|at| to < self.now || *at > self.now) {
            self.restore(at)?;
        }
        while self.driver.due(self.player)?.is_some_and(|until| until <= to) {
            self.advance(&mut |dive| observer.after_skipped_tick(dive))?;
        }
        self.clock = Clock::start(self.now, self.speed);
        Ok(())
    }
}
