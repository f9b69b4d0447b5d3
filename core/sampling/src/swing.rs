//! Vehicle swing: yaw and pitch that sweep the beams along the tunnel between two passes over a place.

use headrace_geometry::frames::{Tunnel, Vec3};
use headrace_geometry::math;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_geometry::tunnel::Yz;

/// Number of stored directions: at 5 Hz, `WINDOW` plus one turn of a head in its slowest mode.
const BEATS: usize = 320;
/// Length of the past period from which the swing is computed.
///
/// A swing with a period of up to a minute reaches its full extent within half a minute.
const WINDOW: DurNs = DurNs(30_000_000_000);
/// Largest rotation between two passes that is attributed to navigation errors only, radians.
///
/// A rotation of at least twice this value counts fully as swing.
const DEAD_RAD: f64 = 0.0075;
/// If at least this time passes between two stored directions, the history counts as interrupted.
const INTERRUPTED: DurNs = DurNs(1_000_000_000);
/// Lower limit of a direction's component along the tunnel in the computation of displacements.
///
/// The component of a heading 60 degrees off the tunnel's axis has this value.
const LEAST_ALONG: f64 = 0.5;

/// Size and speed of a vehicle's swing.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Swing<'a> {
    /// Largest rotation between two passes, divided by the time between them, rad/s.
    pub rate_radps: f64,
    /// Largest rotation between any two moments of the stored history, radians.
    pub most_rad: f64,
    /// Largest rotation between the passes of two heads that are apart along the hull, divided by the time between
    /// them, rad/s.
    ///
    /// The passes are as far apart in time as the rearmost head needs to reach the position of the foremost head.
    pub apart_rate_radps: f64,
    /// History of the vehicle's directions from which the swing was computed, if known.
    pub history: Option<&'a Looks>,
}

/// History of the directions of the vehicle's x axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Looks {
    looks: Vec<(MonoNs, Vec3<Tunnel>)>,
    count: usize,
}

/// Latest directions of the vehicle's x axis, stored at about equal intervals.
///
/// If positions were missing for a time, directions from before that time are excluded.
#[derive(Debug, Clone, Copy)]
pub struct RecentSwing<'a> {
    looks: &'a Looks,
    /// Index of the oldest included direction, counted from the newest direction.
    last: usize,
    span_s: f64,
}

stateful!(Looks { state: count; lists: looks; });

impl Default for Looks {
    /// Allocates: the full capacity of the history.
    fn default() -> Self {
        Self { looks: Vec::with_capacity(BEATS), count: 0 }
    }
}

impl Looks {
    /// Stores a direction of the vehicle's x axis, in the tunnel frame.
    ///
    /// Allocates: never.
    pub fn keep(&mut self, at: MonoNs, look: Vec3<Tunnel>) {
        debug_assert!((look.norm() - 1.0).abs() < 1e-6, "a direction is a unit vector: {look:?}");
        if self.looks.len() < BEATS {
            self.looks.push((at, look));
        } else if let Some(slot) = self.looks.get_mut(self.count % BEATS) {
            *slot = (at, look);
        }
        self.count += 1;
    }

    /// Returns the largest rotation from the direction `look` to any direction stored since the time `since`,
    /// radians.
    pub fn turned_since(&self, look: Vec3<Tunnel>, since: MonoNs) -> f64 {
        let recent = self.newest_first().take_while(|(then, _)| *then >= since);
        recent.map(|(_, then)| (look + -*then).norm()).fold(0.0, f64::max)
    }

