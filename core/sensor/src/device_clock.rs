//! Model of a device's clock. It undoes the wraps of the tick counter, and estimates the drift against the host's
//! clock.
//!
//! Each device stamp takes at least a constant minimum time to arrive at the host. Buses and queues only add to it. So
//! the receive time minus the device time has a lower envelope, whose slope is the drift. Time is divided into
//! stretches, and the least delayed stamp of each stretch is kept. A least-squares line is fitted to the kept stamps. A
//! constant delay shifts all stamps equally, so it changes the line's offset but not its slope. If the memory for
//! stamps is full, stretches are merged in pairs. So ten hours need no more memory than two minutes.

use serde::{Deserialize, Serialize};

use headrace_geometry::math;
use headrace_geometry::snapshot::array;
use headrace_geometry::time::{DurNs, MonoNs};

/// Maximum number of stretches of time for which a stamp is kept.
const PLACES: usize = 128;

/// Initial length of a stretch of time, ns of the device's clock. Each merge of stretches doubles it.
const FIRST_SPAN_NS: i64 = 1_000_000_000;

/// Minimum number of stretches of time for a drift estimate. The scatter of fewer stamps about the fitted line is a
/// poor measure of the drift's error.
const LEAST_STRETCHES: usize = 8;

/// Largest deviation of a stamp from its predicted time that queues explain, ns.
///
/// A larger deviation begins a new epoch. The prediction uses the previous stamp and the receive times. For a clock
/// that wraps often, the limit is a quarter of its wrap period.
const MOST_QUEUED_NS: i64 = 10_000_000_000;

/// Largest plausible difference between the minimum delays in two stretches of time.
///
/// It is `MOST_SHIFT_NS` plus `MOST_DRIFT` times the time between the stretches. If a stretch's delay is larger, its
/// stamp waited in a queue and is not kept.
const MOST_SHIFT_NS: f64 = 0.5e9;
/// Largest drift of a working clock against the host's clock, a ratio.
pub const MOST_DRIFT: f64 = 500e-6;

/// Longest plausible delay by a queue, ns. If delays are implausible for longer, a new clock epoch begins.
const LONGEST_QUEUE_NS: i64 = 30_000_000_000;

const LONGEST_TICK_NS: i64 = 900_000_000_000;

const PPM: f64 = 1e6;

/// Statistics of a device's clock.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ClockReport {
    /// Number of device stamps received.
    pub stamps: u64,
    /// Number of times the clock has restarted, or has fallen behind by more than queues explain.
    pub restarts: u64,
    /// Number of times the clock has run ahead by more than queues explain.
    pub jumps: u64,
    /// Length of the clock epoch from which the drift was estimated, measured by the device's clock.
    pub span: DurNs,
    /// Drift against the host's clock; `None` until there is enough data.
    pub drift: Option<Drift>,
}

/// Rate error against the host's clock, parts per million. It is positive if the device's clock is fast.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Drift {
    /// Rate error of the device's clock, parts per million.
    pub ppm: f64,
    /// Standard deviation of the rate error, parts per million.
    pub sd_ppm: f64,
}

/// Tracks a device's clock. Allocates: never.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct DeviceClock {
    /// Number of ticks after which the device's clock wraps.
    round: i128,
    tick: DurNs,
    stamps: u64,
    restarts: u64,
    jumps: u64,
    epoch: Option<Epoch>,
    /// Best drift of earlier clock epochs, which has the smallest standard deviation, and the length of its epoch.
    before: Option<(Drift, DurNs)>,
}

/// A clock epoch: a period in which the device's clock neither restarts nor jumps.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Epoch {
    /// Receive time of the epoch's first stamp, at which device time is zero.
    begun: MonoNs,
    /// The last device stamp: raw ticks, unwrapped ticks, receive time.
    raw: i128,
    elapsed_ticks: i128,
    received: MonoNs,
    edge: Edge,
}

