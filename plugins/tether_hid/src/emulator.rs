//! The counter's side of the line: a report, or a text line, at a fixed rate.

use headrace_core::app::components::Tether;
use headrace_core::app::device::{Direction, Emulator, Truth};
use headrace_core::math;
use headrace_core::time::{DurNs, MonoNs};

use crate::decoder::Counter;
use crate::line::{Decimal, LineReading};
use crate::report::Report;
use crate::tracker::Counting;

/// Status that an emulated counter gives: all well.
const STATUS_WELL: u8 = 1;

/// Places that an emulated line gives: millimetres.
const LINE_PLACES: u8 = 3;

/// When an emulated counter reports, and what it measures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reeling {
    /// Where the counter is zero, and its scale.
    pub tether: Tether,
    /// Reports a second.
    pub rate_hz: f64,
    /// From validity to receive time.
    pub latency: DurNs,
}

/// An ideal HID counter: no noise and no delay of its own, but whole counts.
#[derive(Debug, Clone)]
pub struct HidEmulator {
    reeling: Reeling,
    counter: Counter,
    start: MonoNs,
    sent: u64,
    told_counts: i64,
}

/// An ideal LCI-90: no noise and no delay of its own, but whole millimetres.
#[derive(Debug, Clone)]
pub struct LineEmulator {
    reeling: Reeling,
    metres_per_unit: f64,
    start: MonoNs,
    sent: u64,
}

impl Reeling {
    fn due(&self, start: MonoNs, sent: u64) -> MonoNs {
        start + DurNs::from_secs_f64(sent as f64 / self.rate_hz)
    }

    /// Cable paid out, m.
    fn length_m(&self, truth: &dyn Truth, at: MonoNs) -> f64 {
        (truth.pose(at).position.x() - self.tether.zero_at_m) / self.tether.scale
    }
}

impl HidEmulator {
    /// A counter that is switched on, and first reports, at `start`.
    pub fn new(reeling: Reeling, counter: Counter, start: MonoNs) -> Self {
        Self { reeling, counter, start, sent: 0, told_counts: 0 }
    }

    /// What the next report says of `counts`; a change too large for the report is told over several.
    fn count(&mut self, counts: i64) -> i64 {
        let layout = &self.counter.layout;
        match self.counter.counting {
            Counting::Absolute => layout.width.wrapped(counts, layout.signed),
            Counting::Delta => {
                let most = (1_i64 << (layout.width.bits() - 1)) - 1;
                let change = (counts - self.told_counts).clamp(-most, most);
                self.told_counts += change;
                change
            }
        }
    }
}

impl Emulator for HidEmulator {
    fn due(&self) -> MonoNs {
        self.reeling.due(self.start, self.sent)
    }

    fn act(&mut self, truth: &dyn Truth, line: &mut dyn FnMut(Direction, MonoNs, &[u8])) {
        let at = self.due();
        let length_m = self.reeling.length_m(truth, at);
        let report = Report {
            sequence: Some((self.sent & 0xFF) as u8),
            status: Some(STATUS_WELL),
            count: self.count(math::round_to_i64(length_m * self.counter.counts_per_metre)),
            auxiliary: i32::try_from(at.since(self.start).0 / 1_000_000).ok(),
        };
        line(Direction::Received, at + self.reeling.latency, &self.counter.layout.encode(&report));
        self.sent += 1;
    }
}

impl LineEmulator {
    /// A monitor that is switched on, and first sends a line, at `start`.
    pub fn new(reeling: Reeling, metres_per_unit: f64, start: MonoNs) -> Self {
        Self { reeling, metres_per_unit, start, sent: 0 }
    }
}

impl Emulator for LineEmulator {
    fn due(&self) -> MonoNs {
        self.reeling.due(self.start, self.sent)
    }

    fn act(&mut self, truth: &dyn Truth, line: &mut dyn FnMut(Direction, MonoNs, &[u8])) {
        let at = self.due();
        let before = at - DurNs::from_millis(100);
        let units = |at| self.reeling.length_m(truth, at) / self.metres_per_unit;
        let elapsed_s = at.since(before).as_secs_f64();
        let speed = if elapsed_s > 0.0 { (units(at) - units(before)) / elapsed_s } else { 0.0 };
        let reading = LineReading {
            stamp: None,
            tension: Decimal::ZERO,
            speed: Decimal::nearest(speed, LINE_PLACES),
            payout: Decimal::nearest(units(at), LINE_PLACES),
        };
        line(Direction::Received, at + self.reeling.latency, &reading.encode());
        self.sent += 1;
    }
}
