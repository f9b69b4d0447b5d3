//! Interface of file formats. A format splits a file into entries.

use crate::entry::{Clock, Entry, ImportReport, Step};
use crate::order::WINDOW_NS;

/// Default limit for the bytes of a file held in memory. Entries longer than this limit are lost.
const MOST_HELD: usize = 1 << 20;

/// Splits a file of one kind into entries, without I/O. The caller supplies the bytes.
pub trait Format {
    /// Returns the epoch of the file's timestamps, as far as known from the bytes read.
    fn clock(&self) -> Clock;

    /// Returns the maximum length of an entry in files of this format, bytes.
    fn most_held(&self) -> usize {
        MOST_HELD
    }

    /// Returns how far entries may be out of time order, ns. An entry may come after entries whose timestamps are later
    /// than its own by up to this time.
    fn reach_ns(&self) -> u64 {
        WINDOW_NS
    }

    /// Returns the format's losses and remarks, at the end of the file.
    fn report(&self) -> ImportReport {
        ImportReport::default()
    }

    /// Parses the next bytes of the file, `front`, and adds entries to `out`.
    ///
    /// `end` tells that the file has no bytes after `front`.
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

    fn report(&self) -> ImportReport {
        (**self).report()
    }

    fn step(&mut self, front: &[u8], end: bool, out: &mut Vec<Entry>) -> Step {
        (**self).step(front, end, out)
    }
}
