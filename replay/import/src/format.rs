//! How a kind of file is cut.

use crate::entry::{Clock, Entry, Step, Told};
use crate::order::WINDOW_NS;

/// Bytes of the file that are held at most: more than the longest entry of any format.
const MOST_HELD: usize = 1 << 20;

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
        WINDOW_NS
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
