//! The filter's record of each sensor: mount, last used reading, and innovation statistics.

use serde::{Deserialize, Serialize};

use super::count_step::CountStep;
use super::noise_level::NoiseLevel;
use crate::constant_range::ConstantRange;
use headrace_geometry::math;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::device::{SensorInfo, SensorKind};
use headrace_sensor::reading::{Reading, SonarReturn};
use headrace_sensor::sampling::head::SILENT_AFTER;

/// Limits at which a head's range counts as stuck.
///
/// A range is stuck if at least `FEW_OF_ONE_RANGE` returns have it although the expected range varies by more than
/// `VARIES_M`. The sd of the expected ranges must be at most `SURE_M`. Three returns suffice, because a return that is
/// dropped by mistake costs nothing.
const FEW_OF_ONE_RANGE: u32 = 3;
const VARIES_M: f64 = 0.05;
const SURE_M: f64 = 0.02;
/// Minimum time between two used attitude readings. Errors of attitude readings stay correlated for longer than this,
/// so more readings would add little.
///
/// The minimum times of cable, depth and velocity readings have the same reason.
pub const ATTITUDE_PERIOD: DurNs = DurNs(100_000_000);
/// Minimum time between two used cable readings; see [`ATTITUDE_PERIOD`].
pub const TETHER_PERIOD: DurNs = DurNs(100_000_000);
/// Minimum time between two used depth readings; see [`ATTITUDE_PERIOD`].
pub const DEPTH_PERIOD: DurNs = DurNs(500_000_000);
/// Minimum time between two used velocity readings; see [`ATTITUDE_PERIOD`].
pub const VELOCITY_PERIOD: DurNs = DurNs(500_000_000);
/// Number of velocity readings that share one error. Errors of the log's scale, mount and bottom track last for 10 s.
///
/// If only 3 s are assumed, a log that shows a fifth too much pulls the estimate away (`docs/why/navigation.md`,
/// "Seeded dives").
pub const VELOCITY_LOOKS: f64 = 20.0;
/// Weight of a new measurement of a head's turn rate in the running mean.
const RATE_SHARE: f64 = 0.05;

/// Innovation statistics of a source. A consistent filter has a mean NIS of 1.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Consistency {
    /// Number of measurements that were fused.
    pub used: u64,
    /// Number of measurements rejected by the gate.
    pub gated: u64,
    /// Number of readings that arrived too late to be fused.
    pub late: u64,
    /// Number of readings dropped because they were implausible or not finite, or because the window was full.
    pub dropped: u64,
    /// Sum of the normalised innovations squared (NIS) of the used measurements.
    pub nis_sum: f64,
    /// Minus twice the log-likelihood of all innovations, up to a constant for each measurement.
    ///
    /// Each innovation adds two terms. The first term is the NIS, clipped at the gate, minus 1. The second term is
    /// ln(variance of the innovation / usual variance). A log can be interpreted with different settings; those with
    /// the lower value are more likely.
    pub surprise: f64,
}

impl Consistency {
    /// Counts an innovation of a fused or rejected measurement.
    pub fn count(&mut self, nis: f64, gate: f64, variance: f64, usual: f64) {
        self.surprise += nis.min(gate) - 1.0 + math::ln(variance / usual);
        if nis <= gate {
            self.used += 1;
            self.nis_sum += nis;
        } else {
            self.gated += 1;
        }
    }

    /// Returns the mean NIS (normalised innovation squared) of the used measurements; `None` if there are none.
    pub fn nis(&self) -> Option<f64> {
        (self.used > 0).then(|| self.nis_sum / self.used as f64)
    }
}

