//! A driver that waits longer for a device on a pseudoterminal. Bytes on one are passed on by a thread of the kernel that a busy machine
//! leaves standing: with four busy loops on two cores it was seen ready and not running for up to 16 s.

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::driver::{DeviceHealth, Driver, Wire};

/// Longer than a pseudoterminal stands still.
const SILENCE_TIMEOUT: DurNs = DurNs::from_millis(120_000);

/// All as the driver within but for the time after which silence means a dead line.
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