/// Lower envelope of the delays: the least delayed stamp of each stretch of time.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Edge {
    #[serde(with = "array")]
    kept: [Stamp; PLACES],
    len: usize,
    span_ns: i64,
    /// Number of the current stretch of time, and its least delayed stamp.
    open: Option<(i64, Stamp)>,
    /// Estimated drift. The delays of stamps within a stretch are corrected for it before they are compared.
    slope: f64,
    /// Device time since which the delays of new stretches have been implausible compared with the kept stamps.
    shifted_since_ns: Option<i64>,
}

/// Device time and delay of a stamp, both relative to the first stamp of the epoch, ns.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
struct Stamp {
    device_ns: i64,
    late_ns: i64,
}

/// A straight line fitted to the kept stamps: delay = `mean_late` + `slope` (device time - `mean_device`).
struct Line {
    slope: f64,
    slope_sd: f64,
    mean_device_ns: f64,
    mean_late_ns: f64,
}

/// Result of comparing the delay of a completed stretch of time with the kept stamps of the epoch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Shift {
    None,
    Behind,
    Ahead,
}

impl DeviceClock {
    /// Creates a clock of `bits` bits (1 to 64) with ticks of length `tick` (1 ns to 15 minutes).
    ///
    /// Parameters outside these ranges are clamped.
    pub fn new(bits: u32, tick: DurNs) -> Self {
        Self {
            round: 1 << bits.clamp(1, 64),
            tick: DurNs(tick.0.clamp(1, LONGEST_TICK_NS)),
            stamps: 0,
            restarts: 0,
            jumps: 0,
            epoch: None,
            before: None,
        }
    }

    /// Processes a device stamp received at `received`. Bits beyond the clock's width are ignored.
    ///
    /// Returns the device time since the first stamp of the epoch, without wraps.
    pub fn take(&mut self, ticks: u64, received: MonoNs) -> DurNs {
        self.stamps += 1;
        let raw = i128::from(ticks).rem_euclid(self.round);
        let Some(epoch) = &mut self.epoch else { return self.begin(raw, received) };
        let waited = received.since(epoch.received);
        let advance = advance(raw - epoch.raw, self.round, self.tick, waited);
        let ahead_ns = advance * i128::from(self.tick.0) - i128::from(waited.0);
        let most_ns = i128::from(MOST_QUEUED_NS).min(self.round * i128::from(self.tick.0) / 4);
        if advance < 0 || ahead_ns < -most_ns {
            self.restarts += 1;
            return self.begin(raw, received);
        }
        if ahead_ns > most_ns {
            self.jumps += 1;
            return self.begin(raw, received);
        }
        epoch.raw = raw;
        epoch.elapsed_ticks += advance;
        epoch.received = received;
        let device = saturated(epoch.elapsed_ticks * i128::from(self.tick.0));
        let late = received.since(epoch.begun) - device;
        match epoch.edge.take(Stamp { device_ns: device.0, late_ns: late.0 }) {
            Shift::None => return device,
            Shift::Behind => self.restarts += 1,
            Shift::Ahead => self.jumps += 1,
        }
        self.begin(raw, received)
    }

    /// Returns the earliest time at which the host could have received a stamp made at device time `device`.
    ///
    /// `device` is a time as returned by [`Self::take`]. `None` until the drift is known.
    pub fn earliest(&self, device: DurNs) -> Option<MonoNs> {
        let epoch = self.epoch.as_ref()?;
        let line = epoch.edge.line(self.tick)?;
        let least = |stamp: &Stamp| stamp.late_ns as f64 - line.late_ns(stamp.device_ns);
        let least_ns = epoch.edge.kept().iter().map(least).fold(f64::INFINITY, f64::min);
        let late = DurNs(math::round_to_i64(line.late_ns(device.0) + least_ns));
        Some(epoch.begun + device + late)
    }

