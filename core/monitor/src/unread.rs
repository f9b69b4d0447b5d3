//! Packets that gave no reading, and the readings in them that were withheld.

use headrace_geometry::time::MonoNs;
use headrace_sensor::reading::SourceId;
use headrace_sensor::withheld::WithheldReason;
use serde::{Deserialize, Serialize};

/// A packet that gave no reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UnreadPacket {
    /// Index of the tick's first reading after the packet.
    pub before: usize,
    /// Source that delivered the packet.
    pub source: SourceId,
    /// Receive time of the packet.
    pub received: MonoNs,
    /// Number of readings in the packet that were withheld.
    pub withheld: u32,
    /// Reason for which there is no reading.
    pub reason: WithheldReason,
}

/// Readings of a sensor that were withheld, and why.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct WithheldReadings {
    /// Number of withheld readings. For the reason [`WithheldReason::NoMessage`]: number of packets.
    pub count: u32,
    /// Reason for the last one.
    pub reason: WithheldReason,
}

/// Packets of a sensor since its last reading.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct UnreadSpan {
    /// Receive times of the first and last packet.
    pub(crate) from: MonoNs,
    pub(crate) to: MonoNs,
    pub(crate) readings: WithheldReadings,
}

impl UnreadSpan {
    /// Adds a packet to the packets `before` it.
    pub(crate) fn after(before: Option<Self>, packet: &UnreadPacket) -> Self {
        let nothing = WithheldReadings { count: 0, reason: WithheldReason::NoMessage };
        let (from, so_far) = before.map_or((packet.received, nothing), |span| (span.from, span.readings));
        let is_first = so_far.reason == WithheldReason::NoMessage;
        let readings = match packet.withheld {
            0 if is_first => WithheldReadings { count: so_far.count.saturating_add(1), ..so_far },
            0 => so_far,
            count if is_first && packet.reason != WithheldReason::NoMessage => {
                WithheldReadings { count, reason: packet.reason }
            }
            more => WithheldReadings { count: so_far.count.saturating_add(more), reason: packet.reason },
        };
        Self { from, to: packet.received, readings }
    }
}
