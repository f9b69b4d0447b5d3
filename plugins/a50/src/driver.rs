//! The host's side of the connection: it listens.

use headrace_sensor::driver::{Carrier, Listener};
use headrace_sensor::geometry::time::DurNs;

use crate::report::{Lines, MAX_LINE_BYTES};

/// What may carry a device's lines.
pub const CARRIERS: [Carrier; 2] = [Carrier::Tcp, Carrier::Udp];

/// A line's characters follow one another.
const SILENCE: DurNs = DurNs::from_millis(200);
/// A device that hears no bottom still says so several times a second.
const PATIENCE: DurNs = DurNs::from_millis(5_000);

/// A device's driver.
pub fn listener() -> Listener<Lines, MAX_LINE_BYTES> {
    Listener::new(Lines, SILENCE, PATIENCE)
}