    /// Returns the clock's statistics so far. The drift is that of the epoch in which it has the smallest standard
    /// deviation.
    pub fn report(&self) -> ClockReport {
        let now = self.drift_now();
        let best =
            [self.before, now].into_iter().flatten().min_by(|(a, _), (b, _)| a.sd_ppm.total_cmp(&b.sd_ppm));
        let span = self.epoch.as_ref().map_or(DurNs::ZERO, |epoch| self.span(epoch));
        ClockReport {
            stamps: self.stamps,
            restarts: self.restarts,
            jumps: self.jumps,
            span: best.map_or(span, |(_, span)| span),
            drift: best.map(|(drift, _)| drift),
        }
    }

    fn begin(&mut self, raw: i128, received: MonoNs) -> DurNs {
        let report = self.report();
        self.before = report.drift.map(|drift| (drift, report.span));
        self.epoch = Some(Epoch { begun: received, raw, elapsed_ticks: 0, received, edge: Edge::new() });
        DurNs::ZERO
    }

    fn span(&self, epoch: &Epoch) -> DurNs {
        saturated(epoch.elapsed_ticks * i128::from(self.tick.0))
    }

    fn drift_now(&self) -> Option<(Drift, DurNs)> {
        let epoch = self.epoch.as_ref()?;
        let line = epoch.edge.line(self.tick)?;
        // One second of device time lasts 1 + slope seconds of host time.
        let rate = 1.0 / (1.0 + line.slope);
        let drift = Drift { ppm: (rate - 1.0) * PPM, sd_ppm: line.slope_sd * rate * rate * PPM };
        Some((drift, self.span(epoch)))
    }
}

impl Edge {
    /// Creates an envelope. Delays are relative to the first stamp of the epoch.
    fn new() -> Self {
        Self {
            kept: [Stamp::default(); PLACES],
            len: 0,
            span_ns: FIRST_SPAN_NS,
            open: Some((0, Stamp::default())),
            slope: 0.0,
            shifted_since_ns: None,
        }
    }

    fn take(&mut self, stamp: Stamp) -> Shift {
        let stretch = stamp.device_ns.div_euclid(self.span_ns);
        match &mut self.open {
            Some((open, least)) if *open == stretch => {
                *least = earlier(*least, stamp, self.slope);
                Shift::None
            }
            _ => {
                let shift = self.close();
                let stretch = stamp.device_ns.div_euclid(self.span_ns);
                self.open = Some((stretch, stamp));
                shift
            }
        }
    }

    fn kept(&self) -> &[Stamp] {
        self.kept.get(..self.len).unwrap_or_default()
    }

    /// Ends the current stretch of time and keeps its least delayed stamp, unless a queue has delayed that stamp too.
    fn close(&mut self) -> Shift {
        let Some((_, stamp)) = self.open.take() else { return Shift::None };
        let shift = self.shift(stamp);
        if shift != Shift::None {
            if shift == Shift::Ahead && stamp.device_ns < LONGEST_QUEUE_NS {
                // The new stamp is far less delayed than the kept stamps, so those were queued. The epoch began while a
                // queue was full.
                self.len = 0;
            } else {
                let since = *self.shifted_since_ns.get_or_insert(stamp.device_ns);
                return if stamp.device_ns.saturating_sub(since) > LONGEST_QUEUE_NS {
                    shift
                } else {
                    Shift::None
                };
            }
        }
        self.shifted_since_ns = None;
        self.keep(stamp);
        Shift::None
    }

    /// Compares the delay of a stamp with the delay of the most recently kept stamp.
    fn shift(&self, stamp: Stamp) -> Shift {
        let Some(last) = self.kept().last() else { return Shift::None };
        let between_ns = stamp.device_ns.saturating_sub(last.device_ns) as f64;
        let late_ns = stamp.late_ns.saturating_sub(last.late_ns) as f64 - self.slope * between_ns;
        let most_ns = MOST_SHIFT_NS + MOST_DRIFT * between_ns;
        // The stamps of a clock that falls behind look delayed.
        if late_ns > most_ns {
            Shift::Behind
        } else if late_ns < -most_ns {
            Shift::Ahead
        } else {
            Shift::None
        }
    }