    /// Returns the largest swing in the half minute before `now`.
    ///
    /// The result stays about constant while the vehicle swings to and fro. `gap_s` is the time between passes, and
    /// `apart_s` the time in which all heads pass a place. Rotation so small that navigation errors explain it is
    /// excluded. The result is continuous where the exclusion ends.
    /// Allocates: never.
    pub fn swing(&self, now: MonoNs, gap_s: f64, apart_s: f64) -> Swing<'_> {
        let rate = |over_s: f64| {
            let known = over_s > 0.0 && over_s.is_finite();
            let turned_rad = if known { self.turned_over(now, over_s) } else { 0.0 };
            (turned_rad, if known { counted(turned_rad) * turned_rad / over_s } else { 0.0 })
        };
        let ((turned_rad, rate_radps), (apart_rad, apart_rate_radps)) = (rate(gap_s), rate(apart_s));
        let largest_rad = turned_rad.max(apart_rad);
        let extent = |of: fn(&Vec3<Tunnel>) -> f64| {
            let values = || self.recent(now).map(|(_, look)| of(look));
            (values().fold(f64::MIN, f64::max) - values().fold(f64::MAX, f64::min)).max(0.0)
        };
        let most_rad = math::hypot(extent(Vec3::y), extent(Vec3::z)).max(largest_rad);
        Swing { rate_radps, most_rad: counted(largest_rad) * most_rad, apart_rate_radps, history: Some(self) }
    }

    /// Returns the largest rotation between two moments that are `over_s` apart, radians.
    ///
    /// The later moment is within the half minute before `now`.
    fn turned_over(&self, now: MonoNs, over_s: f64) -> f64 {
        let over = DurNs::from_secs_f64(over_s.min(1e3));
        let oldest = self.newest_first().last().map(|(_, look)| *look);
        let mut turned_rad = 0.0_f64;
        let mut earlier = self.newest_first().peekable();
        for (at, look) in self.recent(now) {
            // Both iterators move back in time, so `earlier` need not start again for each later moment.
            while earlier.peek().is_some_and(|(then, _)| at.since(*then).0 < over.0) {
                earlier.next();
            }
            // If `over_s` exceeds the stored history, the oldest direction is used.
            let before = earlier.peek().map(|(_, before)| *before).or(oldest);
            turned_rad = turned_rad.max(before.map_or(0.0, |before| (*look + -before).norm()));
        }
        turned_rad
    }

    /// Returns the latest directions that were stored without an interruption.
    pub fn uninterrupted(&self) -> RecentSwing<'_> {
        let pairs = self.newest_first().zip(self.newest_first().skip(1));
        let last =
            pairs.take_while(|((newer, _), (older, _))| newer.since(*older).0 <= INTERRUPTED.0).count();
        let ends = self.newest_first().next().zip(self.newest_first().nth(last));
        let span_s = ends.map_or(0.0, |((to, _), (from, _))| to.since(*from).as_secs_f64());
        RecentSwing { looks: self, last, span_s }
    }

    fn nth_newest(&self, k: usize) -> Option<Vec3<Tunnel>> {
        let index = (self.count - 1).checked_sub(k)? % BEATS;
        self.looks.get(index).map(|(_, look)| *look)
    }

    fn recent(&self, now: MonoNs) -> impl Iterator<Item = &(MonoNs, Vec3<Tunnel>)> {
        self.newest_first().take_while(move |(at, _)| now.since(*at).0 <= WINDOW.0)
    }

    fn newest_first(&self) -> impl Iterator<Item = &(MonoNs, Vec3<Tunnel>)> {
        (0..self.looks.len()).filter_map(|k| self.looks.get((self.count - 1 - k) % BEATS))
    }
}

