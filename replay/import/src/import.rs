//! Imports a foreign log.
//!
//! Entries are put in time order, moved to the log's clock, and routed to the sensors that would have received them.

use std::io::{Read, Write};

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_replay::log::LogWriter;

use crate::entry::Clock;
use crate::error::ImportError;
use crate::format::Format;
use crate::input::{Input, Source};
use crate::losses::Losses;
use crate::order::Order;
use crate::routing::Taker;

/// Log time of a file's first entry. Simulated dives begin at the same log time.
pub const BEGIN: MonoNs = MonoNs(1_000_000_000);

/// Longest plausible gap between timestamps of a file. A longer gap means that the clock was set, or the file has
/// several recordings.
const LONGEST_GAP: DurNs = DurNs(3_600_000_000_000);

/// A foreign log that is being imported.
pub struct Import<S> {
    pub(crate) input: S,
    pub(crate) order: Order,
    /// Timestamp of the file that corresponds to the log time [`BEGIN`].
    first_ns: u64,
    clock: Clock,
}

/// Result of importing a foreign log.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Imported {
    /// Number of entries in the foreign log.
    pub entries: u64,
    /// Number of entries for no sensor: their connection is unassigned, or no sensor takes their content.
    pub passed_over: u64,
    /// Number of messages written for each source of the log.
    pub messages: Vec<u64>,
    /// Latest log time of the messages written.
    pub last: MonoNs,
    /// Losses of the import, as text.
    pub losses: Vec<String>,
    /// Remarks on the import that aren't losses, as text.
    pub remarks: Vec<String>,
}

impl<R: Read> Import<Input<R>> {
    /// Opens a file, and reads until its start time is known. `what` names an entry of the file in error texts.
    ///
    /// Errors: the file can't be read, or has no entry.
    pub fn open(
        name: &str,
        reader: R,
        format: Box<dyn Format>,
        what: &'static str,
    ) -> Result<Self, ImportError> {
        Self::of(Input::new(name, reader, format), what)
    }
}

impl<S: Source> Import<S> {
    /// Opens a source of entries, and reads until its start time is known. `what` names an entry in error texts.
    ///
    /// Errors: the source can't be read, or has no entry.
    pub fn of(mut input: S, what: &'static str) -> Result<Self, ImportError> {
        let mut order = Order::reaching(input.reach_ns());
        while !order.is_full() && input.more(&mut order)? {}
        let Some(first_ns) = order.first_ns() else {
            let why =
                input.report().losses.into_iter().next().map_or(String::new(), |why| format!("; {why}"));
            return Err(ImportError::Nothing {
                name: input.name().to_owned(),
                what,
                bytes: input.bytes(),
                why,
            });
        };
        let clock = input.clock();
        Ok(Self { input, order, first_ns, clock })
    }

    /// Returns metadata for the log: the epoch of the file's clock, and the time on this clock at the log's start.
    pub fn clock_metadata(&self) -> Vec<(String, String)> {
        let mut all = vec![("import_clock".to_owned(), self.clock.as_str().to_owned())];
        if self.clock == Clock::Utc {
            all.push(("clock_anchor_monotonic_ns".to_owned(), BEGIN.0.to_string()));
            all.push(("clock_anchor_utc_ns".to_owned(), self.first_ns.to_string()));
        } else {
            all.push(("import_clock_first_ns".to_owned(), self.first_ns.to_string()));
        }
        all
    }

    /// Writes to the log everything that the sensors would have received.
    ///
    /// Calls `beside` after each entry with the number of entries written so far.
    ///
    /// Errors: reading the file or writing the log fails.
    pub fn write<W: Write>(
        mut self,
        log: &mut LogWriter<W>,
        takers: &mut [Taker],
        beside: &mut dyn FnMut(u64),
    ) -> Result<Imported, ImportError> {
        let sources = takers.iter().map(|taker| usize::from(taker.source) + 1).max().unwrap_or(0);
        let mut imported = Imported { messages: vec![0; sources], last: BEGIN, ..Imported::default() };
        let mut before_ns = self.first_ns;
        let mut losses = Losses::default();
        loop {
            while !self.order.is_full() && self.input.more(&mut self.order)? {}
            let Some(entry) = self.order.pop() else { break };
            let at = BEGIN + DurNs(i64::try_from(entry.stamp_ns - self.first_ns).unwrap_or(i64::MAX / 2));
            if entry.stamp_ns - before_ns > LONGEST_GAP.0.unsigned_abs() {
                losses.gap(entry.stamp_ns - before_ns, at);
            }
            before_ns = entry.stamp_ns;
            imported.entries += 1;
            beside(imported.entries);
            let mut taken = false;
            for taker in takers.iter_mut().filter(|taker| taker.listens_to(&entry.stream)) {
                for (received, bytes) in taker.take(at, entry.bytes.as_slice()) {
                    log.raw(taker.source, received, received, &bytes)?;
                    taken = true;
                    if let Some(count) = imported.messages.get_mut(usize::from(taker.source)) {
                        *count += 1;
                    }
                    imported.last = imported.last.max(received);
                }
            }
            imported.passed_over += u64::from(!taken);
        }
        losses.late(self.order.late());
        let report = self.input.report();
        imported.losses = [report.losses, losses.words()].concat();
        imported.remarks = report.remarks;
        Ok(imported)
    }
}
