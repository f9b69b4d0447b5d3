//! Model of a device's clock against the host's: unwraps its ticks and estimates its drift.
//!
//! A device stamp arrives at the host after a minimum delay, and buses and queues only add to that delay. So the
//! receive time minus the device time has a lower envelope, and the slope of the envelope is the drift. Time is
//! divided into stretches, and the least delayed stamp of each stretch is kept. A least-squares line is fitted to the
//! kept stamps. A constant delay shifts all stamps equally, which changes the offset but not the slope. If all slots
//! are full, stretches are merged in pairs, so that ten hours need no more memory than two minutes.

use serde::{Deserialize, Serialize};

use headrace_geometry::math;
use headrace_geometry::snapshot::array;
use headrace_geometry::time::{DurNs, MonoNs};

/// Maximum number of stretches of time for which a stamp is kept.
const PLACES: usize = 128;

/// Length of a stretch of time (one stamp is kept per stretch) before any stretches are merged, ns of the device's
/// clock. Each merge doubles it.
const FIRST_SPAN_NS: i64 = 1_000_000_000;

/// Minimum number of stretches of time for a drift estimate. The scatter of fewer stamps is a poor measure of the
/// drift's error.
const LEAST_STRETCHES: usize = 8;

/// Largest deviation of a stamp from its predicted time that is attributed to queues.
///
/// A larger deviation begins a new epoch. The prediction uses the last stamp and the receive times. The limit is at
/// most a quarter of the wrap period, for a clock that wraps soon.
const MOST_QUEUED_NS: i64 = 10_000_000_000;

/// Largest plausible difference between the minimum delays in two stretches of time.
///
/// This difference is `MOST_SHIFT_NS` plus `MOST_DRIFT` times the time between the stretches. No clock drifts by more
/// than this ratio. The stamp of a stretch with a larger delay was queued, and is not kept.
const MOST_SHIFT_NS: f64 = 0.5e9;
const MOST_DRIFT: f64 = 500e-6;

/// Longest plausible queueing delay. If delays stay shifted for longer, a new clock epoch begins.
const LONGEST_QUEUE_NS: i64 = 30_000_000_000;

const LONGEST_TICK_NS: i64 = 900_000_000_000;

const PPM: f64 = 1e6;

/// Statistics of a device's clock.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ClockReport {
    /// Number of device stamps received.
    pub stamps: u64,
    /// Number of times the clock restarted, or fell behind by more than queues explain.
    pub restarts: u64,
    /// Number of times the clock ran ahead by more than queues explain.
    pub jumps: u64,
    /// Length of the clock epoch used for the drift, measured by the device's clock.
    pub span: DurNs,
    /// Drift against the host's clock; `None` until there is enough data.
    pub drift: Option<Drift>,
}

/// Rate error against the host's clock, parts per million. Positive: the device's clock is fast.
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
    /// Most certain drift of earlier clock epochs, and the length of the epoch that gave it.
    before: Option<(Drift, DurNs)>,
}

/// A clock epoch: a run of the device's clock without restart or jump.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Epoch {
    /// Receive time of the epoch's first stamp, which is the zero of device time.
    begun: MonoNs,
    /// The last device stamp: raw ticks, unwrapped ticks, receive time.
    raw: i128,
    elapsed_ticks: i128,
    received: MonoNs,
    edge: Edge,
}

/// Lower envelope of the delays: the least delayed stamp of each stretch.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Edge {
    #[serde(with = "array")]
    kept: [Stamp; PLACES],
    len: usize,
    span_ns: i64,
    /// Number of the current stretch of time, and its least delayed stamp.
    open: Option<(i64, Stamp)>,
    /// Drift by which delays of stamps within a stretch are corrected before comparison.
    slope: f64,
    /// Device time since which the delays of new stretches have been shifted against the kept stamps.
    shifted_since_ns: Option<i64>,
}

/// Device time and delay of a stamp, both relative to the first stamp of the epoch, ns.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
struct Stamp {
    device_ns: i64,
    late_ns: i64,
}

/// A straight line fitted to stamps: late = `mean_late` + `slope` (device - `mean_device`).
struct Line {
    slope: f64,
    slope_sd: f64,
    mean_device_ns: f64,
    mean_late_ns: f64,
}

/// Shift of the delay in a completed stretch against the kept stamps of the epoch.
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

    /// Processes a device stamp received at `received`; ignores bits beyond the clock's width.
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
    /// [`Self::take`] returns such device times. `None` until the drift is known.
    pub fn earliest(&self, device: DurNs) -> Option<MonoNs> {
        let epoch = self.epoch.as_ref()?;
        let line = epoch.edge.line(self.tick)?;
        let least = |stamp: &Stamp| stamp.late_ns as f64 - line.late_ns(stamp.device_ns);
        let least_ns = epoch.edge.kept().iter().map(least).fold(f64::INFINITY, f64::min);
        let late = DurNs(math::round_to_i64(line.late_ns(device.0) + least_ns));
        Some(epoch.begun + device + late)
    }

    /// Returns the clock's statistics so far. The drift comes from the epoch with the smallest standard deviation of
    /// drift.
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
    /// Creates an envelope; the first stamp of the epoch is its reference.
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

    /// Ends the current stretch of time and keeps its least delayed stamp, unless that stamp was delayed by a queue.
    fn close(&mut self) -> Shift {
        let Some((_, stamp)) = self.open.take() else { return Shift::None };
        let shift = self.shift(stamp);
        if shift != Shift::None {
            if shift == Shift::Ahead && stamp.device_ns < LONGEST_QUEUE_NS {
                // The earlier stamps were the delayed ones, because the epoch began while a queue was full.
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

    /// Returns how the delay of a stamp is shifted against the stamp kept last.
    fn shift(&self, stamp: Stamp) -> Shift {
        let Some(last) = self.kept().last() else { return Shift::None };
        let between_ns = stamp.device_ns.saturating_sub(last.device_ns) as f64;
        let late_ns = stamp.late_ns.saturating_sub(last.late_ns) as f64 - self.slope * between_ns;
        let most_ns = MOST_SHIFT_NS + MOST_DRIFT * between_ns;
        // If a clock falls behind, its stamps look delayed.
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

    /// Fits a line to the delays of the kept stamps; `tick` is the resolution of the clock.
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
        // Even if stamps have no scatter, they are uncertain by the rounding to a tick.
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
/// The function adds as many wraps of the clock as bring the result nearest to the time `waited`.
fn advance(difference: i128, round: i128, tick: DurNs, waited: DurNs) -> i128 {
    let expected = i128::from(waited.0).div_euclid(i128::from(tick.0));
    let rounds = (expected - difference + round / 2).div_euclid(round);
    difference + rounds * round
}

/// Returns the stamp that has less delay after correction for a drift of `slope`.
fn earlier(a: Stamp, b: Stamp, slope: f64) -> Stamp {
    let allowed = slope * b.device_ns.saturating_sub(a.device_ns) as f64;
    if (b.late_ns.saturating_sub(a.late_ns) as f64) < allowed { b } else { a }
}

fn saturated(ns: i128) -> DurNs {
    DurNs(i64::try_from(ns).unwrap_or(if ns < 0 { i64::MIN } else { i64::MAX }))
}

#[cfg(test)]
mod tests;