impl RecentSwing<'_> {
    /// Length of the uninterrupted part of the history, seconds.
    pub fn span_s(&self) -> f64 {
        self.span_s
    }

    /// Displacement, along the tunnel, of the point where beams meet the wall at a place, m, some seconds from now.
    ///
    /// `from_vehicle_m` is the position of the place relative to the vehicle: to the left and up. The vehicle is
    /// assumed to go through the directions of the history backwards, then forwards, and so on.
    pub fn displacement_m(&self, seconds: f64, from_vehicle_m: Yz) -> f64 {
        if self.last == 0 || self.span_s <= 0.0 {
            return 0.0;
        }
        let last = self.last as f64;
        let back = math::wrap(seconds / self.span_s * last, 2.0 * last);
        let back = back.min(2.0 * last - back);
        let before = math::floor_to_i64(back);
        let at_m = |k: i64| {
            let look = self.looks.nth_newest(usize::try_from(k).unwrap_or(0).min(self.last));
            displaced_m(look, from_vehicle_m)
        };
        let share = back - before as f64;
        at_m(before) * (1.0 - share) + at_m(before + 1) * share
    }

    /// Smallest and largest displacement, along the tunnel, of the beams that meet the wall at a place, m.
    pub fn displacements_m(&self, from_vehicle_m: Yz) -> [f64; 2] {
        let looks = self.looks.newest_first().take(self.last + 1);
        let all = looks.map(|(_, look)| displaced_m(Some(*look), from_vehicle_m));
        let ends = |ends: Option<[f64; 2]>, m: f64| Some(ends.map_or([m; 2], |[a, b]| [a.min(m), b.max(m)]));
        all.fold(None, ends).unwrap_or_default()
    }
}

/// Displacement, along the tunnel, of the beams that meet the wall at a place, m, if the vehicle's x axis points to
/// `look`.
///
/// The scan plane is normal to the x axis.
fn displaced_m(look: Option<Vec3<Tunnel>>, [y_m, z_m]: Yz) -> f64 {
    look.map_or(0.0, |look| -(y_m * look.y() + z_m * look.z()) / look.x().abs().max(LEAST_ALONG))
}

