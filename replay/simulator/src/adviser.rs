//! The adviser of a simulated pilot: a monitor that receives the messages of the vehicle's devices.

use crate::outbox::Message;
use crate::told::Told;

/// An on-board monitor whose advice the pilot gets.
pub trait Adviser: Send {
    /// Processes a message that has crossed its line. Messages come in order.
    fn hear(&mut self, message: &Message<'_>);

    /// The advice since the last call, in order of time.
    fn told(&mut self) -> Vec<Told>;
}
