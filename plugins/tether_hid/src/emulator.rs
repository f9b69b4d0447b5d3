//! Emulates a cable counter, which sends a report or a text line at a fixed rate.

use headrace_sensor::device::{Direction, Emulator, LineSink};
use headrace_sensor::geometry::math;
use headrace_sensor::geometry::time::{DurNs, MonoNs};
use headrace_sensor::measurement::Payout;

use crate::decoder::Counter;
use crate::line::{Decimal, LineReading};
use crate::report::Report;
use crate::tracker::Counting;

/// Status byte of an emulated counter, which means valid.
const STATUS_WELL: u8 = 1;

/// Number of decimal places of lengths in an emulated text line: three, for millimetres.
const LINE_PLACES: u8 = 3;

/// Settings of the emulated counter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CounterSettings {
    /// Chainage at which the counter reads zero, m.
    pub zero_at_m: f64,
    /// Metres of chainage per metre of cable.
    pub scale: f64,
    /// Report rate, Hz.
    pub rate_hz: f64,
    /// Delay from a reading's time of validity to its receipt.
    pub latency: DurNs,
}

/// An ideal emulated HID counter: there is no noise and no added delay, but counts are whole numbers.
#[derive(Debug, Clone)]
pub struct HidEmulator {
    reeling: CounterSettings,
    counter: Counter,
    start: MonoNs,
    begun: u64,
    sent: u64,
    sent_counts: i64,
}

/// An ideal emulated LCI-90: there is no noise and no added delay, but lengths are whole millimetres.
#[derive(Debug, Clone)]
pub struct LineEmulator {
    reeling: CounterSettings,
    metres_per_unit: f64,
    start: MonoNs,
    begun: u64,
    before: Option<(MonoNs, f64)>,
}

impl CounterSettings {
    /// Time of a report on the counter's clock, counted from the start.
    fn elapsed(&self, report: u64) -> DurNs {
        DurNs::from_secs_f64(report as f64 / self.rate_hz)
    }

    /// Appends the reports that are due before `until`, beginning with report number `begun`.
    fn begin(&self, start: MonoNs, begun: &mut u64, until: MonoNs, due: &mut Vec<Payout>) {
        while start + self.elapsed(*begun) < until {
            due.push(Payout::due(start + self.elapsed(*begun)));
            *begun += 1;
        }
    }

    /// Length of cable that the counter has counted as paid out, m.
    fn length_m(&self, payout: &Payout) -> f64 {
        (payout.chainage_m - self.zero_at_m) / self.scale
    }
}

impl HidEmulator {
    /// Creates a counter that is switched on, and first reports, at `start`.
    pub fn new(reeling: CounterSettings, counter: Counter, start: MonoNs) -> Self {
        Self { reeling, counter, start, begun: 0, sent: 0, sent_counts: 0 }
    }

    /// Count in the next report. In delta mode, a change too large for one report is divided among several reports.
    fn count(&mut self, counts: i64) -> i64 {
        let layout = &self.counter.layout;
        match self.counter.counting {
            Counting::Absolute => layout.width.wrapped(counts, layout.signed),
            Counting::Delta => {
                let most = (1_i64 << (layout.width.bits() - 1)) - 1;
                let change = counts.saturating_sub(self.sent_counts).clamp(-most, most);
                self.sent_counts += change;
                change
            }
        }
    }
}

impl Emulator<Payout> for HidEmulator {
    fn begin(&mut self, until: MonoNs, due: &mut Vec<Payout>) {
        self.reeling.begin(self.start, &mut self.begun, until, due);
    }

    fn tell(&mut self, payout: &Payout, line: LineSink<'_>) {
        let length_m = self.reeling.length_m(payout);
        let report = Report {
            sequence: Some((self.sent & 0xFF) as u8),
            status: Some(STATUS_WELL),
            count: self.count(math::round_to_i64(length_m * self.counter.counts_per_metre)),
            auxiliary: i32::try_from(self.reeling.elapsed(self.sent).0 / 1_000_000).ok(),
        };
        self.sent += 1;
        let bytes = self.counter.layout.encode(&report);
        line(Direction::Received, payout.at + self.reeling.latency, &bytes);
    }
}

impl LineEmulator {
    /// Creates a line monitor that is switched on, and first sends a line, at `start`.
    pub fn new(reeling: CounterSettings, metres_per_unit: f64, start: MonoNs) -> Self {
        Self { reeling, metres_per_unit, start, begun: 0, before: None }
    }
}

impl Emulator<Payout> for LineEmulator {
    fn begin(&mut self, until: MonoNs, due: &mut Vec<Payout>) {
        self.reeling.begin(self.start, &mut self.begun, until, due);
    }

    fn tell(&mut self, payout: &Payout, line: LineSink<'_>) {
        let units = self.reeling.length_m(payout) / self.metres_per_unit;
        let speed = self.before.map_or(0.0, |(at, before)| {
            let elapsed_s = payout.at.since(at).as_secs_f64();
            if elapsed_s > 0.0 { (units - before) / elapsed_s } else { 0.0 }
        });
        self.before = Some((payout.at, units));
        let reading = LineReading {
            stamp: None,
            tension: Decimal::ZERO,
            speed: Decimal::nearest(speed, LINE_PLACES),
            payout: Decimal::nearest(units, LINE_PLACES),
        };
        line(Direction::Received, payout.at + self.reeling.latency, &reading.encode());
    }
}
