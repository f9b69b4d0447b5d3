//! Detection of a vehicle at rest, for zero-velocity updates (ZUPT).
//!
//! At rest on deck or on the ground, the mean readings of the gyros are their bias.

use serde::{Deserialize, Serialize};

use headrace_geometry::frames::{Sensor, Vec3};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::device::SensorKind;
use headrace_sensor::reading::Reading;

/// Averaging window (`MEAN_OVER`), and number of equal successive means that show rest (`MEANS`). A floating vehicle
/// has fewer equal means.
const MEAN_OVER: DurNs = DurNs(1_000_000_000);
const MEANS: u32 = 5;
/// Number of mean turn rates at rest after which the gyro bias is known.
const ENOUGH: u32 = 25;
/// Time after which a vehicle that moves on a stationary cable counts as floating, s.
const FLOATS: u32 = 15;
/// Time after the first estimate during which the pilot is asked to keep the vehicle still.
const ASKS_FOR: DurNs = DurNs(60_000_000_000);
/// Number of remembered pauses of the cable. The cable is at rest once it has been still for `PAUSES_TO_REST` times the
/// longest of them.
///
/// Pauses matter if a winch operator winds the cable in half a metre at a time. Between pulls, the cable is then
/// stationary while the vehicle moves on.
const PAUSES: usize = 4;
const PAUSES_TO_REST: u64 = 2;
/// Largest difference between two means at rest: `SAME_RATE` for turn rates, rad/s, `SAME_FORCE` for specific forces,
/// m/s^2.
const SAME_RATE: f64 = 1e-3;
const SAME_FORCE: f64 = 0.02;

/// Detector of a vehicle at rest.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct RestDetector {
    rate: Means,
    force: Means,
    cable_m: Option<f64>,
    cable_still: bool,
    cable_at: MonoNs,
    /// Time of the cable's last movement, and the lengths of the pauses before it, the latest last.
    cable_moved_at: Option<MonoNs>,
    pauses: [DurNs; PAUSES],
    /// Number of mean turn rates that were taken at rest.
    rested: u32,
    /// Time for which the cable has been stationary although the vehicle is not at rest, s.
    floated: u32,
    /// Whether the vehicle floats. It has then moved for a long time while the cable was stationary, and has not been
    /// at rest since.
    floats: bool,
    /// Time of the filter's first estimate. The pilot is asked to keep still from then on.
    asks_from: Option<MonoNs>,
}

/// Means over successive averaging windows. Each mean is compared with the first mean of a steady series.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
struct Means {
    since: Option<MonoNs>,
    sum: [f64; 3],
    count: f64,
    first: Option<[f64; 3]>,
    alike: u32,
    /// Latest mean of a window, until [`RestDetector::take_mean_rate`] takes it.
    latest: Option<[f64; 3]>,
}

impl Means {
    /// Adds a sample; returns whether the sample ended an averaging window.
    fn take(&mut self, at: MonoNs, value: [f64; 3], same: f64) -> bool {
        let since = *self.since.get_or_insert(at);
        let ends = at.since(since).0 >= MEAN_OVER.0;
        if ends {
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
        ends
    }
}

impl RestDetector {
    /// Processes a reading of the cable counter or of an inertial unit.
    pub fn take(&mut self, at: MonoNs, kind: SensorKind, reading: &Reading) {
        match (kind, reading) {
            (SensorKind::Imu, Reading::AngularRate(rate)) => {
                if at.since(self.cable_at).0 > MEAN_OVER.0 {
                    // A silent counter does not show that the cable is stationary, so the cable counts as moving.
                    self.moved();
                }
                let ended = self.rate.take(at, [rate.x(), rate.y(), rate.z()], SAME_RATE);
                if ended && self.cable_still {
                    self.floated = if self.is_still() { 0 } else { self.floated.saturating_add(1) };
                    self.floats = !self.is_still() && (self.floats || self.floated > FLOATS);
                }
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
                    self.note_pause(at);
                    self.moved();
                }
            }
            _ => {}
        }
    }