/// Returns the share of a rotation that is not attributed to navigation errors.
fn counted(turned_rad: f64) -> f64 {
    (2.0 - 2.0 * DEAD_RAD / turned_rad.max(DEAD_RAD)).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_geometry::frames::{Body, Rot};
    use headrace_geometry::math::TAU;

    const BEAT: i64 = 200_000_000;

    /// Directions of a vehicle. `yaw_pitch` returns its yaw and pitch, radians, at a time, s.
    fn looks(seconds: f64, yaw_pitch: impl Fn(f64) -> [f64; 2]) -> (Looks, MonoNs) {
        let mut looks = Looks::default();
        let mut at = MonoNs(7 * BEAT as u64);
        for _ in 0..headrace_geometry::math::round_to_i64(seconds * 5.0) {
            at = at + DurNs(BEAT);
            let [yaw, pitch] = yaw_pitch(at.as_secs_f64());
            let level = math::cos(pitch);
            let look = Vec3::new(level * math::cos(yaw), level * math::sin(yaw), -math::sin(pitch));
            looks.keep(at, look);
        }
        (looks, at)
    }

    #[test]
    fn steady_swing_has_its_full_rate_and_extent_at_any_time() {
        let swinging = |t: f64| [0.1 * math::sin(TAU * t / 20.0), 0.0];
        for seconds in [60.0, 63.0, 65.0, 68.4, 200.0] {
            let (looks, now) = looks(seconds, swinging);
            let swing = looks.swing(now, 2.0, 0.0);
            // In the time t between two passes, a sinusoidal yaw of amplitude A changes by at most 2 A sin(omega t /
            // 2).
            let expected = 0.2 * math::sin(TAU * 2.0 / 40.0) / 2.0;
            assert!((swing.rate_radps / expected - 1.0).abs() < 0.01, "{seconds}: {swing:?}, {expected}");
            assert!((swing.most_rad / 0.2 - 1.0).abs() < 0.01, "{swing:?}");
        }
    }

    #[test]
    fn slow_swing_counts_between_heads_at_different_positions_along_the_hull() {
        // The rotation between passes is within the navigation errors, but the rotation over ten seconds is not.
        let (looks, now) = looks(80.0, |t| [0.02 * math::sin(TAU * t / 50.0), 0.0]);
        let swing = looks.swing(now, 2.0, 10.0);
        let expected = 0.04 * math::sin(TAU * 10.0 / 100.0) / 10.0;
        assert!(swing.rate_radps.abs() <= 0.0, "{swing:?}");
        assert!((swing.apart_rate_radps / expected - 1.0).abs() < 0.02, "{swing:?}");
        assert!(swing.most_rad > 0.03, "{swing:?}");
    }

    #[test]
    fn vehicle_swing_is_forgotten_30_s_after_it_ends() {
        let ended = |t: f64| [if t < 50.0 { 0.1 * math::sin(TAU * t / 10.0) } else { 0.0 }, 0.0];
        let (now, still) = (looks(75.0, ended), looks(90.0, ended));
        assert!(now.0.swing(now.1, 2.0, 0.0).rate_radps > 0.02);
        assert_eq!(Swing { history: None, ..still.0.swing(still.1, 2.0, 0.0) }, Swing::default());
    }

    #[test]
    fn steady_heading_and_navigation_drift_are_no_swing() {
        assert_eq!(Swing { history: None, ..Looks::default().swing(MonoNs(0), 2.0, 0.0) }, Swing::default());
        let (askew, now) = looks(40.0, |_| [0.3, -0.1]);
        assert_eq!(Swing { history: None, ..askew.swing(now, 8.0, 0.0) }, Swing::default());
        let jitter = |t: f64| [2e-4 * math::sin(1e3 * t), 0.002 * math::sin(t / 9.0)];
        let (wandering, now) = looks(40.0, jitter);
        assert_eq!(Swing { history: None, ..wandering.swing(now, 2.0, 0.0) }, Swing::default());
    }

    #[test]
    fn small_swing_is_attenuated_but_large_swing_counts_fully() {
        let ramp = |rad: f64| {
            let (looks, now) = looks(40.0, move |t| [rad * math::sin(TAU * t / 4.0), 0.0]);
            looks.swing(now, 2.0, 0.0).rate_radps * 2.0
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
    fn pass_interval_beyond_the_history_uses_its_oldest_direction() {
        let (looks, now) = looks(10.0, |t| [0.0, 0.1 * math::sin(TAU * t / 20.0)]);
        assert!(looks.swing(now, 2.0, 0.0).rate_radps > 0.02);
        // The largest rotation is from the oldest stored direction to the direction farthest from it.
        let turned_rad = looks.swing(now, 60.0, 0.0).rate_radps * 60.0;
        assert!((turned_rad - 0.09).abs() < 0.01, "{turned_rad}");
        assert_eq!(Swing { history: None, ..looks.swing(now, f64::NAN, 0.0) }, Swing::default());
    }

    /// The vehicle has a yaw of 0.1 rad, then no position for a minute, then no yaw, and at the end a yaw of 0.01 rad.
    #[test]
    fn recent_swing_uses_only_the_directions_after_an_interruption() {
        let mut looks = Looks::default();
        let mut keep = |seconds: f64, yaw: f64| {
            let look = Rot::from_roll_pitch_yaw(0.0, 0.0, yaw) * Vec3::<Body>::new(1.0, 0.0, 0.0);
            looks.keep(MonoNs(0) + DurNs::from_secs_f64(seconds), look);
        };
        (0..100).for_each(|update| keep(0.2 * f64::from(update), 0.1));
        (0..=50)
            .for_each(|update| keep(80.0 + 0.2 * f64::from(update), if update == 50 { 0.01 } else { 0.0 }));
        let recent = looks.uninterrupted();
        assert!((recent.span_s() - 10.0).abs() < 1e-9, "{}", recent.span_s());
        let left_m = [3.0, 0.0];
        let [least_m, most_m] = recent.displacements_m(left_m);
        assert!((least_m + 0.03).abs() < 1e-4 && most_m.abs() < 1e-9, "{least_m} to {most_m} m");
        for (seconds, expected_m) in
            [(0.0, -0.03), (0.1, -0.015), (0.2, 0.0), (10.0, 0.0), (20.0, -0.03), (20.1, -0.015)]
        {
            let found_m = recent.displacement_m(seconds, left_m);
            assert!((found_m - expected_m).abs() < 1e-4, "{seconds} s: {found_m} m");
        }
        assert!(Looks::default().uninterrupted().displacement_m(1.0, left_m).abs() <= 0.0);
    }
}
