//! How fast one may go, from what is measured now.

use super::spacing::{self, Sweep};
use crate::frames::{Mount, Pose};
use crate::math::{self, TAU};
use crate::tunnel::Profile;

/// The most heads of one vehicle.
pub const MAX_HEADS: usize = 8;
/// Share of the speed kept back for the error of its measurement.
pub const SPEED_MARGIN: f64 = 0.01;

/// What has been measured of one head that is turning.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeadMotion {
    /// How it sits on the vehicle.
    pub mount: Mount,
    /// Its angle now, in the sensor's frame, radians.
    pub angle_rad: f64,
    /// Angle turned per second, positive where the angle grows.
    pub rate_radps: f64,
    /// Angle between two pings, radians, positive.
    pub step_rad: f64,
    /// Size of the sector between its last turning points; `None` while it turns on.
    pub sector_rad: Option<f64>,
}

impl HeadMotion {
    /// Time of a whole turn at this rate, seconds.
    pub fn turn_period_s(&self) -> f64 {
        TAU / self.rate_radps.abs()
    }

    /// Time between two pings, seconds.
    pub fn ping_period_s(&self) -> f64 {
        self.step_rad / self.rate_radps.abs()
    }
}

/// Everything that the advice depends on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Situation {
    /// Where the vehicle is; `None` without a fix.
    pub pose: Option<Pose>,
    /// Speed along the tunnel, m/s.
    pub speed_mps: f64,
    /// The heads that are turning and give returns.
    pub heads: [Option<HeadMotion>; MAX_HEADS],
}

/// Why the advice is what it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reason {
    /// The distance between passes decides: slower helps.
    HelixPitch,
    /// The angle between pings alone gives gaps as large as the target: slower won't help, another mode or place would.
    AngularStep,
    /// Without a position and heading nothing can be said.
    NoHeadingOrFix,
    /// No head gives returns.
    NoReturns,
}

impl Reason {
    /// The word used in reports and logs.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::HelixPitch => "helix_pitch",
            Self::AngularStep => "angular_step",
            Self::NoHeadingOrFix => "no_heading_or_fix",
            Self::NoReturns => "no_returns",
        }
    }
}

/// The advice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Advice {
    /// The largest speed at which the target is met, m/s; zero where none is.
    pub v_max_mps: f64,
    /// What decides.
    pub reason: Reason,
    /// T_max predicted at the present speed, m; `None` where nothing can be said.
    pub predicted_t_m: Option<f64>,
    /// The longest time between two passes over a place, seconds.
    pub pass_gap_s: f64,
    /// What that time would be if the heads' passes were spread evenly, seconds.
    pub even_pass_gap_s: f64,
    /// The largest distance between neighbours of one turn, m.
    pub t_y_m: f64,
    /// Time between two pings, seconds; the longest of any head.
    pub ping_period_s: f64,
}

impl Advice {
    fn nothing(reason: Reason) -> Self {
        Self {
            v_max_mps: 0.0,
            reason,
            predicted_t_m: None,
            pass_gap_s: 0.0,
            even_pass_gap_s: 0.0,
            t_y_m: 0.0,
            ping_period_s: 0.0,
        }
    }
}

/// How far the vehicle may move across the tunnel, m, or turn, as a quaternion's component (half an angle, rad), before
/// its largest steps along the wall are worked out anew. Both change them by well under the speed margin.
const STILL_M: f64 = 0.01;
const STILL_TURN: f64 = 0.002;

/// The largest step of each head, remembered while the vehicle keeps its place in the section.
#[derive(Debug, Clone, Copy, Default)]
pub struct StepMemory {
    heads: [Option<Remembered>; MAX_HEADS],
}

#[derive(Debug, Clone, Copy)]
struct Remembered {
    place_m: [f64; 2],
    attitude: [f64; 4],
    step_rad: f64,
    largest_m: f64,
}

