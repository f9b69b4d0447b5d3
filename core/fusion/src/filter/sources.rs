//! The filter's record of each source: mount, last use, and innovation statistics.

use serde::{Deserialize, Serialize};

use super::count_step::CountStep;
use super::noise_level::NoiseLevel;
use crate::one_range::OneRange;
use headrace_geometry::math;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::device::{SensorInfo, SensorKind};
use headrace_sensor::reading::{Reading, SonarReturn};
use headrace_sensor::sampling::head::SILENT_AFTER;

/// Limits for a stuck head: number of returns, and variation of the expected range, m.
///
/// So many returns have one range although the expected range varies by more. A reading that is dropped by mistake
/// costs nothing. The expected ranges must be certain to within a standard deviation, m.
const FEW_OF_ONE_RANGE: u32 = 3;
const VARIES_M: f64 = 0.05;
const SURE_M: f64 = 0.02;
/// Update period of attitudes, because their errors are correlated over longer times.
///
/// The same applies to cables and depths.
pub const ATTITUDE_PERIOD: DurNs = DurNs(100_000_000);
/// See [`ATTITUDE_PERIOD`].
pub const TETHER_PERIOD: DurNs = DurNs(100_000_000);
/// See [`ATTITUDE_PERIOD`].
pub const DEPTH_PERIOD: DurNs = DurNs(500_000_000);
/// See [`ATTITUDE_PERIOD`]. Errors of a velocity log's scale, mount and bottom last for 10 s, so many readings share
/// one.
///
/// With 3 s, a log that shows a fifth too much pulls the estimate away (`docs/why/navigation.md`, "Seeded dives").
pub const VELOCITY_PERIOD: DurNs = DurNs(500_000_000);
/// See [`VELOCITY_PERIOD`].
pub const VELOCITY_LOOKS: f64 = 20.0;
/// Weight of a new turn rate in the running mean.
const RATE_SHARE: f64 = 0.05;

/// Innovation statistics of a source: a consistent filter has a mean NIS of 1.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Consistency {
    /// Measurements used.
    pub used: u64,
    /// Measurements rejected by the gate.
    pub gated: u64,
    /// Readings that arrived too late to be fused.
    pub late: u64,
    /// Readings that were implausible or not finite, or that found no room.
    pub dropped: u64,
    /// Sum of the normalised innovations squared (NIS) of the measurements used.
    pub nis_sum: f64,
    /// Minus twice the log-likelihood of all innovations, up to a constant for each measurement.
    ///
    /// It is the sum of NIS (clipped at the gate) less 1, and of the logarithm of the innovation variance over the
    /// usual one. Between two interpretations of the same log, the lower value is more likely.
    pub surprise: f64,
}

impl Consistency {
    /// Counts an innovation and whether it was used.
    pub fn count(&mut self, nis: f64, gate: f64, variance: f64, usual: f64) {
        self.surprise += nis.min(gate) - 1.0 + math::ln(variance / usual);
        if nis <= gate {
            self.used += 1;
            self.nis_sum += nis;
        } else {
            self.gated += 1;
        }
    }

    /// Returns the mean NIS of the used measurements; `None` without any.
    pub fn nis(&self) -> Option<f64> {
        (self.used > 0).then(|| self.nis_sum / self.used as f64)
    }
}

/// The filter's record of one source.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Source {
    /// Mount and kind.
    pub sensor: SensorInfo,
    /// Innovation statistics.
    pub consistency: Consistency,
    /// Time at which one of its readings was last put into the window.
    pub taken: Option<MonoNs>,
    /// For a head, its rotation.
    pub turning: Turning,
    /// Level of its noise.
    pub noise_level: NoiseLevel,
    /// For a tether counter, its step.
    pub count_step: CountStep,
    /// For a head, whether its range follows the wall.
    pub one_range: OneRange,
}

/// Rotation of a head.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Turning {
    last: Option<(MonoNs, f64)>,
    used_rad: Option<f64>,
    rate_radps: f64,
}

impl Source {
    /// Creates a source without readings.
    pub fn new(sensor: SensorInfo) -> Self {
        Self {
            sensor,
            consistency: Consistency::default(),
            taken: None,
            turning: Turning::default(),
            noise_level: NoiseLevel::default(),
            count_step: CountStep::default(),
            one_range: OneRange::default(),
        }
    }

