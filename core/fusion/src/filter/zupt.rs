//! Zero-velocity (ZUPT) detector: a vehicle at rest on deck or on the ground. Its gyros then show their bias.

use serde::{Deserialize, Serialize};

use headrace_geometry::frames::{Sensor, Vec3};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::device::SensorKind;
use headrace_sensor::reading::Reading;

/// Averaging window; a floating vehicle never stays steady for `MEANS` windows.
const MEAN_OVER: DurNs = DurNs(1_000_000_000);
const MEANS: u32 = 5;
/// Largest difference between means of turn rate and specific force at rest, rad/s and m/s^2.
const SAME_RATE: f64 = 1e-3;
const SAME_FORCE: f64 = 0.02;

/// See the module's description.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Stillness {
    rate: Means,
    force: Means,
    cable_m: Option<f64>,
    cable_still: bool,
    cable_at: MonoNs,
}

/// Means of successive windows, compared with the first of a steady run.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
struct Means {
    since: Option<MonoNs>,
    sum: [f64; 3],
    count: f64,
    first: Option<[f64; 3]>,
    alike: u32,
    /// The latest mean, until it is taken.
    latest: Option<[f64; 3]>,
}

impl Means {
    fn take(&mut self, at: MonoNs, value: [f64; 3], same: f64) {
        let since = *self.since.get_or_insert(at);
        if at.since(since).0 >= MEAN_OVER.0 {
            let mean = self.sum.map(|sum| sum / self.count.max(1.0));
            let is_alike =
                self.first.is_some_and(|first| first.iter().zip(mean).all(|(a, b)| (a - b).abs() <= same));
            self.alike = if is_alike { self.alike.saturating_add(1) } else { 0 };
            self.first = if is_alike { self.first } else { Some(mean) };
            self.latest = Some(mean);
            (self.since, self.sum, self.count) = (Some(at), [0.0; 3], 0.0);
        }
        for (sum, value) in self.sum.iter_mut().zip(value) {
            *sum += value;
        }
        self.count += 1.0;
    }
}

impl Stillness {
    /// Takes a reading.
    pub fn take(&mut self, at: MonoNs, kind: SensorKind, reading: &Reading) {
        match (kind, reading) {
            (SensorKind::Imu, Reading::AngularRate(rate)) => {
                if at.since(self.cable_at).0 > MEAN_OVER.0 {
                    // A counter that says nothing doesn't say that the cable is still.
                    self.moved();
                }
                self.rate.take(at, [rate.x(), rate.y(), rate.z()], SAME_RATE);
            }
            (SensorKind::Imu, Reading::SpecificForce(force)) => {
                self.force.take(at, [force.x(), force.y(), force.z()], SAME_FORCE);
            }
            (SensorKind::Tether { .. }, Reading::TetherLength(length)) => {
                let before_m = *self.cable_m.get_or_insert(length.length_m);
                self.cable_at = at;
                self.cable_still = true;
                if (length.length_m - before_m).abs() > length.resolution_m {
                    self.cable_m = Some(length.length_m);
                    self.moved();
                }
            }
            _ => {}
        }
    }

    fn moved(&mut self) {
        self.cable_still = false;
        (self.rate.alike, self.force.alike) = (0, 0);
    }

    /// Whether gyros and accelerometers have been steady for long, and the cable hasn't moved.
    pub fn is_still(&self) -> bool {
        self.rate.alike >= MEANS && self.force.alike >= MEANS && self.cable_still
    }

    /// Mean turn rate of the last window, rad/s; returned once.
    pub fn take_mean_rate(&mut self) -> Option<Vec3<Sensor>> {
        self.rate.latest.take().map(|[x, y, z]| Vec3::new(x, y, z))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_geometry::math;
    use headrace_sensor::reading::TetherLength;

    /// Whether it is at rest after twenty seconds with this turn rate and cable length.
    fn still(rate: impl Fn(f64) -> f64, way_m: impl Fn(f64) -> Option<f64>) -> bool {
        let mut stillness = Stillness::default();
        for k in 0..2000_u32 {
            let (at, t) = (MonoNs(u64::from(k) * 10_000_000), f64::from(k) / 100.0);
            let noise = 0.001 * f64::from(k % 7) - 0.003;
            stillness.take(at, SensorKind::Imu, &Reading::AngularRate(Vec3::new(0.01 + noise, 0.0, rate(t))));
            stillness.take(at, SensorKind::Imu, &Reading::SpecificForce(Vec3::new(0.1, noise, 9.8)));
            let Some(length_m) = way_m(t) else { continue };
            let tether = SensorKind::Tether { zero_at_m: 0.0, scale: 1.0 };
            stillness.take(
                at,
                tether,
                &Reading::TetherLength(TetherLength { length_m, resolution_m: 0.001 }),
            );
        }
        stillness.is_still()
    }

    #[test]
    fn a_vehicle_on_deck_rests_and_one_that_floats_does_not() {
        assert!(still(|_| 0.003, |_| Some(0.0)), "biases and noise aren't motion");
        assert!(!still(|t| 0.01 * math::sin(t / 2.0), |_| Some(0.0)), "it turns to and fro");
        assert!(!still(|_| 0.0, |t| Some(0.05 * t)), "the cable runs");
        assert!(
            !still(|_| 0.0, |t| (t < 5.0).then_some(0.0)),
            "nothing is known of the cable since it fell silent"
        );
        assert!(
            still(|_| 0.0, |t| (!(2.0..5.0).contains(&t)).then_some(0.0)),
            "it speaks again, and is still"
        );
    }
}
