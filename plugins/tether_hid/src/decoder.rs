//! Reports and lines to readings of cable length.

use headrace_core::app::device::Decoder;
use headrace_core::app::reading::{Decoded, Packet, Reading, TetherLength};
use headrace_core::codec::{Codec as _, CodecCounts};
use headrace_core::time::{DurNs, MonoNs};

use crate::line::LineCodec;
use crate::report::{LayoutError, ReportCodec, ReportLayout};
use crate::tracker::{CountTracker, Counting, TrackerHealth};

/// How a HID counter is to be understood.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Counter {
    /// Where things stand in its reports.
    pub layout: ReportLayout,
    /// Whether it counts from its zero or from report to report.
    pub counting: Counting,
    /// Counts for a metre of cable; below zero where the count falls as cable is paid out.
    pub counts_per_metre: f64,
    /// The fastest that the winch can be, m/s.
    pub max_speed_mps: f64,
    /// From validity to receive time.
    pub latency: DurNs,
}

/// Reports to readings.
#[derive(Debug, Clone)]
pub struct HidDecoder {
    codec: ReportCodec,
    tracker: CountTracker,
    counter: Counter,
    status: Option<u8>,
}

/// Lines to readings.
#[derive(Debug, Clone)]
pub struct LineDecoder {
    codec: LineCodec,
    metres_per_unit: f64,
    latency: DurNs,
    /// When the bytes came that the codec holds for an unfinished line.
    held_since: MonoNs,
}

impl HidDecoder {
    /// A decoder that has seen no report yet.
    ///
    /// Errors: the layout can't be.
    pub fn new(counter: Counter) -> Result<Self, LayoutError> {
        let max_counts_per_s = counter.max_speed_mps * counter.counts_per_metre.abs();
        Ok(Self {
            codec: ReportCodec::new(counter.layout)?,
            tracker: CountTracker::new(counter.counting, counter.layout.width, max_counts_per_s),
            counter,
            status: None,
        })
    }

    /// Reports rejected and lost, and whether the length's zero is still sure.
    pub fn health(&self) -> TrackerHealth {
        self.tracker.health()
    }

    /// The last report's status byte, where the layout has one; its meaning is the device's own.
    pub fn status(&self) -> Option<u8> {
        self.status
    }
}

impl Decoder for HidDecoder {
    fn decode(&mut self, packet: Packet<'_>, sink: &mut dyn FnMut(Decoded)) {
        let Self { codec, tracker, counter, status } = self;
        let mut take = |report: crate::report::Report| {
            *status = report.status;
            let Some(counts) = tracker.take(packet.received, &report) else { return };
            let length = TetherLength {
                length_m: counts as f64 / counter.counts_per_metre,
                resolution_m: 1.0 / counter.counts_per_metre.abs(),
            };
            sink(Decoded {
                valid_at: packet.received - counter.latency,
                reading: Reading::TetherLength(length),
            });
        };
        codec.push(packet.bytes, &mut take);
        codec.flush(&mut take);
    }

    fn counts(&self) -> CodecCounts {
        self.codec.counts()
    }
}

impl LineDecoder {
    /// A decoder of lines whose payout is in units of `metres_per_unit`.
    pub fn new(metres_per_unit: f64, latency: DurNs) -> Self {
        Self { codec: LineCodec::default(), metres_per_unit, latency, held_since: MonoNs::default() }
    }
}

impl Decoder for LineDecoder {
    fn decode(&mut self, packet: Packet<'_>, sink: &mut dyn FnMut(Decoded)) {
        let Self { codec, metres_per_unit, latency, held_since } = self;
        // Only the first line that is completed can have begun in an earlier packet.
        let mut begun = if codec.held_bytes() > 0 { *held_since } else { packet.received };
        codec.push(packet.bytes, &mut |line| {
            let length = TetherLength {
                length_m: line.payout.value() * *metres_per_unit,
                resolution_m: line.payout.quantum() * *metres_per_unit,
            };
            sink(Decoded { valid_at: begun - *latency, reading: Reading::TetherLength(length) });
            begun = packet.received;
        });
        if codec.held_bytes() <= packet.bytes.len() {
            *held_since = packet.received;
        }
    }

    fn counts(&self) -> CodecCounts {
        self.codec.counts()
    }
}