impl StepMemory {
    fn largest_step_m(
        &mut self,
        number: usize,
        head: &HeadMotion,
        pose: &Pose,
        profile: &Profile,
    ) -> Option<f64> {
        let place_m = [pose.position.y(), pose.position.z()];
        let attitude = pose.attitude.wxyz();
        let near = |a: &[f64], b: &[f64], by: f64| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= by);
        let slot = self.heads.get_mut(number)?;
        let holds = |known: &&mut Remembered| {
            near(&known.place_m, &place_m, STILL_M)
                && near(&known.attitude, &attitude, STILL_TURN)
                && near(&[known.step_rad], &[head.step_rad], 1e-9)
        };
        if let Some(known) = slot.as_mut().filter(holds) {
            return Some(known.largest_m);
        }
        // Of a sector the ends aren't known, only the size: the whole turn is looked at, which is the safer answer.
        let sweep = Sweep { at_rad: head.angle_rad, step_rad: head.step_rad, span_rad: TAU };
        let largest_m = spacing::largest_step_m(profile, pose, &head.mount, &sweep)?;
        *slot = Some(Remembered { place_m, attitude, step_rad: head.step_rad, largest_m });
        Some(largest_m)
    }
}

/// The largest speed at which the predicted T_max stays within `target_m`, by inverting Eq. 16 with what is measured:
/// turn period, step, number and phases of the heads as they would meet the wall at that speed, and the vehicle's place
/// and attitude.
///
/// Source: metrics.md, "Speed advice".
pub fn advise(situation: &Situation, profile: &Profile, target_m: f64, memory: &mut StepMemory) -> Advice {
    let Some(pose) = situation.pose else { return Advice::nothing(Reason::NoHeadingOrFix) };
    if !situation.heads.iter().flatten().any(|_| true) {
        return Advice::nothing(Reason::NoReturns);
    }
    let mut t_y_m = 0.0_f64;
    for (number, head) in situation.heads.iter().enumerate() {
        let Some(head) = head else { continue };
        match memory.largest_step_m(number, head, &pose, profile) {
            Some(step_m) => t_y_m = t_y_m.max(step_m),
            None => return Advice::nothing(Reason::NoHeadingOrFix),
        }
    }
    let (pass_gap_s, even_pass_gap_s) = pass_gaps_s(&situation.heads, situation.speed_mps);
    let ping_period_s = situation.heads.iter().flatten().map(HeadMotion::ping_period_s).fold(0.0, f64::max);
    let even_v_max = spacing::speed_for_target_mps(target_m, t_y_m, even_pass_gap_s, ping_period_s);
    let heading = if situation.speed_mps < 0.0 { -1.0 } else { 1.0 };
    let meets = |speed_mps: f64| {
        let (gap_s, _) = pass_gaps_s(&situation.heads, heading * speed_mps);
        spacing::t_max_m(speed_mps * gap_s, speed_mps * ping_period_s, t_y_m) <= target_m
    };
    let speed = situation.speed_mps.abs();
    Advice {
        v_max_mps: even_v_max.map_or(0.0, |fastest| largest_speed_mps(fastest, meets) * (1.0 - SPEED_MARGIN)),
        reason: if even_v_max.is_some() { Reason::HelixPitch } else { Reason::AngularStep },
        predicted_t_m: Some(spacing::t_max_m(speed * pass_gap_s, speed * ping_period_s, t_y_m)),
        pass_gap_s,
        even_pass_gap_s,
        t_y_m,
        ping_period_s,
    }
}

/// The largest speed up to `fastest_mps` that `meets` the target.
///
/// Heads apart along the hull keep their phases at one speed only, so that what meets the target isn't an interval:
/// speeds are tried from above, and the edge of the first that meets it is then closed in on.
fn largest_speed_mps(fastest_mps: f64, meets: impl Fn(f64) -> bool) -> f64 {
    const TRIED: u32 = 64;
    // The bound itself is met but for rounding when the heads are evenly phased.
    let at = |k: u32| fastest_mps * (1.0 - f64::from(k) / f64::from(TRIED)) * (1.0 - 1e-12);
    let Some(first) = (0..TRIED).find(|k| meets(at(*k))) else { return 0.0 };
    let Some(too_fast) = first.checked_sub(1) else { return at(0) };
    let (mut good, mut bad) = (at(first), at(too_fast));
    for _ in 0..20 {
        let middle = f64::midpoint(good, bad);
        if meets(middle) {
            good = middle;
        } else {
            bad = middle;
        }
    }
    good
}

