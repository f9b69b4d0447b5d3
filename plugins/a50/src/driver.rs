//! Host side of the connection: it only listens.

use headrace_sensor::driver::{Carrier, Listener};
use headrace_sensor::geometry::time::DurNs;

use crate::report::{Lines, MAX_LINE_BYTES};

/// Supported carriers.
pub const CARRIERS: [Carrier; 2] = [Carrier::Tcp, Carrier::Udp];

/// Longest usual gap within a line.
const SILENCE: DurNs = DurNs::from_millis(200);
/// Silence timeout: without bottom lock the device still reports several times a second.
const PATIENCE: DurNs = DurNs::from_millis(5_000);

/// Driver of an A50.
pub fn listener() -> Listener<Lines, MAX_LINE_BYTES> {
    Listener::new(Lines, SILENCE, PATIENCE)
}