    fn moved(&mut self) {
        self.cable_still = false;
        (self.rate.alike, self.force.alike, self.floated) = (0, 0, 0);
    }

    /// Records how long the cable has paused before its present movement.
    fn note_pause(&mut self, at: MonoNs) {
        if let Some(before) = self.cable_moved_at.replace(at) {
            self.pauses.rotate_left(1);
            if let Some(latest) = self.pauses.last_mut() {
                *latest = at.since(before);
            }
        }
    }

    /// Whether the cable has been stationary for much longer than in its recent pauses.
    fn cable_rests(&self) -> bool {
        let longest = self.pauses.iter().map(|pause| pause.0.unsigned_abs()).max().unwrap_or(0);
        self.cable_moved_at.is_none_or(|moved_at| {
            self.cable_at.since(moved_at).0.unsigned_abs() >= PAUSES_TO_REST.saturating_mul(longest)
        })
    }

    /// Whether the vehicle is at rest. Gyros and accelerometers have then been steady for `MEANS` windows, and the
    /// cable has been stationary.
    pub fn is_still(&self) -> bool {
        self.rate.alike >= MEANS && self.force.alike >= MEANS && self.cable_still && self.cable_rests()
    }

    /// Returns the mean turn rate of the last window at rest, rad/s, once for each window.
    pub fn take_mean_rate(&mut self) -> Option<Vec3<Sensor>> {
        let [x, y, z] = self.rate.latest.take()?;
        self.rested = self.rested.saturating_add(1);
        Some(Vec3::new(x, y, z))
    }

    /// Records the time of the first estimate, from which on the pilot is asked to keep still. Later calls have no
    /// effect.
    pub fn ask_from(&mut self, at: MonoNs) {
        self.asks_from.get_or_insert(at);
    }

    /// Returns how many more seconds the vehicle should stand still until the gyro bias is known.
    ///
    /// 0 if the vehicle floats or its inertial unit is too noisy, because then no stop counts as rest. Also 0 once the
    /// first minute is over, because the gyro bias seldom makes passes uncertain later in a dive.
    pub fn stop_left_s(&self, now: MonoNs) -> u32 {
        let left_s = ENOUGH.saturating_sub(self.rested);
        let begins = self.asks_from.is_some_and(|from| (0..ASKS_FOR.0).contains(&now.since(from).0));
        if left_s == 0 || self.floats || !begins {
            return 0;
        }
        left_s + MEANS - self.rate.alike.min(self.force.alike).min(MEANS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_geometry::math;
    use headrace_sensor::reading::TetherLength;

    /// Whether the vehicle is at rest after twenty seconds with this turn rate and cable length.
    fn still(rate: impl Fn(f64) -> f64, way_m: impl Fn(f64) -> Option<f64>) -> bool {
        let mut stillness = RestDetector::default();
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
                &Reading::TetherLength(TetherLength { length_m, resolution_m: 0.001, restart: None }),
            );
        }
        stillness.is_still()
    }

    #[test]
    fn vehicle_on_deck_is_at_rest_but_floating_vehicle_is_not() {
        assert!(still(|_| 0.003, |_| Some(0.0)), "biases and noise are no motion");
        assert!(!still(|t| 0.01 * math::sin(t / 2.0), |_| Some(0.0)), "the vehicle turns to and fro");
        assert!(!still(|_| 0.0, |t| Some(0.05 * t)), "the cable runs");
        assert!(!still(|_| 0.0, |t| (t < 5.0).then_some(0.0)), "the counter fell silent");
        assert!(
            still(|_| 0.0, |t| (!(2.0..5.0).contains(&t)).then_some(0.0)),
            "the counter returned and is still"
        );
    }

