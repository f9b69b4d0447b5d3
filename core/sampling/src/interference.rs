//! Interference: time for which two heads can receive each other's pings, directly or from the same patch of wall.

use super::error::SamplingError;
use super::head::HeadSpec;
use super::ring::{Sounding, Standing};
use super::schedule::Schedule;
use headrace_geometry::frames::{Body, Pose, Tunnel, Vec3, head_direction};
use headrace_geometry::math;
use headrace_geometry::time::DurNs;
use headrace_geometry::tunnel::Profile;

/// Time per turn or sweep for which two heads can receive each other's pings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exposure {
    /// The two heads by number.
    pub heads: (usize, usize),
    /// Time for which each beam points at the other head's body, seconds per turn.
    pub facing_s: f64,
    /// Time for which the beams' footprints on the wall overlap, seconds per turn.
    pub same_patch_s: f64,
    /// Period of the heads' turn, or of their sweep there and back, seconds.
    pub of_s: f64,
}

/// Returns, for each pair of scheduled heads, the time for which they can receive each other's pings at `pose`.
///
/// Pairs that never receive each other's pings are omitted. So are pairs at the same position, which is an
/// idealisation.
/// Errors: a head outside the profile, or a beam along the tunnel.
pub fn exposures(
    heads: &[HeadSpec],
    schedule: &Schedule,
    profile: &Profile,
    pose: &Pose,
) -> Result<Vec<Exposure>, SamplingError> {
    let mut found = Vec::new();
    for (first, a) in heads.iter().enumerate() {
        for (second, b) in heads.iter().enumerate().skip(first + 1) {
            let pair = Pair::new([a, b], profile, pose)?;
            let turn_s = a.ping_period_s * math::TAU / a.step_rad;
            let of_s = schedule.sweep_s().unwrap_or(turn_s);
            let pings = math::round_to_i64(of_s / a.ping_period_s).clamp(1, 100_000);
            let mut exposure = Exposure { heads: (first, second), facing_s: 0.0, same_patch_s: 0.0, of_s };
            for ping in 0..pings {
                let since = DurNs::from_secs_f64(ping as f64 * a.ping_period_s);
                let (Some(at), Some(bt)) =
                    (schedule.angle_rad(first, since), schedule.angle_rad(second, since))
                else {
                    debug_assert!(
                        false,
                        "heads {first} and {second} are scheduled from the start on: {since:?}"
                    );
                    continue;
                };
                if pair.facing([at, bt]) {
                    exposure.facing_s += a.ping_period_s;
                }
                if pair.same_patch([at, bt])? {
                    exposure.same_patch_s += a.ping_period_s;
                }
            }
            if exposure.facing_s > 0.0 || exposure.same_patch_s > 0.0 {
                found.push(exposure);
            }
        }
    }
    Ok(found)
}

