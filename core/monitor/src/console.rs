//! The console: a packet source after all sensors, for the operator's input and the program's own reports.
//!
//! A packet is one JSON object, a [`Command`]. Packets pass a ring and the merge, like a sensor's bytes. They
//! are recorded as `/raw/console`, so a replay has them at the same place. The console is not a sensor: it
//! has no status lamp, no readings, and no part in navigation.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use crossbeam::queue::ArrayQueue;

use super::notes::MOST_NOTES;
use super::ring::Port;
use super::run::Loop;
use headrace_geometry::time::{DurNs, MonoNs};

pub(crate) mod command;
pub(crate) mod packets;
mod text;

pub use command::{Command, CommandError, MAX_COMMAND_BYTES, MAX_NOTE_BYTES, MAX_STALL_S, NoteText, Who};
pub(super) use packets::Console;
pub use packets::ConsoleCounts;
pub use text::ShortText;

pub use headrace_vehicle::CONSOLE_ID;
/// Maximum number of commands that wait for the loop.
const MOST_WAITING: usize = 256;
/// Shortest time between two calls of `take_in_live` that counts as a stall of the computer.
const STALL: DurNs = DurNs(500_000_000);
/// Interval of [`Command::Time`] while no sensor delivers readings. The commands let the loop notice stale data.
const TIME_EVERY: DurNs = DurNs(500_000_000);

/// Reason for refusing a command at the console.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ConsoleError {
    /// Too many commands are waiting for the loop.
    #[error("sending a command to the loop: {MOST_WAITING} are waiting already; send it again")]
    Full,
    /// The dive already has as many notes as its report can hold.
    #[error(
        "sending a note to the loop: the dive has {MOST_NOTES} notes, and its report holds no more; further notes are refused"
    )]
    MostNotes,
}

/// Handle that accepts commands from any thread without blocking.
#[derive(Clone)]
pub struct ConsolePort {
    waiting: Arc<ArrayQueue<(Option<MonoNs>, Command)>>,
    clock: Option<Arc<TimestampClock>>,
    /// Number of notes accepted through all console ports.
    notes: Arc<AtomicUsize>,
}

/// Clock that gives the timestamps of a dive.
type TimestampClock = dyn Fn() -> MonoNs + Send + Sync;

impl ConsolePort {
    /// Hands a command to the loop, stamped with the dive's clock. The loop takes the command at the next tick.
    ///
    /// Errors: too many commands are waiting, or the report has no room for another note. The command is
    /// dropped.
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

/// The loop's side of all [`ConsolePort`]s. Between ticks it moves waiting commands into the console's ring.
pub struct ConsoleInput {
    waiting: Arc<ArrayQueue<(Option<MonoNs>, Command)>>,
    port: Port,
    time_sent: MonoNs,
    /// Time of the most recent call of `take_in_live`; `None` before the first call.
    called: Option<MonoNs>,
}

impl ConsoleInput {
    /// Console input of a dive with this clock; `None` if the loop's port has been taken already.
    ///
    /// Without a clock, commands are stamped when they are moved into the ring.
    pub fn new(dive: &mut Loop, clock: Option<Arc<TimestampClock>>) -> Option<(Self, ConsolePort)> {
        let port = dive.take_console()?;
        let waiting = Arc::new(ArrayQueue::new(MOST_WAITING));
        let input = Self { waiting: Arc::clone(&waiting), port, time_sent: MonoNs(0), called: None };
        Some((input, ConsolePort { waiting, clock, notes: Arc::default() }))
    }

    /// Moves waiting commands into the ring at `now`, for the next tick. A command keeps waiting if the ring is full.
    pub fn take_in(&mut self, now: MonoNs) {
        while self.port.has_room(MAX_COMMAND_BYTES) {
            let Some((at, command)) = self.waiting.pop() else { return };
            self.put(at.unwrap_or(now), &command);
        }
    }

    /// Moves waiting commands into the ring of a live dive. While no sensor delivers readings, also sends the
    /// time to the loop. The program calls it many times per second, so a long time between two calls is a stall.
    pub fn take_in_live(&mut self, dive: &Loop, now: MonoNs) {
        self.take_in(now);
        let idle = self.called.replace(now).map_or(DurNs(0), |called| now.since(called));
        if idle.0 >= STALL.0 && self.port.has_room(MAX_COMMAND_BYTES) {
            self.put(now, &Command::stalled_for(idle));
        }
        if self.time_sent == MonoNs(0) {
            self.time_sent = now;
        }
        let last = dive.view().live_state().heard.iter().flatten().max();
        let since = now.since(last.copied().unwrap_or(self.time_sent).max(self.time_sent));
        if since.0 >= TIME_EVERY.0 && self.port.has_room(MAX_COMMAND_BYTES) {
            self.time_sent = now;
            self.put(now, &Command::Time);
        }
    }

    fn put(&mut self, at: MonoNs, command: &Command) {
        let text = command.to_json();
        if let Err(error) = self.port.send(at, text.as_bytes()) {
            tracing::error!(%error, "sending a command to the loop failed; the command is lost");
        }
    }
}

#[cfg(test)]
mod tests;
