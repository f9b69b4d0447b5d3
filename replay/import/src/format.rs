//! The interface of file formats, which split a file into entries.

use crate::entry::{Clock, Entry, Step, Told};
use crate::order::WINDOW_NS;

/// Maximum number of bytes of the file held in memory, more than the longest entry of any format.
const MOST_HELD: usize = 1 << 20;

/// Splits a kind of file into entries without I/O: it gets the front of the remaining file.
pub trait Format {
    /// Epoch of its timestamps, as far as known from the bytes read.
    fn clock(&self) -> Clock;

    /// Longest entry, bytes.
    fn most_held(&self) -> usize {
        MOST_HELD
    }

    /// Longest time by which an entry may follow entries with later timestamps, ns.
    fn reach_ns(&self) -> u64 {
        WINDOW_NS
    }

    /// Its report at the end.
    fn told(&self) -> Told {
        Told::default()
    }

    /// Parses the front; entries go to `out`. `end` means that nothing follows.
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
