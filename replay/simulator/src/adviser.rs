//! Who advises a simulated pilot: a monitor that hears what the vehicle's devices send.

use crate::outbox::Message;
use crate::told::Told;

/// A monitor on board, heard by the pilot.
pub trait Adviser: Send {
    /// Takes a message that has crossed its line; messages come in order.
    fn hear(&mut self, message: &Message<'_>);

    /// What has been told since the last call, in order of time.
    fn told(&mut self) -> Vec<Told>;
}