/// The longest time between two passes over a place of the wall, as the heads are phased at this speed, and what it
/// would be if they were phased evenly; seconds.
///
/// Heads that turn on: head k passes body angle zero at the times t_k + i T, and as it sits x_k ahead of the vehicle's
/// origin, on the wall at chainages x_k + v (t_k + i T). Divided by v T these are phases on a circle; the largest gap
/// between neighbours times T is the answer. Heads in sectors: a place near a sector's end waits for a sweep there and
/// back, twice the time of one.
/// Source: Jorge et al. 2021, §5.1 and §5.2.
pub fn pass_gaps_s(heads: &[Option<HeadMotion>; MAX_HEADS], speed_mps: f64) -> (f64, f64) {
    let turning = || heads.iter().flatten();
    let sweep_s = |head: &HeadMotion| head.sector_rad.map(|sector| 2.0 * sector / head.rate_radps.abs());
    if let Some(longest) = turning().filter_map(sweep_s).max_by(f64::total_cmp) {
        return (longest, longest);
    }
    let count = turning().count();
    let turn_s = turning().map(HeadMotion::turn_period_s).fold(0.0, f64::max);
    let even_s = turn_s / count.max(1) as f64;
    // Seen in a mirror, heads that all turn the other way turn this way.
    let body_rate = |head: &HeadMotion| {
        if super::layout::faces_aft(head.mount.rotation) { -head.rate_radps } else { head.rate_radps }
    };
    let mirror = if turning().all(|head| body_rate(head) < 0.0) { -1.0 } else { 1.0 };
    let mut phases = [0.0; MAX_HEADS];
    let mut known = 0;
    for (head, slot) in turning().zip(&mut phases) {
        let aft = super::layout::faces_aft(head.mount.rotation);
        let angle = mirror * if aft { -head.angle_rad } else { head.angle_rad };
        let rate = mirror * body_rate(head);
        if rate <= 0.0 || turn_s <= 0.0 {
            // Heads that turn against each other meet every place at uneven times: count on one of them only.
            return (turn_s, even_s);
        }
        let until_zero_s = math::wrap(-angle, TAU) / rate;
        let ahead_s = if speed_mps.abs() > 1e-3 { head.mount.position.x() / speed_mps } else { 0.0 };
        *slot = math::wrap((until_zero_s + ahead_s) / turn_s, 1.0);
        known += 1;
    }
    let phases = phases.get_mut(..known).unwrap_or_default();
    phases.sort_unstable_by(f64::total_cmp);
    let wrapped = phases.first().zip(phases.last()).map_or(1.0, |(first, last)| first + 1.0 - last);
    let between = phases.windows(2).map(|pair| match pair {
        [a, b] => b - a,
        _ => 0.0,
    });
    (turn_s * between.fold(wrapped, f64::max), even_s)
}

#[cfg(test)]
mod tests {
    use super::{Advice, HeadMotion, MAX_HEADS, Reason, SPEED_MARGIN, Situation, StepMemory, spacing};
    use crate::frames::{Mount, Pose};
    use crate::frames::{Point3, Rot, Vec3};
    use crate::math::TAU;
    use crate::tunnel::Profile;
    use crate::tunnel::named;

    fn advise(situation: &Situation, profile: &Profile, target_m: f64) -> Advice {
        super::advise(situation, profile, target_m, &mut StepMemory::default())
    }

    fn situation(angles_deg: &[f64], x_m: &[f64], speed_mps: f64, profile: &Profile) -> Situation {
        let mut heads = [None; MAX_HEADS];
        for ((slot, angle), x) in heads.iter_mut().zip(angles_deg).zip(x_m) {
            *slot = Some(HeadMotion {
                mount: Mount { position: Vec3::new(*x, 0.0, 0.0), rotation: Rot::identity() },
                angle_rad: angle.to_radians(),
                rate_radps: TAU / 8.0,
                step_rad: f64::to_radians(0.9),
                sector_rad: None,
            });
        }
        let [y, z] = profile.reference();
        let pose = Pose { position: Point3::new(0.0, y, z), attitude: Rot::identity() };
        Situation { pose: Some(pose), speed_mps, heads }
    }

    #[test]
    fn evenly_phased_heads_share_the_turn() {
        let profile = named::ceran().unwrap();
        let advice =
            advise(&situation(&[10.0, 100.0, 190.0, 280.0], &[0.0; 4], 0.2, &profile), &profile, 0.5);
        assert!((advice.pass_gap_s - 2.0).abs() < 1e-9 && (advice.even_pass_gap_s - 2.0).abs() < 1e-12);
        assert_eq!(advice.reason, Reason::HelixPitch);
        let at_v_max = spacing::t_max_m(
            advice.v_max_mps / (1.0 - SPEED_MARGIN) * advice.pass_gap_s,
            advice.v_max_mps / (1.0 - SPEED_MARGIN) * advice.ping_period_s,
            advice.t_y_m,
        );
        assert!((at_v_max - 0.5).abs() < 1e-9);
    }