    fn keep(&mut self, stamp: Stamp) {
        if self.len == PLACES {
            self.join();
        }
        if let Some(free) = self.kept.get_mut(self.len) {
            *free = stamp;
            self.len += 1;
        }
        if let Some(line) = self.line(DurNs::ZERO) {
            self.slope = line.slope;
        }
    }

    /// Merges stretches of time in pairs, which doubles their length.
    fn join(&mut self) {
        self.span_ns = self.span_ns.saturating_mul(2);
        let mut joined = [Stamp::default(); PLACES];
        let mut len = 0;
        let mut last_stretch = None;
        for stamp in self.kept() {
            let stretch = stamp.device_ns.div_euclid(self.span_ns);
            if last_stretch != Some(stretch) {
                len += 1;
            }
            let Some(place) = joined.get_mut(len - 1) else { break };
            *place = if last_stretch == Some(stretch) { earlier(*place, *stamp, self.slope) } else { *stamp };
            last_stretch = Some(stretch);
        }
        (self.kept, self.len) = (joined, len);
    }

    /// Fits a line to the delays of the kept stamps. `tick` is the resolution of the clock.
    fn line(&self, tick: DurNs) -> Option<Line> {
        let kept = self.kept();
        if kept.len() < LEAST_STRETCHES {
            return None;
        }
        let n = kept.len() as f64;
        let mean_device_ns = kept.iter().map(|stamp| stamp.device_ns as f64).sum::<f64>() / n;
        let mean_late_ns = kept.iter().map(|stamp| stamp.late_ns as f64).sum::<f64>() / n;
        let about =
            |stamp: &Stamp| (stamp.device_ns as f64 - mean_device_ns, stamp.late_ns as f64 - mean_late_ns);
        let (mut xx, mut xy) = (0.0, 0.0);
        for (x, y) in kept.iter().map(about) {
            xx += x * x;
            xy += x * y;
        }
        let slope = xy / xx;
        let left = |(x, y): (f64, f64)| (y - slope * x) * (y - slope * x);
        let scatter = kept.iter().map(about).map(left).sum::<f64>() / (n - 2.0);
        // Stamps are rounded to ticks, so even stamps without scatter are uncertain.
        let quantum = tick.0 as f64 * tick.0 as f64 / 12.0;
        let slope_sd = math::sqrt((scatter + quantum) / xx);
        (xx > 0.0).then_some(Line { slope, slope_sd, mean_device_ns, mean_late_ns })
    }
}

impl Line {
    fn late_ns(&self, device_ns: i64) -> f64 {
        self.mean_late_ns + self.slope * (device_ns as f64 - self.mean_device_ns)
    }
}

/// Returns the ticks elapsed between two stamps whose raw difference is `difference`.
///
/// Adds as many wraps of the clock as bring the result nearest to the time `waited`.
fn advance(difference: i128, round: i128, tick: DurNs, waited: DurNs) -> i128 {
    let expected = i128::from(waited.0).div_euclid(i128::from(tick.0));
    let rounds = (expected - difference + round / 2).div_euclid(round);
    difference + rounds * round
}

/// Returns the stamp with the smaller delay, after correction for a drift of `slope`.
fn earlier(a: Stamp, b: Stamp, slope: f64) -> Stamp {
    let allowed = slope * b.device_ns.saturating_sub(a.device_ns) as f64;
    if (b.late_ns.saturating_sub(a.late_ns) as f64) < allowed { b } else { a }
}

fn saturated(ns: i128) -> DurNs {
    DurNs(i64::try_from(ns).unwrap_or(if ns < 0 { i64::MIN } else { i64::MAX }))
}

#[cfg(test)]
mod tests;
