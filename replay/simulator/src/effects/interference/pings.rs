//! A head's pings, as other heads hear them.

use headrace_geometry::frames::{Point3, Tunnel, Vec3};
use headrace_geometry::math;
use headrace_geometry::time::{DurNs, MonoNs};

use crate::effects::geometry::{between_rad, dot};
use crate::environment::Environment;
use crate::sensing::Ray;

/// Difference below which two directions count as equal, radians.
const SAME_RAD: f64 = 1e-9;
/// Maximum number of pings extrapolated at once.
const MOST_FORESEEN: u32 = 16;

/// A ping: time, origin, direction, and the point where it meets the wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ping {
    pub(super) at: MonoNs,
    pub(super) origin: Point3<Tunnel>,
    pub(super) direction: Vec3<Tunnel>,
    pub(super) wall: Option<Point3<Tunnel>>,
    /// Whether the ping is extrapolated, so that its `wall` isn't computed yet.
    foreseen: bool,
}

/// A head's pings in order of time.
#[derive(Debug, Clone, Default)]
pub(super) struct Pings(Vec<Ping>);

impl Ping {
    /// Creates a ping along a ray. A ping that the vehicle itself stops reaches no wall.
    pub(super) fn new(at: MonoNs, ray: &Ray, stopped: bool) -> Self {
        let wall = ray.hit.filter(|_| !stopped).map(|hit| hit.point);
        Self { at, origin: ray.origin, direction: ray.direction, wall, foreseen: false }
    }

    /// Computes where the ping meets the wall, if the ping is extrapolated.
    pub(super) fn seen(self, environment: &Environment, far_m: f64) -> Self {
        if !self.foreseen {
            return self;
        }
        let wall = environment.cast(self.origin, self.direction, far_m).map(|hit| hit.point);
        Self { wall, foreseen: false, ..self }
    }

    /// Extrapolates to the `count`-th ping after this one. Interval and rotation between pings stay as they were from
    /// `before` to this ping.
    fn foreseen(&self, before: &Self, count: u32) -> Self {
        let period = self.at.since(before.at);
        let step_rad = between_rad(before.direction, self.direction);
        let on_rad = step_rad * f64::from(count);
        let direction = if step_rad < SAME_RAD {
            self.direction
        } else {
            let square = before.direction + self.direction.scaled(-dot(before.direction, self.direction));
            let onward = square.scaled(-1.0 / square.norm());
            let (sine, cosine) = math::sin_cos(on_rad);
            self.direction.scaled(cosine) + onward.scaled(sine)
        };
        let at = self.at + DurNs(period.0 * i64::from(count));
        Self { at, direction, wall: None, foreseen: true, ..*self }
    }
}

impl Pings {
    /// Drops pings that began more than `rings_s` before the time `from`. The last two pings are kept for
    /// extrapolation.
    pub(super) fn forget(&mut self, from: MonoNs, rings_s: f64) {
        let old = |ping: &Ping| from.since(ping.at).as_secs_f64() > rings_s;
        let gone = self.0.partition_point(old).min(self.0.len().saturating_sub(2));
        self.0.drain(..gone);
    }

    /// Adds the head's next ping.
    pub(super) fn add(&mut self, ping: Ping) {
        self.0.push(ping);
    }

    /// Pings from `earliest_s` to `latest_s` after `at`.
    ///
    /// Pings up to `at` are simulated ones. Later pings are extrapolated, so that the result doesn't depend on how far
    /// the simulation has run.
    pub(super) fn around(
        &self,
        at: MonoNs,
        earliest_s: f64,
        latest_s: f64,
    ) -> impl Iterator<Item = Ping> + '_ {
        let after_s = move |ping: &Ping| ping.at.since(at).as_secs_f64();
        let (made, _) = self.0.split_at(self.0.partition_point(|ping| ping.at <= at));
        let past = made.iter().rev().take_while(move |ping| after_s(ping) >= earliest_s).copied();
        let last = if let [.., before, last] = made { Some((before, last)) } else { None };
        let later = (1..=MOST_FORESEEN).map_while(move |count| {
            let (before, last) = last.filter(|(before, last)| before.at < last.at)?;
            // Usually the next ping comes after `latest_s`, so its time is checked before the ping is extrapolated.
            let period_s = last.at.since(before.at).as_secs_f64();
            let on_s = after_s(last) + period_s * f64::from(count);
            (on_s <= latest_s).then(|| last.foreseen(before, count))
        });
        past.chain(later)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ping(at_ms: i64, angle_rad: f64) -> Ping {
        let (sine, cosine) = math::sin_cos(angle_rad);
        let ray =
            Ray { origin: Point3::new(0.0, 0.0, 0.0), direction: Vec3::new(0.0, sine, -cosine), hit: None };
        Ping::new(MonoNs(1_000_000_000) + DurNs::from_millis(at_ms), &ray, false)
    }

    #[test]
    fn future_pings_are_extrapolated_from_the_last_two() {
        let mut pings = Pings::default();
        for k in 0..100 {
            pings.add(ping(20 * k, f64::from(i32::try_from(k).unwrap()) * 0.02));
        }
        let at = MonoNs(1_000_000_000) + DurNs::from_millis(1001);
        let around: Vec<Ping> = pings.around(at, -0.05, 0.05).collect();
        let after_ms: Vec<i64> = around.iter().map(|ping| ping.at.since(at).0 / 1_000_000).collect();
        assert_eq!(after_ms, [-1, -21, -41, 19, 39]);
        for (foreseen, made) in around[3..].iter().zip(&pings.0[51..]) {
            assert_eq!(foreseen.at, made.at);
            assert!((foreseen.direction + -made.direction).norm() < 1e-12);
        }
        // Pings after `at` are extrapolated, so the result is the same if the simulated pings after `at` are missing.
        let short = Pings(pings.0[..51].to_vec());
        assert!(short.around(at, -0.05, 0.05).eq(pings.around(at, -0.05, 0.05)));
    }

    #[test]
    fn old_pings_are_dropped_except_the_last_two() {
        let mut pings = Pings((0..10).map(|k| ping(20 * k, 0.0)).collect());
        let from = |ms| MonoNs(1_000_000_000) + DurNs::from_millis(ms);
        pings.forget(from(200), 0.05);
        assert_eq!(pings.0.len(), 2);
        pings.forget(from(900), 0.05);
        assert_eq!(pings.0.len(), 2);
    }
}
