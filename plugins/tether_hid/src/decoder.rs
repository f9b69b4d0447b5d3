//! Reports and lines to readings of cable length.

use headrace_sensor::codec::{Codec as _, CodecCounts, Framing as _, LineClock};
use headrace_sensor::device::Decoder;
use headrace_sensor::device_clock::{ClockReport, DeviceClock};
use headrace_sensor::geometry::time::DurNs;
use headrace_sensor::reading::{Decoded, Packet, Reading, TetherLength};
use headrace_sensor::stateful;

use crate::line::{LineCodec, Lines};
use crate::report::{LayoutError, Report, ReportCodec, ReportLayout};
use crate::tracker::{CountTracker, Counting, TrackerHealth};

/// A line's characters follow one another; after such a pause no more belong to the one begun.
const SILENCE: DurNs = DurNs::from_millis(100);

const MILLISECOND: DurNs = DurNs::from_millis(1);

/// How a HID counter is to be understood.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Counter {
    /// Where things stand in its reports.
    pub layout: ReportLayout,
    /// Whether the auxiliary value is the device's time in milliseconds.
    pub auxiliary_is_ms: bool,
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
    clock: Option<DeviceClock>,
    status: Option<u8>,
}

stateful!(HidDecoder { state: codec, tracker, clock, status; fixed: counter; });

/// Lines to readings.
#[derive(Debug, Clone)]
pub struct LineDecoder {
    codec: LineCodec,
    clock: LineClock,
    metres_per_unit: f64,
    latency: DurNs,
}

stateful!(LineDecoder { state: codec, clock; fixed: metres_per_unit, latency; });

impl HidDecoder {
    /// A decoder that has seen no report yet.
    ///
    /// Errors: the layout can't be.
    pub fn new(counter: Counter) -> Result<Self, LayoutError> {
        counter.layout.check()?;
        let max_counts_per_s = counter.max_speed_mps * counter.counts_per_metre.abs();
        Ok(Self {
            codec: ReportCodec::new(counter.layout),
            tracker: CountTracker::new(counter.counting, counter.layout.width, max_counts_per_s),
            counter,
            clock: counter.auxiliary_is_ms.then(|| DeviceClock::new(u32::BITS, MILLISECOND)),
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
        let Self { codec, tracker, counter, clock, status } = self;
        let mut take = |report: Report| {
            *status = report.status;
            if let (Some(clock), Some(ms)) = (&mut *clock, report.auxiliary) {
                clock.take(u64::from(ms.cast_unsigned()), packet.received);
            }
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

    /// Reports rejected as faster than the winch.
    fn withheld(&self) -> u64 {
        self.health().rejected
    }

    fn clock(&self) -> Option<ClockReport> {
        self.clock.as_ref().map(DeviceClock::report)
    }
}

impl LineDecoder {
    /// A decoder of lines whose payout is in units of `metres_per_unit`.
    pub fn new(metres_per_unit: f64, latency: DurNs) -> Self {
        Self { codec: LineCodec::default(), clock: LineClock::new(SILENCE), metres_per_unit, latency }
    }
}

impl Decoder for LineDecoder {
    fn decode(&mut self, packet: Packet<'_>, sink: &mut dyn FnMut(Decoded)) {
        let Self { codec, clock, metres_per_unit, latency } = self;
        clock.push(codec, packet.received, packet.bytes, |received, line| {
            let Some(line) = Lines.read(line) else { return };
            let length = TetherLength {
                length_m: line.payout.value() * *metres_per_unit,
                resolution_m: line.payout.quantum() * *metres_per_unit,
            };
            sink(Decoded { valid_at: received - *latency, reading: Reading::TetherLength(length) });
        });
    }

    fn counts(&self) -> CodecCounts {
        self.codec.counts()
    }
}
