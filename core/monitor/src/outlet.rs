//! Outlets: readers of each tick's results, such as a log recorder.

use super::view::DiveView;

/// A reader of each tick's results, on the loop's thread.
pub trait Outlet: Send {
    /// Publishes the results of the last tick.
    ///
    /// Returns the number of bytes of packets that the next tick may consume: [`MAX_TICK_BYTES`] if the
    /// outlet has room for a tick of any size. With several outlets the least number counts. Must not
    /// allocate.
    ///
    /// [`MAX_TICK_BYTES`]: super::merge::MAX_TICK_BYTES
    fn publish(&mut self, dive: &DiveView<'_>) -> usize;
}
