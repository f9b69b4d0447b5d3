//! Readings of a vehicle's sensors during a self-test: their number, gaps and noise.

use std::collections::BTreeMap;

use headrace_geometry::math;
use headrace_geometry::site::Site;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::messages::Event;
use headrace_sensor::reading::Reading;

/// Largest angle between two returns of a head that count as the same direction. It is the smallest step of an 881, 0.3
/// degrees.
const SAME_DIRECTION_RAD: f64 = 0.3 * core::f64::consts::PI / 180.0;
/// Share of a Gaussian distribution within one standard deviation.
const WITHIN_SD: f64 = 0.6827;
/// Minimum number of differences between values from which noise is computed.
const LEAST_DIFFERENCES: usize = 20;

/// A measured quantity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Quantity {
    Range,
    Depth,
    TurnRate,
    Acceleration,
    Velocity,
    Cable,
    Attitude,
}

impl Quantity {
    /// Name and unit of the quantity.
    pub(super) fn name_and_unit(self) -> [&'static str; 2] {
        match self {
            Self::Range => ["range", "m"],
            Self::Depth => ["depth", "m"],
            Self::TurnRate => ["turn rate", "degrees/s"],
            Self::Acceleration => ["acceleration", "m/s2"],
            Self::Velocity => ["velocity", "m/s"],
            Self::Cable => ["cable", "m"],
            Self::Attitude => ["attitude", "degrees"],
        }
    }
}

/// Times and values of a sensor's readings of one quantity.
#[derive(Debug, Clone)]
pub(super) struct Series {
    count: u64,
    pub(super) first: MonoNs,
    last: MonoNs,
    longest_gap: DurNs,
    /// Latest value of each channel. A channel is an axis of a vector, or a direction of a head.
    latest: BTreeMap<i64, f64>,
    /// Absolute differences between successive values of a channel.
    differences: Vec<f64>,
}

impl Series {
    /// Readings per second, from the first reading to the last.
    pub(super) fn rate_hz(&self) -> f64 {
        let span_s = self.last.since(self.first).as_secs_f64();
        if span_s > 0.0 { (self.count - 1) as f64 / span_s } else { 0.0 }
    }

    /// Longest time without a reading, up to `end`.
    pub(super) fn longest_gap(&self, end: MonoNs) -> DurNs {
        self.longest_gap.max(end.since(self.last))
    }

    /// Whether there was any value. A sonar's reading without an echo has none.
    pub(super) fn has_values(&self) -> bool {
        !self.latest.is_empty()
    }

    /// Standard deviation of the noise; `None` if there are too few values.
    ///
    /// It is computed from differences between successive values, so slow motion doesn't count as noise. A quantile of
    /// the differences is used, so outliers don't count either.
    pub(super) fn noise_sd(&self) -> Option<f64> {
        let mut sorted = self.differences.clone();
        sorted.sort_by(f64::total_cmp);
        let at = usize::try_from(math::floor_to_i64(sorted.len() as f64 * WITHIN_SD)).ok()?;
        let within = sorted.get(at).filter(|_| sorted.len() >= LEAST_DIFFERENCES)?;
        Some(within / core::f64::consts::SQRT_2)
    }
}

/// All readings of one sensor, by quantity.
#[derive(Debug, Clone, Default)]
pub(super) struct SensorReadings(pub(super) BTreeMap<Quantity, Series>);

impl SensorReadings {
    /// Adds a reading. The range of an echo with less confidence than `least_confidence` is no value.
    pub(super) fn add(&mut self, event: &Event, site: Site, least_confidence: f64) {
        let (quantity, mut values) = values(&event.reading, site);
        if matches!(event.reading, Reading::Echo(echo) if echo.confidence < least_confidence) {
            values = [None; 3];
        }
        let at = event.received;
        let series = self.0.entry(quantity).or_insert_with(|| Series {
            count: 0,
            first: at,
            last: at,
            longest_gap: DurNs(0),
            latest: BTreeMap::new(),
            differences: Vec::new(),
        });
        series.count += 1;
        series.longest_gap = series.longest_gap.max(at.since(series.last));
        series.last = at;
        for (channel, value) in values.into_iter().flatten() {
            let before = series.latest.insert(channel, value);
            series.differences.extend(before.map(|before| (value - before).abs()));
        }
    }

