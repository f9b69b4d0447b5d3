//! Ping statistics of a section's passage: evidence for the cause of a fail.

use serde::{Deserialize, Serialize};

use headrace_fusion::Fix;
use headrace_fusion::relative::Relative;
use headrace_geometry::frames::Vec3;
use headrace_geometry::math;
use headrace_geometry::tunnel::Profile;
use headrace_sampling::head::HeadSet;
use headrace_sampling::losses::LossRate;

/// Statistics of the pings made within a section.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Passage {
    /// All pings, whatever their outcome.
    pub pings: u32,
    /// Pings with a fix.
    pub placed: u32,
    /// Pings without a return where the wall was within range, or without a fix.
    pub missing: u32,
    /// Pings without a return where the wall was farther than the range setting.
    pub out_of_range: u32,
    /// Pings occluded by the vehicle.
    pub occluded: u32,
    /// Returns without a fix.
    pub unplaced: u32,
    /// Pings of a stalled head.
    pub standing: u32,
    /// Heads that went through without a ping.
    pub silent: HeadSet,
    /// Driving at the moment of the largest T.
    pub drive: Drive,
    /// More pings went by without a fix than are remembered.
    pub unseen: bool,
    /// A ping's place was so unsure against the pass before that its speed says nothing.
    pub adrift: bool,
    /// Relative error between passes, of the newest visit with a ping here.
    pub pass_error: PassError,
}

/// How vehicle and heads moved at a moment.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Drive {
    /// Speed along the tunnel, m/s, without its sign.
    pub speed_mps: f64,
    /// Speed for which the heads are put in phase, m/s; zero if none is planned.
    pub planned_mps: f64,
    /// The longest time between two passes of the heads that turned, seconds.
    pub gap_s: f64,
    /// The same with these heads evenly spread.
    pub even_gap_s: f64,
    /// The same with all heads turning as if none had been silent or stood still.
    pub healthy_gap_s: f64,
    /// The same with all heads' angles as scheduled, at this speed.
    pub planned_gap_s: f64,
    /// The same with all heads evenly spread.
    pub all_gap_s: f64,
    /// `gap_s` at the planned speed; at this one where none is planned.
    pub gap_at_plan_s: f64,
    /// `healthy_gap_s` at that speed.
    pub healthy_at_plan_s: f64,
    /// The same of the heads that turn and never stood still, with their angles as scheduled.
    pub left_at_plan_s: f64,
    /// Time between two pings, seconds.
    pub ping_period_s: f64,
    /// How far the beams have swung along the tunnel since the neighbouring passes, where they reach farthest, m.
    pub swing_m: f64,
    /// Largest step along the perimeter between two pings where the vehicle was, by its geometry, m.
    pub t_y_m: f64,
    /// The same from the middle of the tunnel.
    pub middle_t_y_m: f64,
    /// Largest speed that meets the target from the middle, all heads turning as scheduled; the planned one where that does;
    /// zero where none does, m/s.
    pub fits_mps: f64,
    /// The distance along the tunnel between passes that it leaves room for, m.
    pub fits_along_m: f64,
    /// Passes over each place that it takes for one, as the heads lose returns: see [`headrace_sampling::losses`].
    pub passes_needed: f64,
    /// How often the head loses returns by chance that loses most.
    pub lost: LossRate,
    /// Heads go back and forth in sectors.
    pub is_in_sectors: bool,
    /// A head hasn't been heard since the dive began.
    pub is_unheard: bool,
    /// What other settings of the heads would change.
    pub other: OtherSettings,
}

/// How other settings of the heads compare to the present ones: ratios. A finer step takes longer to go round, and so does a longer range.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct OtherSettings {
    /// Step of the coarsest mode that leaves room for a target, to the present one.
    pub finer_step: f64,
    /// Turn period of that mode to the present one.
    pub finer_turn: f64,
    /// Turn period at the shortest range setting that reaches all wall from the middle to the present one.
    pub longer_turn: f64,
}

