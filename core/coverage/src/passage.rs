//! Ping statistics of a section's passage: evidence for the cause of a fail.

use serde::{Deserialize, Serialize};

use super::hole::Hole;
use headrace_fusion::Fix;
use headrace_fusion::relative::Relative;
use headrace_geometry::frames::Vec3;
use headrace_geometry::math;
use headrace_geometry::tunnel::Profile;
use headrace_sampling::head::HeadSet;

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
    /// A head went through during a navigation outage.
    pub unseen: bool,
    /// Heads that went through without a ping.
    pub silent: HeadSet,
    /// Where on this section's wall lost pings were aimed, whichever section they were made in.
    pub lost: Lost,
    /// Sum of the speeds at the pings, m/s.
    pub speed_sum_mps: f64,
    /// Sum of the times between passes, seconds.
    pub pass_gap_sum_s: f64,
    /// The same with the passes evenly spread, seconds.
    pub even_gap_sum_s: f64,
    /// The same if all heads had been turning, seconds.
    pub all_gap_sum_s: f64,
    /// Sum of how far the beams swung along the tunnel between two passes, m.
    pub swing_sum_m: f64,
    /// Sum of the times between pings, seconds.
    pub ping_period_sum_s: f64,
    /// Largest step along the perimeter between neighbouring samples of a sweep, m.
    pub t_y_m: f64,
    /// The same predicted for a level vehicle in the middle of the tunnel, m.
    pub middle_t_y_m: f64,
    /// Relative error between passes, of the newest visit with a ping here.
    pub pass_error: PassError,
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

/// Bins around the perimeter.
const PARTS: f64 = 64.0;

/// Lost pings around a section's wall: one bit for each of 64 bins of the perimeter, by reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Lost([u64; Loss::ALL.len()]);

impl Lost {
    /// Records a ping lost at `arc_m`, in [0, perimeter).
    pub fn note(&mut self, loss: Loss, arc_m: f64, perimeter_m: f64) {
        if let Some(bits) = self.0.get_mut(loss as usize) {
            *bits |= 1 << part(arc_m, perimeter_m);
        }
    }

    /// Number of bins within `within_m` of an arc length that have lost pings, by reason.
    pub fn near(&self, arc_m: f64, within_m: f64, perimeter_m: f64) -> [u32; Loss::ALL.len()] {
        let near = (0..64_u32).fold(0_u64, |near, k| {
            let middle_m = (f64::from(k) + 0.5) * perimeter_m / PARTS;
            let off_m = math::wrap_signed(middle_m - arc_m, perimeter_m).abs();
            // A bin counts if its nearer edge is within range.
            near | (u64::from(off_m - perimeter_m / (2.0 * PARTS) < within_m) << k)
        });
        self.0.map(|bits| (bits & near).count_ones())
    }
}

fn part(arc_m: f64, perimeter_m: f64) -> u32 {
    u32::try_from(math::floor_to_i64(arc_m / perimeter_m * PARTS).clamp(0, 63)).unwrap_or(0)
}

/// Number of bins with lost pings within an empty circle, by reason, over the sections that it touches, each with its
/// start and end chainage.
pub fn lost_within<'a>(
    hole: &Hole,
    radius_m: f64,
    perimeter_m: f64,
    sections: impl Iterator<Item = ((f64, f64), &'a Passage)>,
) -> [u32; Loss::ALL.len()] {
    let mut sum = [0; Loss::ALL.len()];
    for ((from_m, to_m), passage) in sections {
        let off_m = (from_m - hole.x_m).max(hole.x_m - to_m).max(0.0);
        if off_m >= radius_m {
            continue;
        }
        let within_m = math::sqrt((radius_m - off_m) * (radius_m + off_m));
        let near = passage.lost.near(hole.arc_m, within_m, perimeter_m);
        sum = core::array::from_fn(|k| sum.get(k).copied().unwrap_or(0) + near.get(k).copied().unwrap_or(0));
    }
    sum
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
        const PLACES: u32 = 64;
        let place = |k: u32| profile.point_at(profile.perimeter_m() * f64::from(k) / f64::from(PLACES));
        (0..PLACES).map(|k| self.sd_m(place(k))).fold(0.0, f64::max)
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

    #[test]
    fn lost_pings_are_found_where_they_were_lost_and_across_the_seam() {
        let mut lost = Lost::default();
        lost.note(Loss::Missing, 0.05, 6.4);
        lost.note(Loss::Occluded, 6.35, 6.4);
        lost.note(Loss::Occluded, 3.2, 6.4);
        assert_eq!(lost.near(6.39, 0.15, 6.4), [1, 0, 1]);
        assert_eq!(lost.near(1.0, 0.5, 6.4), [0; 3]);
        assert_eq!(lost.near(1.0, 3.3, 6.4), [1, 0, 2]);
    }

    #[test]
    fn a_circle_is_narrower_towards_its_ends() {
        let mut passage = Passage::default();
        passage.lost.note(Loss::OutOfRange, 1.75, 6.4);
        let hole = Hole { diameter_m: 2.0, least_m: 2.0, most_m: 2.0, x_m: 5.0, arc_m: 1.0, bounded: true };
        let within =
            |from_m: f64| lost_within(&hole, 1.0, 6.4, core::iter::once(((from_m, from_m + 0.25), &passage)));
        assert_eq!((within(5.0), within(5.75), within(6.0)), ([0, 1, 0], [0; 3], [0; 3]));
    }
}