    #[test]
    fn a_broken_phase_shows_as_a_longer_gap() {
        let profile = named::ceran().unwrap();
        let together = advise(&situation(&[0.0, 0.0], &[0.0, 0.0], 0.2, &profile), &profile, 2.0);
        assert!((together.pass_gap_s - 8.0).abs() < 1e-9 && (together.even_pass_gap_s - 4.0).abs() < 1e-12);
        // Half a pitch apart along the hull, the same angles interleave: 0.2 m/s, 8 s a turn, 0.8 m.
        let apart = advise(&situation(&[0.0, 0.0], &[0.8, 0.0], 0.2, &profile), &profile, 2.0);
        assert!((apart.pass_gap_s - 4.0).abs() < 1e-9);
    }

    #[test]
    fn the_largest_speed_is_one_at_which_the_phases_of_heads_apart_hold() {
        let profile = named::ceran().unwrap();
        let target_m = 1.0;
        let now = situation(&[0.0, 0.0], &[0.8, 0.0], 0.2, &profile);
        let advice = advise(&now, &profile, target_m);
        let t_at = |speed_mps: f64| {
            let gap_s = super::pass_gaps_s(&now.heads, speed_mps).0;
            spacing::t_max_m(speed_mps * gap_s, speed_mps * advice.ping_period_s, advice.t_y_m)
        };
        let v_max = advice.v_max_mps / (1.0 - SPEED_MARGIN);
        assert!((t_at(v_max) - target_m).abs() < 1e-6, "{v_max}: {}", t_at(v_max));
        assert!(t_at(1.02 * v_max) > target_m);
        // Evenly spread at every speed, they could go faster.
        let even = spacing::speed_for_target_mps(target_m, advice.t_y_m, 4.0, advice.ping_period_s).unwrap();
        assert!(v_max < 0.99 * even, "{v_max} and {even}");
        // The advice doesn't depend on how fast one goes while it is given.
        let faster = advise(&Situation { speed_mps: 0.5, ..now }, &profile, target_m);
        assert!((faster.v_max_mps - advice.v_max_mps).abs() < 1e-12);
    }

    #[test]
    fn heads_that_all_turn_the_other_way_are_phased_alike() {
        let profile = named::ceran().unwrap();
        let mut mirrored = situation(&[0.0, 180.0], &[0.0, 0.0], 0.2, &profile);
        for head in mirrored.heads.iter_mut().flatten() {
            head.rate_radps = -head.rate_radps;
        }
        let (gap_s, even_s) = super::pass_gaps_s(&mirrored.heads, 0.2);
        assert!((gap_s - 4.0).abs() < 1e-9 && (even_s - 4.0).abs() < 1e-12);
    }

    #[test]
    fn on_the_way_back_the_phases_of_the_way_back_count() {
        let profile = named::ceran().unwrap();
        let back = situation(&[30.0, 250.0], &[0.9, -0.3], -0.2, &profile);
        let advice = advise(&back, &profile, 1.0);
        let v = advice.v_max_mps / (1.0 - SPEED_MARGIN);
        let gap_s = super::pass_gaps_s(&back.heads, -v).0;
        assert!(spacing::t_max_m(v * gap_s, v * advice.ping_period_s, advice.t_y_m) <= 1.0 + 1e-6);
    }

    #[test]
    fn where_slower_does_not_help_it_says_so() {
        let profile = named::ceran().unwrap();
        let advice = advise(&situation(&[0.0], &[0.0], 0.2, &profile), &profile, 0.1);
        assert_eq!((advice.v_max_mps, advice.reason), (0.0, Reason::AngularStep));
        let mut lost = situation(&[0.0], &[0.0], 0.2, &profile);
        lost.pose = None;
        assert_eq!(advise(&lost, &profile, 0.5).reason, Reason::NoHeadingOrFix);
        let blind = situation(&[], &[], 0.2, &profile);
        assert_eq!(advise(&blind, &profile, 0.5).reason, Reason::NoReturns);
    }
}
