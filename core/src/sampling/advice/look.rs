//! How a head sees the wall from where the vehicle is.

use crate::frames::Pose;
use crate::sampling::error::SamplingError;
use crate::sampling::head::{HeadMode, HeadSpec};
use crate::sampling::occlusion::AngleRange;
use crate::sampling::ring::{Ring, Standing};
use crate::sampling::strips::{Arc, View};
use crate::stateful;
use crate::tunnel::Profile;

use super::RING;

/// How far the vehicle may move across the tunnel, m, or turn, as a quaternion's component (half an angle, rad), before
/// the beams of its heads are cast anew. Both change the largest step by well under the speed margin.
const STILL_M: f64 = 0.01;
const STILL_TURN: f64 = 0.002;

/// A head, and its ring as last cast.
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
    pub(super) fn is_near(&self, pose: &Pose) -> bool {
        let Some(cast_at) = &self.cast_at else { return false };
        let near = |a: &[f64], b: &[f64], by: f64| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= by);
        let place = |pose: &Pose| [pose.position.y(), pose.position.z()];
        near(&place(cast_at), &place(pose), STILL_M)
            && near(&cast_at.attitude.wxyz(), &pose.attitude.wxyz(), STILL_TURN)
    }

    /// Casts the head's ring anew; a head that can't look from there keeps what it saw last.
    pub(super) fn cast(&mut self, profile: &Profile, pose: &Pose) -> Result<(), SamplingError> {
        self.cast_at = None;
        let standing = Standing::new(profile, pose, &self.spec.mount)?;
        self.ring.recast(&standing, 0.0, RING)?;
        self.cast_at = Some(*pose);
        Ok(())
    }

    /// Where on the wall its sector is, and what it doesn't see.
    pub(super) fn look(&self, profile: &Profile, pose: &Pose, sound_speed_mps: f64, view: &mut View) {
        view.hidden.clear();
        let Ok(standing) = Standing::new(profile, pose, &self.spec.mount) else { return };
        view.sector = self.sector.and_then(|angles| Arc::of(&standing, &angles).ok());
        view.hidden.extend(self.hidden.iter().filter_map(|angles| Arc::of(&standing, angles).ok()));
        view.hide_out_of_reach(&self.ring, self.spec.reach_m(sound_speed_mps));
    }

    pub(super) fn mode(&self, name: &str) -> Option<&HeadMode> {
        self.modes.iter().find(|mode| mode.name == name)
    }
}
