//! The adviser of a simulated pilot: a monitor that receives the messages of the vehicle's devices.

use crate::outbox::Message;
use crate::pilot_advice::PilotAdvice;

/// An on-board monitor whose advice the simulated pilot follows.
pub trait Adviser: Send {
    /// Processes a message that has crossed its line. Messages must be passed in order of time.
    fn hear(&mut self, message: &Message<'_>);

    /// The advice since the last call, in order of time.
    fn told(&mut self) -> Vec<PilotAdvice>;
}
