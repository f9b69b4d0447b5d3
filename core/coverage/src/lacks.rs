//! Lacks: places on the wall where a ping would have laid a sample, and why it didn't.
//!
//! With the lacks of a factor put back among the samples, a hole is what it would have been without that factor. The
//! latest are kept: fails are explained soon after their place has been left.

use serde::{Deserialize, Serialize};

use super::causes::Causes;
use headrace_snapshot::stateful;

/// Capacity: five minutes of four heads that all get nothing.
const ROOM: usize = 1 << 16;

/// A sample that is lacking.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Lack {
    /// Chainage at which it would lie, m.
    pub x_m: f64,
    /// Arc length, m.
    pub arc_m: f64,
    /// All that would have to be otherwise for it to be there.
    pub why: Causes,
}

/// The latest lacks.
#[derive(Debug)]
pub struct Lacks {
    ring: Vec<Lack>,
    /// Where the next one goes once the ring is full.
    next: u32,
}

stateful!(Lacks { state: next; lists: ring; });

impl Default for Lacks {
    /// Allocates: startup only; all that it will ever use.
    fn default() -> Self {
        Self { ring: Vec::with_capacity(ROOM), next: 0 }
    }
}

impl Lacks {
    /// Adds a lack, in place of the oldest where there is no room.
    ///
    /// Allocates: never.
    pub fn add(&mut self, lack: Lack) {
        if self.ring.len() < ROOM {
            self.ring.push(lack);
            return;
        }
        if let Some(oldest) = self.ring.get_mut(self.next as usize) {
            *oldest = lack;
        }
        self.next = if self.next as usize + 1 >= ROOM { 0 } else { self.next + 1 };
    }

    /// Those between two chainages, in no particular order.
    pub fn between(&self, from_m: f64, to_m: f64) -> impl Iterator<Item = &Lack> {
        self.ring.iter().filter(move |lack| (from_m..=to_m).contains(&lack.x_m))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cause::Cause;

    #[test]
    fn the_latest_are_kept() {
        let mut lacks = Lacks::default();
        let lack = |x_m: f64| Lack { x_m, arc_m: 1.0, why: Causes::of(Cause::HeadSilent) };
        for k in 0..2 * ROOM + 10 {
            lacks.add(lack(k as f64));
        }
        assert_eq!(lacks.between(0.0, f64::INFINITY).count(), ROOM);
        let first = (ROOM + 10) as f64;
        assert_eq!(lacks.between(0.0, first - 1.0).count(), 0);
        assert_eq!(lacks.between(first, first + 4.0).count(), 5);
    }
}
