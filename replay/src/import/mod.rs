//! Foreign logs become ours: a file is cut into entries, these are put in order of time and handed to the sensors that
//! would have heard them.
//!
//! A [`Format`] knows how a kind of file is cut, without I/O. [`Import`] reads, keeps what it holds bounded, moves the file's
//! own times to a clock that begins at [`BEGIN`], and counts what is lost. A [`Taker`] is a sensor of the vehicle file.

#![cfg_attr(not(test), warn(clippy::indexing_slicing))]

pub mod candump;
pub mod csv;
pub mod detect;
mod emulated;
mod losses;
mod order;
pub mod ros;
mod taker;

#[cfg(test)]
mod tests;

use std::io::{Read, Write};

use headrace_geometry::time::{DurNs, MonoNs};

use crate::log::{LogError, LogWriter};

use losses::Losses;
pub use taker::Taker;

pub use order::Order;

/// Log time of a file's first entry, as that of a simulation.
pub const BEGIN: MonoNs = crate::simulate::START;

/// Bytes of the file that are held at most: more than the longest entry of any format.
const MOST_HELD: usize = 1 << 20;
/// Bytes that are read at a time.
const READ_BYTES: usize = 1 << 16;
/// Times that go on by more than this were not of one recording, or somebody set the clock.
const LONGEST_GAP: DurNs = DurNs(3_600_000_000_000);

/// What a file says was on a line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entry {
    /// When, in nanoseconds of the file's own clock.
    pub stamp_ns: u64,
    /// Which line, by the name that the format gives it: a CAN interface, for instance.
    pub stream: String,
    /// The bytes as the device sent them.
    pub bytes: Vec<u8>,
}

/// What stands at the front of the rest of a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Step {
    /// Entries, or what carries none, in so many bytes.
    Took(usize),
    /// So many bytes that are lost, and why.
    Lost(usize, &'static str),
    /// Not known without more bytes; at the file's end, an entry that is cut off.
    More,
    /// What stands at the front has more entries: none of its bytes is done with.
    Held,
}

/// What a format says at the end besides its bytes, in words.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Told {
    /// What was lost.
    pub losses: Vec<String>,
    /// What is no loss, and should be known all the same.
    pub remarks: Vec<String>,
}

/// What a format's times count from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Clock {
    /// 1970, UTC.
    Utc,
    /// 1970, in the unknown time zone of the machine that wrote the file.
    Local,
    /// Something of its own.
    Own,
}

impl Clock {
    /// Its name in the log's metadata.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Utc => "utc",
            Self::Local => "local",
            Self::Own => "own",
        }
    }
}

/// How a kind of file is cut into entries. Sans-I/O: it gets the front of what is left of the file.
pub trait Format {
    /// What its times count from, as far as has been read.
    fn clock(&self) -> Clock;

    /// Longest entry, bytes.
    fn most_held(&self) -> usize {
        MOST_HELD
    }

    /// How long before the latest entry one may be that comes later, ns.
    fn reach_ns(&self) -> u64 {
        order::WINDOW_NS
    }

    /// What it has to say at the end.
    fn told(&self) -> Told {
        Told::default()
    }

    /// What stands at the front; `out` gets the entries. `end` says that nothing follows.
    fn step(&mut self, front: &[u8], end: bool, out: &mut Vec<Entry>) -> Step;
}

impl Format for Box<dyn Format> {
    fn clock(&self) -> Clock {
        (**self).clock()
    }

    fn most_held(&self) -> usize {
        (**self).most_held()
    }

    fn reach_ns(&self) -> u64 {
        (**self).reach_ns()
    }

    fn told(&self) -> Told {
        (**self).told()
    }

    fn step(&mut self, front: &[u8], end: bool, out: &mut Vec<Entry>) -> Step {
        (**self).step(front, end, out)
    }
}

/// Where entries come from: a file that a [`Format`] cuts, or one that another reader reads.
pub trait Source {
    /// The file.
    fn name(&self) -> &str;

    /// Puts the next entries in order. `false` at the end.
    ///
    /// Errors: the file can't be read on.
    fn more(&mut self, order: &mut Order) -> Result<bool, ImportError>;

    /// What its times count from, as far as has been read.
    fn clock(&self) -> Clock;

    /// How long before the latest entry one may be that comes later, ns.
    fn reach_ns(&self) -> u64;

    /// Bytes that have been read.
    fn bytes(&self) -> u64;

    /// What was lost so far, and what else should be known.
    fn told(&self) -> Told;
}

/// Why a file can't be imported.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// The medium failed.
    #[error("reading {name} at byte {offset}: {source}")]
    Read {
        /// The file.
        name: String,
        /// Where.
        offset: u64,
        /// Why.
        source: std::io::Error,
    },
    /// Nothing in it that could be imported.
    #[error("importing {name}: there is no {what} in its {bytes} bytes{why}")]
    Nothing {
        /// The file.
        name: String,
        /// What was looked for.
        what: &'static str,
        /// Length of the file.
        bytes: u64,
        /// What was found in place, or empty.
        why: String,
    },
    /// No bag that is known.
    #[error("importing {name}: a ROS bag begins with \"#ROSBAG V2.0\", this file with {found:?}")]
    NoBag {
        /// The file.
        name: String,
        /// Its first bytes.
        found: String,
    },
    /// A log of ours.
    #[error("importing {name}: it is a dive log already; `headrace replay` reads it as it is")]
    DiveLog {
        /// The file.
        name: String,
    },
    /// The log can't be written, or the recording not be read.
    #[error(transparent)]
    Log(#[from] LogError),
}

