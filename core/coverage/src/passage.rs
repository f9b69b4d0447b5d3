//! Statistics of the pings made during the passage through a section, as evidence for the cause of a fail.

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
    /// Number of pings, whatever their outcome.
    pub pings: u32,
    /// Number of pings with a fix.
    pub placed: u32,
    /// Number of pings that either have no fix, or have no return although the wall was within range.
    pub missing: u32,
    /// Number of pings without a return because the wall was farther than the range setting.
    pub out_of_range: u32,
    /// Number of pings occluded by the vehicle.
    pub occluded: u32,
    /// Number of returns without a fix.
    pub unplaced: u32,
    /// Number of pings of a stalled head.
    pub standing: u32,
    /// Heads that passed through the section without a ping, or without an accepted return from the wall.
    pub silent: HeadSet,
    /// Driving figures at the moment of the largest spacing T.
    pub drive: Drive,
    /// Whether there were more pings without a fix than could be stored.
    pub unseen: bool,
    /// Whether the position of a ping was too uncertain, relative to the previous pass, for the measured speed to count
    /// as evidence.
    pub adrift: bool,
    /// Error between passes in the newest visit with a ping in the section.
    pub pass_error: PassError,
}

/// Movement of the vehicle and its heads at one moment of a passage.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Drive {
    /// Absolute speed along the tunnel, m/s.
    pub speed_mps: f64,
    /// Speed for which the heads are set in phase, m/s. Zero if none is planned.
    pub planned_mps: f64,
    /// Longest time between two passes of the heads that turned, s.
    pub gap_s: f64,
    /// Longest time between two passes if the heads that turned had been evenly spread, s.
    pub even_gap_s: f64,
    /// Longest time between two passes if all heads had turned, with none silent or stalled, s.
    pub healthy_gap_s: f64,
    /// Longest time between two passes at the present speed if all heads had been at their scheduled angles, s.
    pub planned_gap_s: f64,
    /// Longest time between two passes if all configured heads had turned and been evenly spread, s.
    pub all_gap_s: f64,
    /// Longest time between two passes at the planned speed, s. If no speed is planned, the driven speed is used.
    pub gap_at_plan_s: f64,
    /// Longest time between two passes at the planned speed if all heads had turned, s.
    pub healthy_at_plan_s: f64,
    /// Longest time between two passes of the heads that turn and never stalled, s.
    ///
    /// It is valid at the planned speed, with these heads at their scheduled angles.
    pub left_at_plan_s: f64,
    /// Longest time between two pings of a head, s.
    pub ping_period_s: f64,
    /// Largest distance that the beams have swung along the tunnel since the neighbouring passes, m.
    pub swing_m: f64,
    /// Largest step along the perimeter between two pings, computed from the vehicle's position, m.
    pub t_y_m: f64,
    /// Largest step along the perimeter between two pings, computed from the tunnel's centre, m.
    pub middle_t_y_m: f64,
    /// Largest speed that meets the target from the tunnel's centre, m/s. Zero if no speed does.
    ///
    /// All heads are assumed to turn as scheduled. If the planned speed meets the target, the value is the planned
    /// speed.
    pub fits_mps: f64,
    /// Largest distance between passes along the tunnel that meets the target, m.
    pub fits_along_m: f64,
    /// Number of passes needed where one would do without lost returns.
    ///
    /// See [`headrace_sampling::losses`].
    pub passes_needed: f64,
    /// Loss rate of the head that loses the most returns by chance.
    pub lost: LossRate,
    /// Whether the heads sweep back and forth in sectors.
    pub is_in_sectors: bool,
    /// Whether a head has not pinged since the dive began.
    pub is_unheard: bool,
    /// Predicted effect of alternative head settings on step and turn period.
    pub other: OtherSettings,
}