impl Default for OtherSettings {
    /// Of heads whose settings aren't known: two modes finer, in the same time.
    fn default() -> Self {
        Self { finer_step: 0.375, finer_turn: 1.0, longer_turn: 1.0 }
    }
}

/// Share of the planned speed below which another one is driven.
const SLOWER: f64 = 0.97;

impl Drive {
    /// The distance between passes with the swing added, had no head been silent or stood still, m.
    pub fn along_m(&self) -> f64 {
        self.speed_mps * self.healthy_gap_s + self.swing_m + self.advance_m()
    }

    /// The distance between passes with all heads turning as scheduled, m.
    pub fn planned_along_m(&self) -> f64 {
        self.speed_mps * self.planned_gap_s
    }

    /// The distance travelled between two pings, m.
    pub fn advance_m(&self) -> f64 {
        self.speed_mps * self.ping_period_s
    }

    /// Whether it went slower than planned, and passes of heads at their scheduled angles were farther apart for it than at the planned speed,
    /// by a factor over `over`: heads apart along the hull are in phase about that speed only. Only where that speed meets the target;
    /// heads that were started wrongly aren't mended by any speed.
    pub fn is_slow_out_of_phase(&self, over: f64) -> bool {
        let is_slower = self.planned_mps > 0.0 && self.speed_mps < SLOWER * self.planned_mps;
        let fits = self.fits_mps >= self.planned_mps;
        is_slower && fits && self.planned_along_m() > over * self.planned_mps * self.all_gap_s
    }

    /// The one with the larger distance between passes.
    #[must_use]
    pub fn or_worse(self, other: Self) -> Self {
        if other.along_m() > self.along_m() { other } else { self }
    }
}

/// Reason a ping gave no sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Loss {
    /// No return, though the wall was within range.
    Missing,
    /// The wall was farther than the range setting.
    OutOfRange,
    /// Occluded by the vehicle.
    Occluded,
}

impl Loss {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Missing, Self::OutOfRange, Self::Occluded];
}

/// Ratio of the error of a section's largest hole to that of the distance between two passes at one point: the maximum
/// favours holes that errors have enlarged. Measured over the field dives of `tests/tests/navigation/fusion.rs`.
const LARGEST_OF_MANY: f64 = 1.2;

/// Error along the tunnel of a pass's samples relative to those of the pass before.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct PassError {
    /// Covariance of the relative errors that move them.
    pub relative: Relative,
    /// Vehicle position in the cross-section, [y, z], m.
    pub from_m: [f64; 2],
}

impl PassError {
    /// From a fix.
    pub fn of(fix: &Fix) -> Self {
        Self { relative: fix.relative, from_m: [fix.pose.position.y(), fix.pose.position.z()] }
    }

    /// Keeps the larger of the two.
    pub fn add(&mut self, other: &Self) {
        if other.relative.sd_m(Vec3::zero()) >= self.relative.sd_m(Vec3::zero()) {
            *self = *other;
        }
    }

    /// The largest standard deviation of a hole's diameter round the profile, m.
    pub fn worst_m(&self, profile: &Profile) -> f64 {
        profile.places().iter().map(|place| self.sd_m(*place)).fold(0.0, f64::max)
    }

    /// Whether that is over a limit, m: most passes aren't by far, which is known without looking round the profile.
    pub fn exceeds(&self, limit_m: f64, profile: &Profile) -> bool {
        // No wall is farther from the reference point, which is within the profile, than half of the way round.
        let [y_m, z_m] = profile.reference();
        let off_m = math::hypot(self.from_m[0] - y_m, self.from_m[1] - z_m);
        let here_m = LARGEST_OF_MANY * self.relative.sd_m(Vec3::zero());
        let at_most_m = here_m + self.slope() * (off_m + profile.perimeter_m() / 2.0);
        at_most_m > limit_m && self.worst_m(profile) > limit_m
    }

    /// The largest change of that with a metre of wall, m/m.
    pub fn slope(&self) -> f64 {
        LARGEST_OF_MANY * self.relative.turn_sd_rad()
    }

