//! Runs an armed loop. Ports, logs and the simulator differ only in their [`Feed`] of packets.

use super::run::Loop;
use headrace_geometry::time::MonoNs;

/// Packet source that fills the rings of a loop: ports, a log, or a simulation.
pub trait Feed {
    /// Type of the error that ends the feed.
    type Error;

    /// Waits for the next tick and fills the rings for it. Returns the end of the tick's time; `None` at the
    /// end of the feed.
    ///
    /// If a ring is full, [`work_off`] empties it.
    ///
    /// Errors: the feed can't continue. The loop has processed all packets fed until then.
    fn fill(
        &mut self,
        dive: &mut Loop,
        after_tick: &mut dyn FnMut(&Loop),
    ) -> Result<Option<MonoNs>, Self::Error>;

    /// Waits briefly, so that a lagging outlet can catch up.
    fn pause(&mut self);
}

/// Runs the loop until the feed ends, and calls `after_tick` with the loop after every tick.
///
/// Errors: those of the feed.
pub fn drive<F: Feed>(
    dive: &mut Loop,
    feed: &mut F,
    after_tick: &mut dyn FnMut(&Loop),
) -> Result<(), F::Error> {
    while let Some(now) = feed.fill(dive, after_tick)? {
        work_off(dive, now, after_tick, &mut || feed.pause());
    }
    Ok(())
}

/// Runs ticks, at least one, until the packet rings are empty.
///
/// A lagging outlet makes the loop hold packets back. `pause` then gives the outlet time.
pub fn work_off(dive: &mut Loop, now: MonoNs, after_tick: &mut dyn FnMut(&Loop), pause: &mut dyn FnMut()) {
    loop {
        let consumed = dive.tick(now);
        after_tick(dive);
        if !dive.has_waiting() {
            return;
        }
        if consumed == 0 {
            pause();
        }
    }
}