/// The filter's record of one sensor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Source {
    /// Mount and kind of the sensor.
    pub sensor: SensorInfo,
    /// Innovation statistics of the sensor.
    pub consistency: Consistency,
    /// Time of the last used reading, for sensors whose readings are used once per period.
    pub taken: Option<MonoNs>,
    /// Rotation of the sensor if it is a head.
    pub turning: Turning,
    /// Learnt noise level of the sensor.
    pub noise_level: NoiseLevel,
    /// Resolution step of the sensor if it is a tether counter.
    pub count_step: CountStep,
    /// Detector of a head that reports a constant range.
    pub one_range: ConstantRange,
}

/// Measured rotation of a head, and its last used angle.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Turning {
    last: Option<(MonoNs, f64)>,
    used_rad: Option<f64>,
    rate_radps: f64,
}

impl Source {
    /// Creates the record of a sensor without readings.
    pub fn new(sensor: SensorInfo) -> Self {
        Self {
            sensor,
            consistency: Consistency::default(),
            taken: None,
            turning: Turning::default(),
            noise_level: NoiseLevel::default(),
            count_step: CountStep::default(),
            one_range: ConstantRange::default(),
        }
    }

    /// Processes a head's range; returns whether the head reports the same range in every direction.
    ///
    /// `residual_m` is the range minus the expected range, and `estimate_sd_m` the sd of the expected range, m. Returns
    /// `false` while the estimate is uncertain.
    pub fn says_one_range(&mut self, reading: &Reading, residual_m: f64, estimate_sd_m: f64) -> bool {
        let Reading::Sonar(SonarReturn { range_m: Some(range_m), .. }) = reading else { return false };
        if estimate_sd_m > SURE_M {
            self.one_range = ConstantRange::default();
        } else {
            self.one_range.note(*range_m, residual_m);
        }
        self.is_stuck()
    }

    /// Whether a head's latest returns have the same range although the expected ranges vary.
    fn is_stuck(&self) -> bool {
        self.one_range.is_stuck(FEW_OF_ONE_RANGE, VARIES_M)
    }

    /// Counts one scalar component of a reading as rejected; `number` is the component's index in the reading.
    pub fn leave_out(&mut self, number: usize) {
        self.consistency.gated += 1;
        self.noise_level.skip(number);
    }

    /// Whether `period` has passed since the source's last used reading. If so, the present reading counts as used.
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
/// Then the head itself is the cause of its constant range. Otherwise the cause may be an error of the estimate, for
/// instance in a round tunnel.
pub fn others_change(sources: &[Option<Source>], source: usize) -> bool {
    let mut others = sources.iter().enumerate().filter(|(number, _)| *number != source);
    others.any(|(_, other)| {
        other.is_some_and(|other| {
            other.sensor.kind == SensorKind::Head && other.one_range.is_heard() && !other.is_stuck()
        })
    })
}

/// Returns the share of the declared variance to use for the ranges of all heads: the largest share that a head has
/// learnt.
///
/// The largest is used because, once one head sees rocks, the other heads soon will.
pub fn smoothness(sources: &[Option<Source>]) -> f64 {
    let heads = sources.iter().flatten().filter(|source| source.sensor.kind == SensorKind::Head);
    heads.filter_map(|head| head.noise_level.smoothness()).reduce(f64::max).unwrap_or(1.0)
}

impl Turning {
    /// Processes a ping of a head, and decides whether to use it.
    ///
    /// Returns whether the ping has a range and differs by at least `step_rad` in direction from the last used
    /// ping.
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

    /// Returns the head's turns per second; `None` for a head that does not turn.
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
    fn mean_nis_covers_used_measurements_only() {
        let mut consistency = Consistency::default();
        assert_eq!(consistency.nis(), None);
        for nis in [0.5, 9.0, 2.5, 16.0, 100.0] {
            consistency.count(nis, 9.0, 4.0, 4.0);
        }
        assert_eq!((consistency.used, consistency.gated), (3, 2));
        assert_eq!(consistency.nis(), Some(4.0));
        // The statistics clip innovations at the gate.
        assert!((consistency.surprise - (0.5 + 9.0 + 2.5 + 9.0 + 9.0 - 5.0)).abs() < 1e-12);
    }
}
