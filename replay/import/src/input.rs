//! Input files of an import, each with the format that splits it into entries.

use std::io::Read;

use crate::entry::{Clock, Entry, ImportReport, Step};
use crate::error::ImportError;
use crate::format::Format;
use crate::losses::Losses;
use crate::order::Order;

/// Number of bytes read from the file at once.
pub(crate) const READ_BYTES: usize = 1 << 16;

/// A source of entries: either a file that a [`Format`] splits into entries, or a file with a reader of its own.
pub trait Source {
    /// Returns the name of the file.
    fn name(&self) -> &str;

    /// Adds the next entries to `order`. Returns `false` at the end of the file.
    ///
    /// Errors: reading the file fails.
    fn more(&mut self, order: &mut Order) -> Result<bool, ImportError>;

    /// Returns the epoch of the file's timestamps, as far as known from the bytes read.
    fn clock(&self) -> Clock;

    /// Returns how far entries may be out of time order, ns. See [`Format::reach_ns`].
    fn reach_ns(&self) -> u64;

    /// Returns the number of bytes read from the file so far.
    fn bytes(&self) -> u64;

    /// Returns losses and remarks of the import so far.
    fn report(&self) -> ImportReport;
}

/// A file, and the format that splits it into entries.
pub struct Input<R, F = Box<dyn Format>> {
    name: String,
    reader: R,
    pub(crate) format: F,
    pub(crate) held: Vec<u8>,
    /// Number of bytes at the start of the buffer that are already consumed.
    done: usize,
    /// Offset of the buffer's first byte in the file.
    offset: u64,
    end: bool,
    found: Vec<Entry>,
    pub(crate) losses: Losses,
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

    fn report(&self) -> ImportReport {
        let ImportReport { losses, remarks } = self.format.report();
        ImportReport { losses: [self.losses.words(), losses].concat(), remarks }
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
                self.losses.lost(at, left, "an entry longer than the memory limit");
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
    /// Creates an input from a file that hasn't been read yet.
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