/// Step and turn period with other head settings, as multiples of the present ones.
///
/// A turn takes longer with a finer step or a longer range.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct OtherSettings {
    /// Step of a finer mode, divided by the present step.
    ///
    /// The mode is the one with a finer step that allows the highest speed. If no mode meets the target, it is the
    /// finest mode.
    pub finer_step: f64,
    /// Turn period of this finer mode, divided by the present turn period.
    pub finer_turn: f64,
    /// Turn period with a longer range setting, divided by the present turn period.
    ///
    /// It is the shortest range setting that reaches all wall from the tunnel's centre.
    pub longer_turn: f64,
}

impl Default for OtherSettings {
    /// Ratios for heads with unknown settings. A finer mode is assumed to have the same turn period.
    fn default() -> Self {
        Self { finer_step: 0.375, finer_turn: 1.0, longer_turn: 1.0 }
    }
}

/// Ratio of the driven to the planned speed below which the vehicle counts as slower than planned.
const SLOWER: f64 = 0.97;

impl Drive {
    /// Distance along the tunnel between passes, swing included, if no head had been silent or stalled, m.
    pub fn along_m(&self) -> f64 {
        self.speed_mps * self.healthy_gap_s + self.swing_m + self.advance_m()
    }

    /// Distance along the tunnel between passes if all heads had turned as scheduled, m.
    pub fn planned_along_m(&self) -> f64 {
        self.speed_mps * self.planned_gap_s
    }

    /// Distance that the vehicle travels between two pings, m.
    pub fn advance_m(&self) -> f64 {
        self.speed_mps * self.ping_period_s
    }

    /// Whether the heads are out of phase because the vehicle is slower than planned.
    ///
    /// True if two conditions hold. The planned speed meets the target, and the distance between passes is more than
    /// `over` times that at the planned speed with the heads at their scheduled angles. Heads at different places along
    /// the hull are in phase only near the planned speed. Heads that were started with wrong phases do not count,
    /// because no speed helps them.
    pub fn is_slow_out_of_phase(&self, over: f64) -> bool {
        let is_slower = self.planned_mps > 0.0 && self.speed_mps < SLOWER * self.planned_mps;
        let fits = self.fits_mps >= self.planned_mps;
        is_slower && fits && self.planned_along_m() > over * self.planned_mps * self.all_gap_s
    }

    /// Returns the movement with the larger distance between passes.
    #[must_use]
    pub fn or_worse(self, other: Self) -> Self {
        if other.along_m() > self.along_m() { other } else { self }
    }
}

/// Reason why a ping left no sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Loss {
    /// No return, although the wall was within range.
    Missing,
    /// The wall was farther than the range setting.
    OutOfRange,
    /// The vehicle occluded the beam of the ping.
    Occluded,
}

impl Loss {
    /// All reasons why a ping left no sample.
    pub const ALL: [Self; 3] = [Self::Missing, Self::OutOfRange, Self::Occluded];
}

/// Ratio of the error of a section's largest hole to the error of a single distance between passes.
///
/// It exceeds 1 because the largest hole is often one that errors have enlarged. Its value was measured in the field
/// dives of `tests/tests/navigation/fusion.rs`.
const LARGEST_OF_MANY: f64 = 1.2;

/// Error along the tunnel of the samples of one pass relative to the previous pass.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct PassError {
    /// Covariance of the position and attitude errors of the pass, relative to the previous pass.
    pub relative: Relative,
    /// Position of the vehicle in the cross-section, [y, z], m.
    pub from_m: [f64; 2],
}

impl PassError {
    /// Creates the pass error at a fix.
    pub fn of(fix: &Fix) -> Self {
        Self { relative: fix.relative, from_m: [fix.pose.position.y(), fix.pose.position.z()] }
    }

    /// Keeps the larger of two pass errors.
    pub fn add(&mut self, other: &Self) {
        if other.relative.sd_m(Vec3::zero()) >= self.relative.sd_m(Vec3::zero()) {
            *self = *other;
        }
    }

    /// Returns the largest standard deviation of a hole's diameter anywhere around the profile, m.
    pub fn worst_m(&self, profile: &Profile) -> f64 {
        profile.places().iter().map(|place| self.sd_m(*place)).fold(0.0, f64::max)
    }