    /// The quantity with the most readings. The rate of its readings counts as the rate of the sensor.
    pub(super) fn main(&self) -> Option<&Series> {
        self.0.values().max_by_key(|series| series.count)
    }
}

/// Quantity of a reading, and its values by channel.
fn values(reading: &Reading, site: Site) -> (Quantity, [Option<(i64, f64)>; 3]) {
    let one = |value: Option<f64>| [value.map(|value| (0, value)), None, None];
    let axes = |[x, y, z]: [f64; 3]| [Some((0, x)), Some((1, y)), Some((2, z))];
    match reading {
        Reading::Sonar(sonar) => {
            let turn = core::f64::consts::TAU;
            let direction = math::round_to_i64(sonar.angle_rad.rem_euclid(turn) / SAME_DIRECTION_RAD);
            (Quantity::Range, [sonar.range_m.map(|range_m| (direction, range_m)), None, None])
        }
        Reading::Echo(echo) => (Quantity::Range, one(echo.range_m)),
        Reading::Pressure(water) => (Quantity::Depth, one(Some(site.depth_m(water.pressure_pa)))),
        Reading::AngularRate(rate) => {
            (Quantity::TurnRate, axes([rate.x(), rate.y(), rate.z()].map(f64::to_degrees)))
        }
        Reading::SpecificForce(force) => (Quantity::Acceleration, axes([force.x(), force.y(), force.z()])),
        Reading::VelocityOverGround(speed) => (Quantity::Velocity, axes([speed.x(), speed.y(), speed.z()])),
        Reading::TetherLength(length) => (Quantity::Cable, one(Some(length.length_m))),
        // An inertial unit filters its attitude, so differences between successive values don't show the noise.
        Reading::Attitude(_) => (Quantity::Attitude, one(None)),
    }
}

#[cfg(test)]
mod tests {
    use headrace_sensor::reading::{SourceId, WaterPressure};

    use super::*;

    fn pressures(values_m: impl Iterator<Item = f64>) -> SensorReadings {
        let (mut readings, site) = (SensorReadings::default(), Site::default());
        for (number, depth_m) in values_m.enumerate() {
            let at = MonoNs(1_000_000_000 + number as u64 * 50_000_000);
            let water = WaterPressure {
                pressure_pa: site.pressure_pa(depth_m),
                resolution_pa: 1.0,
                temperature_degc: 10.0,
            };
            let reading = Reading::Pressure(water);
            readings.add(&Event { source: SourceId(0), received: at, valid_at: at, reading }, site, 0.0);
        }
        readings
    }

    /// Pseudorandom values with the standard deviation 1: sums of twelve hashes (`SplitMix64`), each from 0 to 1.
    fn gaussian(number: u64) -> f64 {
        let hash = |seed: u64| {
            let mixed = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15);
            let mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            (mixed ^ (mixed >> 31)) >> 11
        };
        (1..=12).map(|k| hash(12 * number + k) as f64 / (1_u64 << 53) as f64).sum::<f64>() - 6.0
    }

    #[test]
    fn noise_excludes_slow_motion_and_outliers() {
        let noisy = |n: u64| 0.02 * gaussian(n) + 0.001 * n as f64 + if n % 20 == 7 { 5.0 } else { 0.0 };
        let readings = pressures((0..1000).map(noisy));
        let series = readings.main().unwrap();
        assert!((series.rate_hz() - 20.0).abs() < 1e-9, "{}", series.rate_hz());
        let sd_m = series.noise_sd().unwrap();
        assert!((0.018..0.026).contains(&sd_m), "{sd_m}");
        assert_eq!(pressures((0..10).map(noisy)).main().unwrap().noise_sd(), None);
    }

    #[test]
    fn silence_at_the_end_is_a_gap() {
        let readings = pressures((0..100).map(|_| 1.0));
        let (series, last) = (readings.main().unwrap(), MonoNs(1_000_000_000 + 99 * 50_000_000));
        assert_eq!(series.longest_gap(last), DurNs(50_000_000));
        assert_eq!(series.longest_gap(last + DurNs(7_000_000_000)), DurNs(7_000_000_000));
    }
}
