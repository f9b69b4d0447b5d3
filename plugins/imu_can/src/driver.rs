//! Driver of an inertial unit, which only listens to the CAN bus.

use headrace_sensor::driver::{Carrier, MessageListener};
use headrace_sensor::geometry::time::DurNs;

use crate::frame::{CanFrame, FRAME_BYTES};

/// Carriers over which an inertial unit can be connected. Each frame is a `can_frame` of 16 bytes.
pub const CARRIERS: [Carrier; 2] = [Carrier::Can, Carrier::Udp];

const PATIENCE: DurNs = DurNs::from_millis(5_000);

/// Driver of an inertial unit.
pub fn listener() -> MessageListener {
    MessageListener::new(Box::new(judge), PATIENCE)
}

fn judge(message: &[u8]) -> Option<String> {
    let Some(frame) = message.first_chunk::<FRAME_BYTES>().filter(|_| message.len() == FRAME_BYTES) else {
        return Some(format!("received a message of {} bytes; a frame has {FRAME_BYTES}", message.len()));
    };
    CanFrame::decode(frame).err().map(|error| error.to_string())
}
