//! How a vehicle swings about: yaw and pitch sweep its beams along the tunnel between two passes over a place.

use headrace_geometry::frames::{Tunnel, Vec3};
use headrace_geometry::math;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_snapshot::stateful;

/// Beats that are remembered: at five a second the time looked back on, and a turn of a head in its slowest mode before.
const BEATS: usize = 320;
/// How far back a swing counts: a vehicle that swings to and fro within a minute shows all its swing in half of it.
const WINDOW: DurNs = DurNs(30_000_000_000);
/// Turning by less than this between two passes isn't told from the wandering of navigation, radians; by twice as much it
/// counts in full.
const DEAD_RAD: f64 = 0.0075;

/// How a vehicle swings.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Swing {
    /// By how much it turns between two passes, a second, at most, rad/s.
    pub rate_radps: f64,
    /// By how much it turns however long one waits, at most, radians.
    pub most_rad: f64,
}

/// Which way a vehicle looked at the last beats.
#[derive(Debug, Clone)]
pub struct Looks {
    looks: Vec<(MonoNs, Vec3<Tunnel>)>,
    count: usize,
}

stateful!(Looks { state: count; lists: looks; });

impl Default for Looks {
    /// Allocates: all that it will ever use.
    fn default() -> Self {
        Self { looks: Vec::with_capacity(BEATS), count: 0 }
    }
}

impl Looks {
    /// Remembers which way the vehicle looks, its own x axis in the tunnel's frame.
    ///
    /// Allocates: never.
    pub fn keep(&mut self, at: MonoNs, look: Vec3<Tunnel>) {
        if self.looks.len() < BEATS {
            self.looks.push((at, look));
        } else if let Some(slot) = self.looks.get_mut(self.count % BEATS) {
            *slot = (at, look);
        }
        self.count += 1;
    }

    /// How far it has turned from a look to any of those since a time, at most, radians.
    pub fn turned_since(&self, look: Vec3<Tunnel>, since: MonoNs) -> f64 {
        let recent = self.newest_first().take_while(|(then, _)| *then >= since);
        recent.map(|(_, then)| (look + -*then).norm()).fold(0.0, f64::max)
    }

    /// How the vehicle has swung within the last half minute up to `now`, passes being `gap_s` apart: the most in that
    /// time, so that it stays while the vehicle swings to and fro.
    ///
    /// What navigation's own wandering may be is left out, and comes in without a step.
    /// Allocates: never.
    pub fn swing(&self, now: MonoNs, gap_s: f64) -> Swing {
        if !(gap_s > 0.0 && gap_s.is_finite()) {
            return Swing::default();
        }
        let gap = DurNs::from_secs_f64(gap_s.min(1e3));
        let recent = || self.newest_first().take_while(|(at, _)| now.since(*at).0 <= WINDOW.0);
        let oldest = self.newest_first().last().map(|(_, look)| *look);
        let mut turned_rad = 0.0_f64;
        let mut earlier = self.newest_first().peekable();
        for (at, look) in recent() {
            // Both go back in time: the pass before is never later than that of the look before.
            while earlier.peek().is_some_and(|(then, _)| at.since(*then).0 < gap.0) {
                earlier.next();
            }
            // Of a gap that reaches back beyond what is known, what is known counts.
            let before = earlier.peek().map(|(_, before)| *before).or(oldest);
            turned_rad = turned_rad.max(before.map_or(0.0, |before| (*look + -before).norm()));
        }
        let counted = (2.0 - 2.0 * DEAD_RAD / turned_rad.max(DEAD_RAD)).min(1.0);
        let extent = |of: fn(&Vec3<Tunnel>) -> f64| {
            let values = || recent().map(|(_, look)| of(look));
            (values().fold(f64::MIN, f64::max) - values().fold(f64::MAX, f64::min)).max(0.0)
        };
        let most_rad = math::hypot(extent(Vec3::y), extent(Vec3::z)).max(turned_rad);
        Swing { rate_radps: counted * turned_rad / gap_s, most_rad: counted * most_rad }
    }