    /// The cable is wound in half a metre at a time. It pauses for longer than the averaging windows for rest, while
    /// the vehicle moves on.
    ///
    /// The vehicle is at rest once the cable has been stationary for twice the time between the last pulls.
    #[test]
    fn vehicle_is_not_at_rest_between_pulls_of_the_cable() {
        let pulled = |speed_mps: f64, t: f64| 0.5 * math::floor_to_i64(2.0 * speed_mps * t) as f64;
        let mut stillness = RestDetector::default();
        let mut rested_s = 0_u32;
        for k in 0..9000_u32 {
            let (at, t) = (MonoNs(u64::from(k) * 10_000_000), f64::from(k) / 100.0);
            stillness.take(at, SensorKind::Imu, &Reading::AngularRate(Vec3::zero()));
            stillness.take(at, SensorKind::Imu, &Reading::SpecificForce(Vec3::new(0.0, 0.0, 9.8)));
            // The cable is pulled once every 7 s, for 63 s.
            let length_m = pulled(0.5 / 7.0, t.min(63.5));
            let length = TetherLength { length_m, resolution_m: 0.001, restart: None };
            stillness.take(
                at,
                SensorKind::Tether { zero_at_m: 0.0, scale: 1.0 },
                &Reading::TetherLength(length),
            );
            rested_s =
                rested_s.max(if stillness.is_still() && (14.0..76.0).contains(&t) { k / 100 } else { 0 });
        }
        assert_eq!(rested_s, 0, "the vehicle moved on");
        assert!(stillness.is_still(), "the cable has been stationary for 27 s");
    }

    /// Returns how many more seconds of standing still are required at `end_s`, with this turn rate and cable
    /// length.
    fn stop_left_s(rate: impl Fn(f64) -> f64, way_m: impl Fn(f64) -> f64, end_s: u32) -> u32 {
        let mut stillness = RestDetector::default();
        stillness.ask_from(MonoNs(0));
        for k in 0..100 * end_s {
            let (at, t) = (MonoNs(u64::from(k) * 10_000_000), f64::from(k) / 100.0);
            stillness.take(at, SensorKind::Imu, &Reading::AngularRate(Vec3::new(0.0, 0.0, rate(t))));
            stillness.take(at, SensorKind::Imu, &Reading::SpecificForce(Vec3::new(0.0, 0.0, 9.8)));
            let tether = SensorKind::Tether { zero_at_m: 0.0, scale: 1.0 };
            let length = TetherLength { length_m: way_m(t), resolution_m: 0.001, restart: None };
            stillness.take(at, tether, &Reading::TetherLength(length));
            if stillness.is_still() {
                stillness.take_mean_rate();
            }
        }
        stillness.stop_left_s(MonoNs(u64::from(end_s) * 1_000_000_000))
    }

    #[test]
    fn floating_vehicle_is_not_asked_to_stand_still_again() {
        let sways = |t: f64| 0.01 * math::sin(t / 2.0);
        let set_off = |t: f64| (t - 40.0).max(0.0) * 0.1;
        assert_eq!(stop_left_s(|_| 0.0, |_| 0.0, 35), 0, "the vehicle has stood still long enough");
        assert_eq!(stop_left_s(|_| 0.0, |t| 0.1 * t, 35), 30, "the vehicle has never stood still");
        assert_eq!(stop_left_s(sways, |_| 0.0, 10), 30, "the vehicle may still come to rest");
        assert_eq!(stop_left_s(sways, |_| 0.0, 35), 0, "the vehicle is floating");
        assert_eq!(stop_left_s(sways, set_off, 55), 0, "the vehicle was floating before");
        let lands = |t: f64| if t < 30.0 { sways(t) } else { 0.0 };
        assert!((15..30).contains(&stop_left_s(lands, |_| 0.0, 45)), "the vehicle now stands still");
        // The vehicle moves slowly, and its coarse counter pauses between steps.
        assert_eq!(stop_left_s(sways, |t| math::floor_to_i64(2.0 * t) as f64 * 0.01, 55), 30);
        assert_eq!(stop_left_s(|_| 0.0, |t| 0.1 * t, 61), 0, "the dive is under way");
        let mut set_back = RestDetector::default();
        set_back.ask_from(MonoNs(3_600_000_000_000));
        assert_eq!(set_back.stop_left_s(MonoNs(0)), 0, "the clock was set back by an hour");
    }
}