/// A file that is being imported.
pub struct Import<S> {
    input: S,
    order: Order,
    /// The stamp that becomes [`BEGIN`].
    first_ns: u64,
    clock: Clock,
}

/// What has come of an import.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Imported {
    /// Entries of the file.
    pub entries: u64,
    /// Entries that no sensor takes: other parts, other lines.
    pub passed_over: u64,
    /// Messages written, for each source of the log.
    pub messages: Vec<u64>,
    /// Log time of the last message.
    pub last: MonoNs,
    /// What was lost, in words.
    pub losses: Vec<String>,
    /// What is no loss, and should be known all the same.
    pub remarks: Vec<String>,
}

/// A file and the format that cuts it.
pub struct Input<R, F = Box<dyn Format>> {
    name: String,
    reader: R,
    format: F,
    held: Vec<u8>,
    /// Of what is held, how much is done with.
    done: usize,
    /// Place in the file of the first byte that is held.
    offset: u64,
    end: bool,
    found: Vec<Entry>,
    losses: Losses,
}

impl<R: Read> Import<Input<R>> {
    /// Reads as far as it takes to know when the file begins. `what` is what its entries are called.
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
    /// Reads as far as it takes to know when the recording begins. `what` is what its entries are called.
    ///
    /// Errors: it can't be read, or has no entry.
    pub fn of(mut input: S, what: &'static str) -> Result<Self, ImportError> {
        let mut order = Order::reaching(input.reach_ns());
        while !order.is_full() && input.more(&mut order)? {}
        let Some(first_ns) = order.first_ns() else {
            let why = input.told().losses.into_iter().next().map_or(String::new(), |why| format!("; {why}"));
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

    /// What the log's metadata say of its clock: where it comes from and, where that is known, what time of day it was.
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

    /// Writes all that the sensors would have heard. `beside` learns how many entries there have been.
    ///
    /// Errors: the file can't be read on, or the log not be written.
    pub fn write<W: Write>(
        mut self,
        log: &mut LogWriter<W>,
        takers: &mut [Taker],
        beside: &mut dyn FnMut(u64),
    ) -> Result<Imported, ImportError> {
        tracing::info!(file = self.input.name(), clock = self.clock.as_str(), "import started");
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
        let told = self.input.told();
        imported.losses = [told.losses, losses.words()].concat();
        imported.remarks = told.remarks;
        let Imported { entries, passed_over, .. } = imported;
        tracing::info!(entries, passed_over, losses = imported.losses.len(), "import finished");
        Ok(imported)
    }
}

impl<R: Read, F: Format> Source for Input<R, F> {
    fn name(&self) -> &str {
        &self.name
    }

    fn clock(&self) -> Clock {
        self.format.clock()
    }

    fn reach_ns(&self) -> u64 {
        self.format.reach_ns()
    }

    fn bytes(&self) -> u64 {
        self.offset + self.done as u64
    }

    fn told(&self) -> Told {
        let Told { losses, remarks } = self.format.told();
        Told { losses: [self.losses.words(), losses].concat(), remarks }
    }

    fn more(&mut self, order: &mut Order) -> Result<bool, ImportError> {
        let front = self.held.get(self.done..).unwrap_or_default();
        if front.is_empty() && self.end {
            return Ok(false);
        }
        let at = self.offset + self.done as u64;
        let step =
            if front.is_empty() { Step::More } else { self.format.step(front, self.end, &mut self.found) };
        let left = front.len();
        match step {
            Step::Took(bytes) => self.done += bytes.clamp(1, left),
            Step::Lost(bytes, why) => {
                let bytes = bytes.clamp(1, left);
                self.losses.lost(at, bytes, why);
                self.done += bytes;
            }
            Step::More if self.end => {
                self.losses.cut_off(at, left);
                self.done += left;
            }
            Step::Held => (),
            Step::More if left >= self.format.most_held() => {
                self.losses.lost(at, left, "no end of an entry within what can be held");
                self.done += left;
            }
            Step::More => self.read()?,
        }
        for entry in self.found.drain(..) {
            order.push(entry);
        }
        Ok(true)
    }
}

impl<R: Read, F: Format> Input<R, F> {
    /// A file that nothing has been read of.
    pub fn new(name: &str, reader: R, format: F) -> Self {
        Self {
            name: name.to_owned(),
            reader,
            format,
            held: Vec::new(),
            done: 0,
            offset: 0,
            end: false,
            found: Vec::new(),
            losses: Losses::default(),
        }
    }

    fn read(&mut self) -> Result<(), ImportError> {
        self.held.drain(..self.done);
        self.offset += self.done as u64;
        self.done = 0;
        let mut part = (&mut self.reader).take(READ_BYTES as u64);
        let read = part.read_to_end(&mut self.held).map_err(|source| ImportError::Read {
            name: self.name.clone(),
            offset: self.offset + self.held.len() as u64,
            source,
        })?;
        self.end = read < READ_BYTES;
        Ok(())
    }
}
