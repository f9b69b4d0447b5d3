//! A recorded dive as people watch it: with pauses, single ticks, other speeds, and jumps to any of its moments.

use std::time::{Duration, Instant};

use crossbeam::channel::{Receiver, RecvTimeoutError};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::run::Loop;
use headrace_snapshot::SnapshotError;

use crate::drive::{Clock, DriveError, Driver, Pace};
use crate::log::LogError;
use crate::player::Player;
use crate::states::{States, StatesError};

/// What whoever watches wishes; each is granted when the one before has been.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Wish {
    /// To stop between two ticks.
    Pause,
    /// To go on.
    Go,
    /// To run so many ticks, and stop.
    Step(u32),
    /// Seconds of the dive for a second of ours; `None` as fast as it can.
    Speed(Option<f64>),
    /// To go to a moment of the log's clock, before or behind, and on from there as it was going.
    Seek(MonoNs),
    /// To go so far on, or back.
    Skip(DurNs),
    /// To stop here for good.
    End,
}

/// Why a dive can't be played on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlaybackError {
    /// The loop can't be driven.
    #[error(transparent)]
    Drive(#[from] DriveError),
    /// The log can't be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// States can't be kept or had back.
    #[error(transparent)]
    States(#[from] StatesError),
    /// A state can't be saved or restored.
    #[error(transparent)]
    Snapshot(#[from] SnapshotError),
}

/// What is seen while a dive is played.
pub trait Watcher {
    /// After a tick.
    fn ticked(&mut self, dive: &Loop);

    /// After a tick on the way to somewhere else: what it has to tell is to be passed over.
    fn passed(&mut self, dive: &Loop);

    /// The dive stands still at a moment, or has gone there at once; `ended` at its end.
    fn stands(&mut self, dive: &Loop, at: MonoNs, ended: bool);
}

/// A dive that is played.
pub struct Playback<'a> {
    dive: &'a mut Loop,
    player: &'a mut Player,
    states: States,
    driver: Driver,
    clock: Clock,
    speed: Option<f64>,
    /// The end of the last tick.
    now: MonoNs,
    /// The log's first moment.
    begun: MonoNs,
    going: Going,
    /// A state is kept when so much work has been done since the last.
    between: Duration,
    worked: Duration,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Going {
    On,
    Still,
    Ticks(u32),
}

impl<'a> Playback<'a> {
    /// Of a log from its beginning, the player connected with the loop. A state is kept when the loop has worked for
    /// `between` since the last, so that from one to the next it never takes longer.
    ///
    /// Errors: the log can't be read, or the first state not be kept.
    pub fn new(
        dive: &'a mut Loop,
        player: &'a mut Player,
        states: States,
        pace: Pace,
        between: Duration,
    ) -> Result<Self, PlaybackError> {
        let driver = Driver::new(dive, pace.tick)?;
        let begun = driver.due(player)?.map_or(MonoNs(0), |until| until - pace.tick);
        let clock = Clock::start(begun, pace.speed);
        let mut playback = Self {
            dive,
            player,
            states,
            driver,
            clock,
            speed: pace.speed,
            now: begun,
            begun,
            going: Going::On,
            between,
            worked: Duration::ZERO,
        };
        if playback.states.latest(begun).is_none() {
            playback.keep()?;
        }
        Ok(playback)
    }

    /// The log's first moment.
    pub fn begun(&self) -> MonoNs {
        self.begun
    }

    /// Plays until the log ends and nobody can wish anything any more, or [`Wish::End`].
    ///
    /// Errors: see [`PlaybackError`].
    pub fn play(&mut self, wishes: &Receiver<Wish>, watcher: &mut dyn Watcher) -> Result<(), PlaybackError> {
        loop {
            let due = self.driver.due(self.player)?;
            let wish = match due {
                None => {
                    // There are no ticks left to run; none are owed after a jump back, either.
                    if let Going::Ticks(_) = self.going {
                        self.going = Going::Still;
                    }
                    watcher.stands(self.dive, self.now, true);
                    match wishes.recv() {
                        Ok(wish) => Some(wish),
                        Err(_) => return Ok(()),
                    }
                }
                Some(until) => self.wait(until, wishes),
            };
            match wish {
                Some(Wish::End) => return Ok(()),
                Some(wish) => self.grant(wish, watcher)?,
                None => self.tick(watcher)?,
            }
        }
    }

    /// Waits until a tick is due, and for as long as the dive is to stand still; gives what is wished before.
    fn wait(&mut self, until: MonoNs, wishes: &Receiver<Wish>) -> Option<Wish> {
        match self.going {
            Going::Still => {
                // With nobody left to say otherwise it goes on.
                let wish = wishes.recv().ok();
                if wish.is_none() {
                    (self.going, self.clock) = (Going::On, Clock::start(self.now, self.speed));
                }
                wish
            }
            Going::Ticks(_) => None,
            Going::On => match self.clock.left(until) {
                None => wishes.try_recv().ok(),
                Some(left) => match wishes.recv_timeout(left) {
                    Ok(wish) => Some(wish),
                    Err(RecvTimeoutError::Timeout) => None,
                    Err(RecvTimeoutError::Disconnected) => {
                        std::thread::sleep(self.clock.left(until).unwrap_or(Duration::ZERO));
                        None
                    }
                },
            },
        }
    }

    fn tick(&mut self, watcher: &mut dyn Watcher) -> Result<(), PlaybackError> {
        self.advance(&mut |dive| watcher.ticked(dive))?;
        if let Going::Ticks(left) = self.going {
            self.going = if left > 1 { Going::Ticks(left - 1) } else { Going::Still };
            if self.going == Going::Still {
                watcher.stands(self.dive, self.now, false);
            }
        }
        Ok(())
    }

    #[expect(
        clippy::disallowed_methods,
        reason = "where states are kept is for speed; no result depends on it"
    )]
    fn advance(&mut self, after_tick: &mut dyn FnMut(&Loop)) -> Result<(), PlaybackError> {
        let Some(until) = self.driver.due(self.player)? else { return Ok(()) };
        let (begun, before) = (Instant::now(), self.now);
        self.driver.tick(self.dive, self.player, after_tick)?;
        self.now = until;
        self.worked += begun.elapsed();
        if self.states.latest(until).is_some_and(|latest| latest > before) {
            self.worked = Duration::ZERO;
        } else if self.worked >= self.between {
            self.keep()?;
        }
        Ok(())
    }

    fn keep(&mut self) -> Result<(), PlaybackError> {
        self.worked = Duration::ZERO;
        Ok(self.states.keep(self.now, &self.player.place(), &self.dive.save()?)?)
    }

    fn grant(&mut self, wish: Wish, watcher: &mut dyn Watcher) -> Result<(), PlaybackError> {
        match wish {
            Wish::Pause => self.going = Going::Still,
            Wish::Go => self.going = Going::On,
            Wish::Step(ticks) => self.going = if ticks > 0 { Going::Ticks(ticks) } else { Going::Still },
            Wish::Speed(speed) => self.speed = speed,
            Wish::Seek(to) => self.seek(to, watcher)?,
            Wish::Skip(by) => self.seek(self.now + by, watcher)?,
            Wish::End => {}
        }
        if matches!(wish, Wish::Pause | Wish::Seek(_) | Wish::Skip(_)) {
            watcher.stands(self.dive, self.now, false);
        }
        self.clock = Clock::start(self.now, self.speed);
        Ok(())
    }

    /// Goes to the last tick that ends at or before a moment: from the nearest state before it, or from here.
    ///
    /// Errors: see [`PlaybackError`].
    pub fn seek(&mut self, to: MonoNs, watcher: &mut dyn Watcher) -> Result<(), PlaybackError> {
        let to = to.max(self.begun);
        let near = self.states.latest(to);
        if let Some(near) = near.filter(|near| to < self.now || *near > self.now) {
            let (place, snapshot) = self.states.take(near)?;
            self.dive.restore(&snapshot)?;
            self.player.go_to(&place)?;
            self.driver.jump_to(near);
            (self.now, self.worked) = (near, Duration::ZERO);
        }
        while self.driver.due(self.player)?.is_some_and(|until| until <= to) {
            self.advance(&mut |dive| watcher.passed(dive))?;
        }
        self.clock = Clock::start(self.now, self.speed);
        Ok(())
    }
}
