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

/// The largest speed at which the predicted T_max stays within `target_m`, by inverting Eq. 16 with what is measured:
/// turn period, step, number and phases of the heads, and the vehicle's place and attitude.
///
/// Source: metrics.md, "Speed advice".
pub fn advise(situation: &Situation, profile: &Profile, target_m: f64) -> Advice {
    let Some(pose) = situation.pose else { return Advice::nothing(Reason::NoHeadingOrFix) };
    if !situation.heads.iter().flatten().any(|_| true) {
        return Advice::nothing(Reason::NoReturns);
    }
    let mut t_y_m = 0.0_f64;
    for head in situation.heads.iter().flatten() {
        let span_rad = head.sector_rad.unwrap_or(TAU);
        let sweep = Sweep { at_rad: head.angle_rad, step_rad: head.step_rad, span_rad };
        match spacing::largest_step_m(profile, &pose, &head.mount, &sweep) {
            Some(step_m) => t_y_m = t_y_m.max(step_m),
            None => return Advice::nothing(Reason::NoHeadingOrFix),
        }
    }
    let (pass_gap_s, even_pass_gap_s) = pass_gaps_s(&situation.heads, situation.speed_mps);
    let ping_period_s = situation.heads.iter().flatten().map(HeadMotion::ping_period_s).fold(0.0, f64::max);
    let v_max = spacing::speed_for_target_mps(target_m, t_y_m, pass_gap_s, ping_period_s);
    let speed = situation.speed_mps.abs();
    Advice {
        v_max_mps: v_max.map_or(0.0, |v| v * (1.0 - SPEED_MARGIN)),
        reason: if v_max.is_some() { Reason::HelixPitch } else { Reason::AngularStep },
        predicted_t_m: Some(spacing::t_max_m(speed * pass_gap_s, speed * ping_period_s, t_y_m)),
        pass_gap_s,
        even_pass_gap_s,
        t_y_m,
        ping_period_s,
    }
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
    let mut phases = [0.0; MAX_HEADS];
    let mut known = 0;
    for (head, slot) in turning().zip(&mut phases) {
        let aft = super::layout::faces_aft(head.mount.rotation);
        let angle = if aft { -head.angle_rad } else { head.angle_rad };
        let rate = if aft { -head.rate_radps } else { head.rate_radps };
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
    use super::*;
    use crate::frames::{Point3, Rot, Vec3};
    use crate::tunnel::named;

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
