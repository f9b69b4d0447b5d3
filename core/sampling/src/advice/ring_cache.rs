//! Cached ring of rays from each head to the wall, recast after the vehicle moves.

use crate::error::SamplingError;
use crate::head::{HeadMode, HeadSpec};
use crate::occlusion::AngleRange;
use crate::ring::{Ring, Standing};
use crate::strips::{Arc, Sector, View};
use headrace_geometry::frames::Pose;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::tunnel::Profile;

/// Rings of rays are recast if the vehicle's movement may have changed the advised speed by more than this share.
const SHARE: f64 = 0.002;
/// Smallest and largest limit of the movement across the tunnel after which rings of rays are recast, m.
///
/// The smallest limit applies if the distance between neighbouring samples of a turn nearly reaches the target. The
/// largest limit is needed because hidden strips move with the vehicle.
const STILL_M: [f64; 2] = [0.004, 0.1];
/// Rotation limit per metre of the movement limit, as a quaternion component, which is half the angle in rad.
const TURN_PER_M: f64 = 0.2;

/// Number of rays with which the advice finds the wall, and the vehicle's movement after which the rays are cast again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Looks {
    /// Number of rays in a head's ring, spread evenly over a turn; at least one.
    ///
    /// Angular steps of heads are rounded up to whole multiples of the angle between rays.
    pub ring: u32,
    /// Movement across the tunnel before a ring is recast, m.
    ///
    /// `None` means the movement that changes the advised speed by 0.2 %, but at least 4 mm and at most 0.1 m.
    pub anew_m: Option<f64>,
}

impl Default for Looks {
    /// One ray per 0.3 degrees, which is the finest angular step of the supported heads.
    fn default() -> Self {
        Self { ring: 1200, anew_m: None }
    }
}

/// Returns the movement across the tunnel before rings of rays are recast, m.
///
/// The distance T_y = `t_y_m` between samples of a turn, on a wall `range_m` away, limits the speed v for a target T.
/// `swing_share` is w / v, with the speed w of beams due to swing. v + w is proportional to T_x = sqrt(T^2 - T_y^2). If
/// T_y changes by dT_y, T_x changes by the share (T_y / T_x)^2 dT_y / T_y. T_y is proportional to the range, and
/// changes twice as fast where the wall is oblique to the beam.
pub(super) fn still_m(target_m: f64, t_y_m: f64, range_m: f64, swing_share: f64) -> f64 {
    let around2 = t_y_m * t_y_m;
    let along2 = (target_m * target_m - around2).max(0.0);
    (SHARE * range_m / (2.0 * around2 / along2 * (1.0 + swing_share))).clamp(STILL_M[0], STILL_M[1])
}

/// A head with its cached ring of rays.
#[derive(Debug, Clone)]
pub(super) struct AdvisedHead {
    pub(super) spec: HeadSpec,
    pub(super) modes: Vec<HeadMode>,
    /// Angles hidden from the head, and the head's sector, in the sensor frame.
    pub(super) hidden: Vec<AngleRange>,
    pub(super) sector: Option<AngleRange>,
    pub(super) ring: Ring,
    pub(super) cast_at: Option<Pose>,
}

stateful!(AdvisedHead { state: ring, cast_at; fixed: spec, modes, hidden, sector; });

impl AdvisedHead {
    /// Whether the vehicle is still close to the pose at which the head's ring was cast.
    ///
    /// The limit of the movement is `still_m`; the limit of the rotation is [`TURN_PER_M`] times `still_m`.
    pub(super) fn is_near(&self, pose: &Pose, still_m: f64) -> bool {
        let Some(cast_at) = &self.cast_at else { return false };
        let near = |a: &[f64], b: &[f64], by: f64| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= by);
        let place = |pose: &Pose| [pose.position.y(), pose.position.z()];
        near(&place(cast_at), &place(pose), still_m)
            && near(&cast_at.attitude.wxyz(), &pose.attitude.wxyz(), still_m * TURN_PER_M)
    }

    /// Recasts the head's ring.
    ///
    /// After an error, `cast_at` is `None`, and the caller keeps the previous view.
    pub(super) fn cast(&mut self, profile: &Profile, pose: &Pose, ring: u32) -> Result<(), SamplingError> {
        self.cast_at = None;
        let standing = Standing::new(profile, pose, &self.spec.mount)?;
        self.ring.recast(&standing, 0.0, ring)?;
        self.cast_at = Some(*pose);
        Ok(())
    }

    /// Updates the head's view: the wall within the head's sector, the hidden wall, and the wall outside the head's
    /// range limits.
    pub(super) fn look(&self, profile: &Profile, pose: &Pose, sound_speed_mps: f64, view: &mut View) {
        view.hidden.clear();
        let Ok(standing) = Standing::new(profile, pose, &self.spec.mount) else {
            debug_assert!(false, "a head whose ring was just cast is inside the profile: {pose:?}");
            return;
        };
        view.sector = self.sector.and_then(|angles| Sector::of(&standing, &angles).ok());
        view.hidden.extend(self.hidden.iter().filter_map(|angles| Arc::of(&standing, angles).ok()));
        view.hide_out_of_reach(&self.ring, self.spec.reach_m(sound_speed_mps));
    }

    pub(super) fn mode(&self, name: &str) -> Option<&HeadMode> {
        self.modes.iter().find(|mode| mode.name == name)
    }
}
