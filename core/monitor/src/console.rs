//! The operator's input, and what the program itself reports: a source of packets after all sensors.
//!
//! A packet is one JSON object, a [`Command`]. It goes through a ring and the merge like a sensor's bytes and is recorded as
//! `/raw/console`, so that a replay has it where it was. It is no sensor: it has no lamp, no readings, and no place in navigation.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use crossbeam::queue::ArrayQueue;

use super::notes::MOST_NOTES;
use super::ring::Port;
use super::run::Loop;
use headrace_geometry::time::{DurNs, MonoNs};

mod command;
mod packets;
mod text;

pub use command::{Command, CommandError, MAX_COMMAND_BYTES, MAX_NOTE_BYTES, NoteText, Who};
pub use packets::ConsoleCounts;
pub(super) use packets::{Commands, Console, ReceivedCommand};
pub use text::ShortText;

pub use headrace_vehicle::CONSOLE_ID;
/// Commands that wait for the loop at most.
const MOST_WAITING: usize = 256;
/// While no sensor speaks, the time is told this often, so that what grows old is found.
const TIME_EVERY: DurNs = DurNs(500_000_000);

/// Why a command isn't taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ConsoleError {
    /// Too many wait.
    #[error("sending a command to the loop: {MOST_WAITING} are waiting already; send it again")]
    Full,
    /// The dive has all notes that its report holds.
    #[error(
        "sending a note to the loop: the dive has {MOST_NOTES} notes, and its report holds no more; none is taken from now on"
    )]
    MostNotes,
}

/// Takes commands from any thread; never blocks.
#[derive(Clone)]
pub struct ConsolePort {
    waiting: Arc<ArrayQueue<(Option<MonoNs>, Command)>>,
    clock: Option<Arc<DiveClock>>,
    /// Notes that all ports have taken.
    notes: Arc<AtomicUsize>,
}

/// The clock of a dive's timestamps.
type DiveClock = dyn Fn() -> MonoNs + Send + Sync;

impl ConsolePort {
    /// Hands a command to the loop, stamped with the dive's clock. The loop takes it at its next tick.
    ///
    /// Errors: too many wait, or the report has no room for a further note; the command was not taken.
    pub fn send(&self, command: &Command) -> Result<(), ConsoleError> {
        let is_note = matches!(command, Command::Note { .. } | Command::Voice { .. });
        let one_more = |notes| (notes < MOST_NOTES).then_some(notes + 1);
        if is_note && self.notes.fetch_update(Ordering::Relaxed, Ordering::Relaxed, one_more).is_err() {
            return Err(ConsoleError::MostNotes);
        }
        let sent = self.waiting.push((self.clock.as_ref().map(|clock| clock()), *command));
        if is_note && sent.is_err() {
            self.notes.fetch_sub(1, Ordering::Relaxed);
        }
        sent.map_err(|_| ConsoleError::Full)
    }
}

impl core::fmt::Debug for ConsolePort {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "ConsolePort({} waiting)", self.waiting.len())
    }
}

/// The loop's side of [`ConsolePort`]s: moves what waits into the source's ring, between ticks.
pub struct ConsoleInput {
    waiting: Arc<ArrayQueue<(Option<MonoNs>, Command)>>,
    port: Port,
    time_told: MonoNs,
}

impl ConsoleInput {
    /// For a dive whose clock is `clock`; without one, commands are stamped with the time at which they are taken. `None` if the
    /// loop's port has been taken already.
    pub fn new(dive: &mut Loop, clock: Option<Arc<DiveClock>>) -> Option<(Self, ConsolePort)> {
        let port = dive.take_console()?;
        let waiting = Arc::new(ArrayQueue::new(MOST_WAITING));
        let input = Self { waiting: Arc::clone(&waiting), port, time_told: MonoNs(0) };
        Some((input, ConsolePort { waiting, clock, notes: Arc::default() }))
    }

    /// Moves what waits into the ring, for the next tick, at `now`; what finds no room goes on waiting.
    pub fn take_in(&mut self, now: MonoNs) {
        while self.port.has_room(MAX_COMMAND_BYTES) {
            let Some((at, command)) = self.waiting.pop() else { return };
            self.put(at.unwrap_or(now), &command);
        }
    }

    /// The same, in a dive on ports: while no sensor speaks, tells the loop what time it is now.
    pub fn take_in_live(&mut self, dive: &Loop, now: MonoNs) {
        self.take_in(now);
        let Some((_, last)) = dive.tally().span else { return };
        let since = now.since(last.max(self.time_told));
        if since.0 >= TIME_EVERY.0 && self.port.has_room(MAX_COMMAND_BYTES) {
            self.time_told = now;
            self.put(now, &Command::Time);
        }
    }

    fn put(&mut self, at: MonoNs, command: &Command) {
        let text = command.to_json();
        if let Err(error) = self.port.send(at, text.as_bytes()) {
            tracing::error!(%error, "a command could not be handed to the loop");
        }
    }
}

#[cfg(test)]
mod tests;