    /// Standard deviation of the diameter of a hole at a point on the wall, m: its edges are consecutive passes.
    pub fn sd_m(&self, wall_m: [f64; 2]) -> f64 {
        LARGEST_OF_MANY
            * self.relative.sd_m(Vec3::new(0.0, wall_m[0] - self.from_m[0], wall_m[1] - self.from_m[1]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_geometry::tunnel::shapes;

    fn along(sd_m: f64) -> PassError {
        PassError { relative: Relative::along(sd_m), from_m: [0.0, 0.0] }
    }

    #[test]
    fn only_what_the_planned_speed_would_mend_is_slow_out_of_phase() {
        let slow = Drive {
            speed_mps: 0.08,
            planned_mps: 0.1,
            fits_mps: 0.1,
            healthy_gap_s: 4.0,
            planned_gap_s: 4.0,
            all_gap_s: 2.5,
            ..Drive::default()
        };
        let is_slow = |drive: Drive| drive.is_slow_out_of_phase(1.07);
        assert!(is_slow(slow));
        assert!(!is_slow(Drive { planned_gap_s: 2.5, ..slow }), "heads were started wrongly");
        assert!(!is_slow(Drive { planned_gap_s: 3.2, ..slow }), "slower, passes are no farther apart");
        assert!(!is_slow(Drive { speed_mps: 0.1, ..slow }), "as planned");
        assert!(!is_slow(Drive { fits_mps: 0.06, ..slow }), "the planned speed doesn't meet the target");
        assert!(!is_slow(Drive { planned_mps: 0.0, ..slow }), "nothing is planned");
    }

    #[test]
    fn of_several_errors_the_worst_is_kept_whichever_comes_last() {
        for order in [[0.01, 0.05, 0.02], [0.05, 0.02, 0.01], [0.01, 0.02, 0.05]] {
            let mut worst = PassError::default();
            for sd_m in order {
                worst.add(&along(sd_m));
            }
            assert_eq!(worst, along(0.05), "{order:?}");
        }
    }

    #[test]
    fn where_a_section_is_passed_at_its_worst_decides_how_sure_its_holes_are() {
        let drive = |speed_mps: f64| Drive { speed_mps, healthy_gap_s: 2.0, ..Drive::default() };
        assert_eq!(drive(0.3).or_worse(drive(0.1)), drive(0.3));
        assert_eq!(drive(0.1).or_worse(drive(0.3)), drive(0.3));
    }

    #[test]
    fn a_yaw_moves_what_is_beside_the_vehicle_and_nothing_above_it() {
        let yaw = Relative::new([[0.0; 3], [0.0; 3], [0.0, 0.0, 1e-4]]);
        let error = PassError { relative: yaw, from_m: [0.5, 1.0] };
        let profile = shapes::circle(3.0).unwrap();
        let sd_m = |wall_m: [f64; 2]| error.sd_m(wall_m) / LARGEST_OF_MANY;
        assert!((sd_m([2.5, 1.0]) - 0.02).abs() < 1e-12 && sd_m([0.5, 4.0]).abs() < 1e-12);
        // The farthest wall to either side, 3.5 m away.
        let [y_m, _] = profile.reference();
        let worst_m = LARGEST_OF_MANY * 0.01 * (3.0 + (y_m - 0.5).abs());
        assert!((error.worst_m(&profile) - worst_m).abs() < 1e-4, "{}", error.worst_m(&profile));
        assert!((error.slope() - LARGEST_OF_MANY * 0.01).abs() < 1e-12);
        // From within, and from where an estimate that is lost may be.
        for from_m in [error.from_m, [40.0, -30.0]] {
            let error = PassError { from_m, ..error };
            let worst_m = error.worst_m(&profile);
            for share in [0.3, 0.9, 0.999, 1.001, 1.5, 4.0] {
                assert_eq!(error.exceeds(share * worst_m, &profile), share < 1.0, "{from_m:?} {share}");
            }
        }
    }
}