    fn newest_first(&self) -> impl Iterator<Item = &(MonoNs, Vec3<Tunnel>)> {
        (0..self.looks.len()).filter_map(|k| self.looks.get((self.count - 1 - k) % BEATS))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_geometry::math::TAU;

    const BEAT: i64 = 200_000_000;

    /// Looks of a vehicle whose yaw and pitch are these, radians, at times in seconds.
    fn looks(seconds: f64, yaw_pitch: impl Fn(f64) -> [f64; 2]) -> (Looks, MonoNs) {
        let mut looks = Looks::default();
        let mut at = MonoNs(7 * BEAT as u64);
        for _ in 0..headrace_geometry::math::round_to_i64(seconds * 5.0) {
            at = at + DurNs(BEAT);
            let [yaw, pitch] = yaw_pitch(at.as_secs_f64());
            looks.keep(at, Vec3::new(math::cos(yaw), math::sin(yaw), -math::sin(pitch)));
        }
        (looks, at)
    }

    #[test]
    fn a_steady_swing_is_measured_and_stays_while_it_goes_to_and_fro() {
        let swinging = |t: f64| [0.1 * math::sin(TAU * t / 20.0), 0.0];
        for seconds in [60.0, 63.0, 65.0, 68.4, 200.0] {
            let (looks, now) = looks(seconds, swinging);
            let swing = looks.swing(now, 2.0);
            // Between two passes a sine turns by 2 A sin(omega t / 2) at most.
            let expected = 0.2 * math::sin(TAU * 2.0 / 40.0) / 2.0;
            assert!((swing.rate_radps / expected - 1.0).abs() < 0.01, "{seconds}: {swing:?}, {expected}");
            assert!((swing.most_rad / 0.2 - 1.0).abs() < 0.01, "{swing:?}");
        }
    }

    #[test]
    fn it_is_forgotten_half_a_minute_after_it_has_ended() {
        let ended = |t: f64| [if t < 50.0 { 0.1 * math::sin(TAU * t / 10.0) } else { 0.0 }, 0.0];
        let (now, still) = (looks(75.0, ended), looks(90.0, ended));
        assert!(now.0.swing(now.1, 2.0).rate_radps > 0.02);
        assert_eq!(still.0.swing(still.1, 2.0), Swing::default());
    }

    #[test]
    fn a_steady_heading_and_navigation_s_wandering_are_no_swing() {
        assert_eq!(Looks::default().swing(MonoNs(0), 2.0), Swing::default());
        let (askew, now) = looks(40.0, |_| [0.3, -0.1]);
        assert_eq!(askew.swing(now, 8.0), Swing::default());
        let jitter = |t: f64| [2e-4 * math::sin(1e3 * t), 0.002 * math::sin(t / 9.0)];
        let (wandering, now) = looks(40.0, jitter);
        assert_eq!(wandering.swing(now, 2.0), Swing::default());
    }

    #[test]
    fn it_comes_in_without_a_step_and_counts_in_full() {
        let ramp = |rad: f64| {
            let (looks, now) = looks(40.0, move |t| [rad * math::sin(TAU * t / 4.0), 0.0]);
            looks.swing(now, 2.0).rate_radps * 2.0
        };
        let (mut before, mut largest) = (0.0, 0.0_f64);
        for k in 0..200 {
            let counted = ramp(5e-5 * f64::from(k));
            largest = largest.max(counted - before);
            before = counted;
        }
        assert!(largest < 4e-4, "{largest}");
        assert!((ramp(0.05) - 0.1).abs() < 1e-3);
    }

    #[test]
    fn pitch_counts_as_yaw_does_and_of_a_long_gap_what_is_known() {
        let (looks, now) = looks(10.0, |t| [0.0, 0.1 * math::sin(TAU * t / 20.0)]);
        assert!(looks.swing(now, 2.0).rate_radps > 0.02);
        // From the oldest look that is known to the one farthest from it.
        let turned_rad = looks.swing(now, 60.0).rate_radps * 60.0;
        assert!((turned_rad - 0.09).abs() < 0.01, "{turned_rad}");
        assert_eq!(looks.swing(now, f64::NAN), Swing::default());
    }
}
