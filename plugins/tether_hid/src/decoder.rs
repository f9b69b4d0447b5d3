//! Decodes reports and lines into readings of cable length.

use headrace_sensor::codec::{Codec as _, CodecCounts, Framing as _, LineClock};
use headrace_sensor::device::Decoder;
use headrace_sensor::device_clock::{ClockReport, DeviceClock};
use headrace_sensor::geometry::time::DurNs;
use headrace_sensor::reading::{Decoded, Packet, Reading, TetherLength};
use headrace_sensor::stateful;
use headrace_sensor::withheld::WithheldReason;

use crate::line::{LineCodec, Lines};
use crate::report::{LayoutError, Report, ReportCodec, ReportLayout};
use crate::tracker::{CountTracker, Counting, TrackerHealth};

/// Longest usual gap between the bytes of one text line. An unfinished line is dropped after this gap.
const SILENCE: DurNs = DurNs::from_millis(100);

const MILLISECOND: DurNs = DurNs::from_millis(1);

/// Decoding settings of a HID counter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Counter {
    /// Layout of the counter's reports.
    pub layout: ReportLayout,
    /// Whether the auxiliary value is the device time in milliseconds.
    pub auxiliary_is_ms: bool,
    /// Whether the reported counts are absolute or changes.
    pub counting: Counting,
    /// Counts per metre of cable; negative if the count falls as cable is paid out.
    pub counts_per_metre: f64,
    /// Smallest change of the length that the wheel can detect, m. 0 means that the smallest change is one count.
    pub step_m: f64,
    /// Maximum winch speed, m/s.
    pub max_speed_mps: f64,
    /// Delay from a reading's time of validity to its receipt.
    pub latency: DurNs,
}

impl Counter {
    /// Resolution of the length, m.
    pub fn resolution_m(&self) -> f64 {
        self.step_m.max(1.0 / self.counts_per_metre.abs())
    }
}

/// Decodes a HID counter's reports into readings.
#[derive(Debug, Clone)]
pub struct HidDecoder {
    codec: ReportCodec,
    tracker: CountTracker,
    counter: Counter,
    clock: Option<DeviceClock>,
    status: Option<u8>,
}

stateful!(HidDecoder { state: codec, tracker, clock, status; fixed: counter; });

/// Decodes a line monitor's text lines into readings.
#[derive(Debug, Clone)]
pub struct LineDecoder {
    codec: LineCodec,
    clock: LineClock,
    metres_per_unit: f64,
    latency: DurNs,
}

stateful!(LineDecoder { state: codec, clock; fixed: metres_per_unit, latency; });

impl HidDecoder {
    /// Creates a decoder of HID reports.
    ///
    /// Errors: the layout is invalid.
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

    /// Number of rejected and lost reports, and whether the counter must be re-zeroed.
    pub fn health(&self) -> TrackerHealth {
        self.tracker.health()
    }

    /// Status byte of the latest report, if the layout has one. Its meaning depends on the device.
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
                resolution_m: counter.resolution_m(),
                restart: tracker.restart(),
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

    /// Number of reports rejected because the change was faster than the winch.
    fn withheld(&self) -> u64 {
        self.health().rejected
    }

    fn withheld_reason(&self) -> Option<WithheldReason> {
        (self.health().rejected > 0).then_some(WithheldReason::Implausible)
    }

    fn clock(&self) -> Option<ClockReport> {
        self.clock.as_ref().map(DeviceClock::report)
    }
}

impl LineDecoder {
    /// Creates a decoder of lines whose payout is in units of `metres_per_unit`.
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
                restart: None,
            };
            sink(Decoded { valid_at: received - *latency, reading: Reading::TetherLength(length) });
        });
    }

    fn counts(&self) -> CodecCounts {
        self.codec.counts()
    }
}
