//! Cached ring of each head, recast when the vehicle has moved.

use crate::error::SamplingError;
use crate::head::{HeadMode, HeadSpec};
use crate::occlusion::AngleRange;
use crate::ring::{Ring, Standing};
use crate::strips::{Arc, Sector, View};
use headrace_geometry::frames::Pose;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::tunnel::Profile;

/// Relative change of the speed that is tolerated before the rings are recast.
const SHARE: f64 = 0.002;
/// Limits of the movement across the tunnel before a recast, m: the lower, since the target may leave next to nothing;
/// the upper, since hidden strips move along with the vehicle.
const STILL_M: [f64; 2] = [0.004, 0.1];
/// Tolerated rotation per metre of that, as a quaternion's component (half an angle, rad).
const TURN_PER_M: f64 = 0.2;

/// How finely the advice looks at the wall, and how often anew.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Looks {
    /// Rays of a head's ring, evenly over a turn; at least one. Steps of heads are taken to be whole multiples of the angle
    /// between them, rounded up.
    pub ring: u32,
    /// How far the vehicle may move across the tunnel before a ring is cast anew, m; `None` as far as the speed changes by
    /// 0.2 %, 4 mm at least and 0.1 m at most.
    pub anew_m: Option<f64>,
}

impl Default for Looks {
    /// The finest step of the supported heads, 0.3 degrees.
    fn default() -> Self {
        Self { ring: 1200, anew_m: None }
    }
}

/// How far the vehicle may move across the tunnel, m, before rings are recast, where steps of `t_y_m` on a wall
/// `range_m` away bound the speed v for a target T, with the beams' swing w at `swing_share` = w / v.
///
/// A change dT_y changes v + w ~ T_x = sqrt(T^2 - T_y^2) by the share (T_y / T_x)^2 dT_y / T_y. A step changes with its
/// range, twice as much where the wall falls away.
pub(super) fn still_m(target_m: f64, t_y_m: f64, range_m: f64, swing_share: f64) -> f64 {
    let around2 = t_y_m * t_y_m;
    let along2 = (target_m * target_m - around2).max(0.0);
    (SHARE * range_m / (2.0 * around2 / along2 * (1.0 + swing_share))).clamp(STILL_M[0], STILL_M[1])
}

/// A head with its cached ring.
#[derive(Debug, Clone)]
pub(super) struct AdvisedHead {
    pub(super) spec: HeadSpec,
    pub(super) modes: Vec<HeadMode>,
    /// Angles that the vehicle hides, and the sector, in the sensor's frame.
    pub(super) hidden: Vec<AngleRange>,
    pub(super) sector: Option<AngleRange>,
    pub(super) ring: Ring,
    pub(super) cast_at: Option<Pose>,
}

stateful!(AdvisedHead { state: ring, cast_at; fixed: spec, modes, hidden, sector; });

impl AdvisedHead {
    /// Whether the vehicle is within `still_m`, and [`TURN_PER_M`] of that, of the pose at which the ring was cast.
    pub(super) fn is_near(&self, pose: &Pose, still_m: f64) -> bool {
        let Some(cast_at) = &self.cast_at else { return false };
        let near = |a: &[f64], b: &[f64], by: f64| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= by);
        let place = |pose: &Pose| [pose.position.y(), pose.position.z()];
        near(&place(cast_at), &place(pose), still_m)
            && near(&cast_at.attitude.wxyz(), &pose.attitude.wxyz(), still_m * TURN_PER_M)
    }

    /// Recasts the head's ring of so many rays. On an error `cast_at` is `None`, and the caller keeps the last view.
    pub(super) fn cast(&mut self, profile: &Profile, pose: &Pose, ring: u32) -> Result<(), SamplingError> {
        self.cast_at = None;
        let standing = Standing::new(profile, pose, &self.spec.mount)?;
        self.ring.recast(&standing, 0.0, ring)?;
        self.cast_at = Some(*pose);
        Ok(())
    }

    /// Updates the view: the wall within its sector, and what is hidden or out of reach.
    pub(super) fn look(&self, profile: &Profile, pose: &Pose, sound_speed_mps: f64, view: &mut View) {
        view.hidden.clear();
        let Ok(standing) = Standing::new(profile, pose, &self.spec.mount) else { return };
        view.sector = self.sector.and_then(|angles| Sector::of(&standing, &angles).ok());
        view.hidden.extend(self.hidden.iter().filter_map(|angles| Arc::of(&standing, angles).ok()));
        view.hide_out_of_reach(&self.ring, self.spec.reach_m(sound_speed_mps));
    }

    pub(super) fn mode(&self, name: &str) -> Option<&HeadMode> {
        self.modes.iter().find(|mode| mode.name == name)
    }
}