struct Pair<'a> {
    specs: [&'a HeadSpec; 2],
    standing: [Standing<'a>; 2],
    /// Vector from the first head to the second, in the body frame and in the tunnel frame.
    apart: Vec3<Body>,
    apart_in_tunnel: Vec3<Tunnel>,
}

impl<'a> Pair<'a> {
    fn new(specs: [&'a HeadSpec; 2], profile: &'a Profile, pose: &Pose) -> Result<Self, SamplingError> {
        let [a, b] = specs;
        let apart = b.mount.position + -a.mount.position;
        let standing = [Standing::new(profile, pose, &a.mount)?, Standing::new(profile, pose, &b.mount)?];
        Ok(Self { specs, standing, apart, apart_in_tunnel: pose.attitude * apart })
    }

    fn facing(&self, angles_rad: [f64; 2]) -> bool {
        let apart_m = self.apart.norm();
        let [a, b] = self.specs;
        if apart_m <= a.body.radius_m.max(b.body.radius_m) {
            return false;
        }
        let points = |head: &HeadSpec, angle_rad: f64, towards: Vec3<Body>, other: &HeadSpec| {
            let beam = head.mount.rotation * head_direction(angle_rad);
            let off_rad = math::acos(beam.0.dot(&towards.0) / apart_m);
            off_rad <= head.beam_rad / 2.0 + math::asin(other.body.radius_m / apart_m)
        };
        points(a, angles_rad[0], self.apart, b) && points(b, angles_rad[1], -self.apart, a)
    }

    fn same_patch(&self, angles_rad: [f64; 2]) -> Result<bool, SamplingError> {
        let apart_m = self.apart.norm();
        if apart_m <= self.specs[0].body.radius_m.max(self.specs[1].body.radius_m) {
            return Ok(false);
        }
        let hits = [self.standing[0].sounding(angles_rad[0])?, self.standing[1].sounding(angles_rad[1])?];
        let between = self.apart_in_tunnel + hits[1].beam + -hits[0].beam;
        let half_m = |hit: &Sounding, head: &HeadSpec| {
            hit.range_m() * math::tan(head.beam_rad / 2.0) / hit.squareness.max(0.1)
        };
        Ok(between.norm() <= half_m(&hits[0], self.specs[0]) + half_m(&hits[1], self.specs[1]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures;
    use crate::layout::HeadLayout;
    use headrace_geometry::frames::{Point3, Rot};
    use headrace_geometry::tunnel::shapes;

    fn heads(places: &[[f64; 3]]) -> Vec<HeadSpec> {
        places.iter().map(|place| fixtures::head(*place, false, 0.04)).collect()
    }

    fn found(places: &[[f64; 3]], layout: HeadLayout) -> Vec<Exposure> {
        let heads = heads(places);
        let profile = shapes::ceran().unwrap();
        let [y, z] = profile.reference();
        let pose = Pose { position: Point3::new(0.0, y, z), attitude: Rot::identity() };
        let schedule = Schedule::new(&heads, layout, 0.2).unwrap();
        exposures(&heads, &schedule, &profile, &pose).unwrap()
    }

    #[test]
    fn side_by_side_heads_half_a_turn_apart_face_each_other() {
        let found = found(&[[0.0, 0.15, 0.0], [0.0, -0.15, 0.0]], HeadLayout::PhaseShift);
        assert_eq!(found.len(), 1);
        // Each beam points at the other head once per turn of 8 s, over an angle of 2 (0.7 + asin(0.04 / 0.3)) = 16.7
        // degrees.
        assert!((found[0].facing_s - 8.0 * 16.73 / 360.0).abs() < 0.025, "{:?}", found[0]);
        assert_eq!((found[0].same_patch_s, found[0].of_s), (0.0, 8.0));
    }

    #[test]
    fn side_by_side_heads_a_quarter_turn_apart_never_face_each_other() {
        let places = [[0.0, 0.15, 0.0], [0.0, -0.15, 0.0], [1.0, 0.0, 0.0], [1.0, 0.5, 0.0]];
        let pair = |exposure: &Exposure| exposure.heads == (0, 1);
        assert!(!found(&places, HeadLayout::PhaseShift).iter().any(pair));
    }

    #[test]
    fn heads_in_neighbouring_sectors_never_share_a_patch() {
        let found = found(&[[0.0, 0.15, 0.0], [0.0, -0.15, 0.0]], HeadLayout::SectorOffset);
        assert!(found.is_empty(), "{found:?}");
    }

    #[test]
    fn heads_that_point_the_same_way_share_a_patch_of_wall() {
        // Time for which two heads illuminate the same patch of wall, s. `apart_m` is their distance along the hull.
        let shared = |apart_m: f64| {
            let found = found(&[[apart_m, 0.0, 0.0], [0.0, 0.0, 0.1]], HeadLayout::PhaseShift);
            found.iter().map(|exposure| exposure.same_patch_s).sum::<f64>()
        };
        // At 0.2 m/s and 8 s per turn, the vehicle travels 0.8 m in half a turn. The footprints of heads 0.8 m apart
        // never overlap.
        assert!(shared(0.8) <= 0.0);
        // A beam's footprint is 0.15 m wide at a range of 6 m, and wider on the floor. Heads 0.1 m apart are near
        // enough, but their angles differ by half a turn.
        assert!(shared(0.1) <= 0.0);
        let heads = heads(&[[0.1, 0.0, 0.0], [0.0, 0.0, 0.1]]);
        let profile = shapes::ceran().unwrap();
        let [y, z] = profile.reference();
        let pose = Pose { position: Point3::new(0.0, y, z), attitude: Rot::identity() };
        let pair = Pair::new([&heads[0], &heads[1]], &profile, &pose).unwrap();
        assert!(pair.same_patch([1.0, 1.0]).unwrap() && !pair.same_patch([1.0, 1.2]).unwrap());
    }
}