    /// Notes a head's range; returns whether the head reports one range in every direction.
    ///
    /// Inputs: the excess over the estimated range, m, and the estimate's uncertainty. Nothing is concluded while the
    /// estimate is uncertain.
    pub fn says_one_range(&mut self, reading: &Reading, residual_m: f64, estimate_sd_m: f64) -> bool {
        let Reading::Sonar(SonarReturn { range_m: Some(range_m), .. }) = reading else { return false };
        if estimate_sd_m > SURE_M {
            self.one_range = OneRange::default();
        } else {
            self.one_range.note(*range_m, residual_m);
        }
        self.is_stuck()
    }

    /// Whether a head's last returns have one range although the estimated ranges vary.
    fn is_stuck(&self) -> bool {
        self.one_range.is_stuck(FEW_OF_ONE_RANGE, VARIES_M)
    }

    /// Counts a scalar of a reading as rejected; `number` is its index in the reading.
    pub fn leave_out(&mut self, number: usize) {
        self.consistency.gated += 1;
        self.noise_level.skip(number);
    }

    /// Whether `period` has passed since its last reading in the window.
    ///
    /// If so, this reading becomes the last.
    pub fn is_due(&mut self, at: MonoNs, period: DurNs) -> bool {
        let due = self.taken.is_none_or(|taken| at.since(taken).0.abs() >= period.0);
        if due {
            self.taken = Some(at);
        }
        due
    }
}

/// Whether the range of any other head follows the wall.
///
/// If so, a constant range of this source is its own fault. In a round tunnel, an error of the estimate could
/// otherwise explain it.
pub fn others_change(sources: &[Option<Source>], source: usize) -> bool {
    let mut others = sources.iter().enumerate().filter(|(number, _)| *number != source);
    others.any(|(_, other)| {
        other.is_some_and(|other| {
            other.sensor.kind == SensorKind::Head && other.one_range.is_heard() && !other.is_stuck()
        })
    })
}

/// Share of the declared variance to apply to ranges of heads: that of the head with the largest one.
///
/// If one head begins to see rocks, the others soon will.
pub fn smoothness(sources: &[Option<Source>]) -> f64 {
    let heads = sources.iter().flatten().filter(|source| source.sensor.kind == SensorKind::Head);
    heads.filter_map(|head| head.noise_level.smoothness()).reduce(f64::max).unwrap_or(1.0)
}

impl Turning {
    /// Notes a ping.
    ///
    /// Returns whether it has a range and points at least `step_rad` away from the last used one.
    pub fn ping(&mut self, at: MonoNs, sonar: &SonarReturn, step_rad: f64) -> bool {
        if let Some((before, angle_rad)) = self.last {
            let dt_s = at.since(before).as_secs_f64();
            if dt_s > 0.0 && dt_s < 1.0 {
                let rate = math::wrap_signed(sonar.angle_rad - angle_rad, math::TAU).abs() / dt_s;
                let share = if self.rate_radps > 0.0 { RATE_SHARE } else { 1.0 };
                self.rate_radps += share * (rate - self.rate_radps);
            }
        }
        self.last = Some((at, sonar.angle_rad));
        let elsewhere = self
            .used_rad
            .is_none_or(|used| math::wrap_signed(sonar.angle_rad - used, math::TAU).abs() >= step_rad);
        if elsewhere && sonar.range_m.is_some() {
            self.used_rad = Some(sonar.angle_rad);
        }
        elsewhere && sonar.range_m.is_some()
    }

    /// Turns per second; `None` for a head that does not turn.
    pub fn turns_per_s(&self, now: MonoNs) -> Option<f64> {
        let (last, _) = self.last?;
        (now.since(last).0.abs() <= SILENT_AFTER.0 && self.rate_radps > 0.0)
            .then(|| self.rate_radps / math::TAU)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn consistency_counts_used_and_gated_and_averages_used() {
        let mut consistency = Consistency::default();
        assert_eq!(consistency.nis(), None);
        for nis in [0.5, 9.0, 2.5, 16.0, 100.0] {
            consistency.count(nis, 9.0, 4.0, 4.0);
        }
        assert_eq!((consistency.used, consistency.gated), (3, 2));
        assert_eq!(consistency.nis(), Some(4.0));
        // Innovations are clipped at the gate.
        assert!((consistency.surprise - (0.5 + 9.0 + 2.5 + 9.0 + 9.0 - 5.0)).abs() < 1e-12);
    }
}