    /// Whether [`Self::worst_m`] exceeds a limit, m.
    ///
    /// For most passes, an upper bound is already below the limit. Then no search around the profile is needed.
    pub fn exceeds(&self, limit_m: f64, profile: &Profile) -> bool {
        // The reference point lies within the profile, so no wall is farther from it than half the perimeter.
        let [y_m, z_m] = profile.reference();
        let off_m = math::hypot(self.from_m[0] - y_m, self.from_m[1] - z_m);
        let here_m = LARGEST_OF_MANY * self.relative.sd_m(Vec3::zero());
        let at_most_m = here_m + self.slope() * (off_m + profile.perimeter_m() / 2.0);
        at_most_m > limit_m && self.worst_m(profile) > limit_m
    }

    /// Largest change of the standard deviation of a hole's diameter per metre of wall, m/m.
    pub fn slope(&self) -> f64 {
        LARGEST_OF_MANY * self.relative.turn_sd_rad()
    }

    /// Returns the standard deviation of the diameter of a hole at a point on the wall, m.
    ///
    /// The hole lies between two consecutive passes.
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
    fn slow_vehicle_counts_as_out_of_phase_only_if_the_planned_speed_helps() {
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
        assert!(!is_slow(Drive { planned_gap_s: 2.5, ..slow }), "the heads were started wrongly");
        assert!(!is_slow(Drive { planned_gap_s: 3.2, ..slow }), "passes are no farther apart when slower");
        assert!(!is_slow(Drive { speed_mps: 0.1, ..slow }), "the vehicle is as fast as planned");
        assert!(!is_slow(Drive { fits_mps: 0.06, ..slow }), "the planned speed must meet the target");
        assert!(!is_slow(Drive { planned_mps: 0.0, ..slow }), "no speed is planned");
    }

    #[test]
    fn largest_pass_error_is_kept_in_any_order() {
        for order in [[0.01, 0.05, 0.02], [0.05, 0.02, 0.01], [0.01, 0.02, 0.05]] {
            let mut worst = PassError::default();
            for sd_m in order {
                worst.add(&along(sd_m));
            }
            assert_eq!(worst, along(0.05), "{order:?}");
        }
    }

    #[test]
    fn worse_of_two_movements_is_that_with_the_larger_distance_between_passes() {
        let drive = |speed_mps: f64| Drive { speed_mps, healthy_gap_s: 2.0, ..Drive::default() };
        assert_eq!(drive(0.3).or_worse(drive(0.1)), drive(0.3));
        assert_eq!(drive(0.1).or_worse(drive(0.3)), drive(0.3));
    }

    #[test]
    fn yaw_error_displaces_wall_beside_the_vehicle_but_not_above_it() {
        let yaw = Relative::new([[0.0; 3], [0.0; 3], [0.0, 0.0, 1e-4]]);
        let error = PassError { relative: yaw, from_m: [0.5, 1.0] };
        let profile = shapes::circle(3.0).unwrap();
        let sd_m = |wall_m: [f64; 2]| error.sd_m(wall_m) / LARGEST_OF_MANY;
        assert!((sd_m([2.5, 1.0]) - 0.02).abs() < 1e-12 && sd_m([0.5, 4.0]).abs() < 1e-12);
        // The farthest wall to either side is 3.5 m away.
        let [y_m, _] = profile.reference();
        let worst_m = LARGEST_OF_MANY * 0.01 * (3.0 + (y_m - 0.5).abs());
        assert!((error.worst_m(&profile) - worst_m).abs() < 1e-4, "{}", error.worst_m(&profile));
        assert!((error.slope() - LARGEST_OF_MANY * 0.01).abs() < 1e-12);
        // The vehicle's estimated position is first inside the profile, and then far outside, as it may be when
        // navigation is lost.
        for from_m in [error.from_m, [40.0, -30.0]] {
            let error = PassError { from_m, ..error };
            let worst_m = error.worst_m(&profile);
            for share in [0.3, 0.9, 0.999, 1.001, 1.5, 4.0] {
                assert_eq!(error.exceeds(share * worst_m, &profile), share < 1.0, "{from_m:?} {share}");
            }
        }
    }
}
