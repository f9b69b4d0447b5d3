//! A driver with a longer silence timeout, for devices on a pseudoterminal.
//!
//! A kernel thread moves the bytes of a pseudoterminal. On a busy machine this thread can wait long for CPU time. The
//! wait was up to 16 s with four busy loops on two cores.

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::driver::{DeviceHealth, Driver, Wire};

/// Silence timeout that is longer than any stall of a pseudoterminal.
const SILENCE_TIMEOUT: DurNs = DurNs::from_millis(120_000);

/// A driver that wraps another driver, and differs from it only in the silence timeout.
pub(crate) struct Patient(pub(crate) Box<dyn Driver>);

impl Driver for Patient {
    fn opened(&mut self, now: MonoNs, wire: &mut dyn Wire) {
        self.0.opened(now, wire);
    }

    fn closed(&mut self, wire: &mut dyn Wire) {
        self.0.closed(wire);
    }

    fn heard(&mut self, received: MonoNs, bytes: &[u8], wire: &mut dyn Wire) {
        self.0.heard(received, bytes, wire);
    }

    fn accepts(&self, bytes: &[u8]) -> bool {
        self.0.accepts(bytes)
    }

    fn due(&self) -> Option<MonoNs> {
        self.0.due()
    }

    fn wake(&mut self, now: MonoNs, wire: &mut dyn Wire) {
        self.0.wake(now, wire);
    }

    fn awaits(&self) -> bool {
        self.0.awaits()
    }

    fn silence_timeout(&self) -> DurNs {
        SILENCE_TIMEOUT
    }

    fn health(&self) -> DeviceHealth {
        self.0.health()
    }
}
