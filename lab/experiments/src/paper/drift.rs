//! The baseline across the tunnel: the ping distance T_y of a stationary head at the largest drift and mounting offset.

use headrace_geometry::frames::{Body, Mount, Point3, Pose, Rot, Tunnel, Vec3};
use headrace_geometry::math::PI;
use headrace_geometry::tunnel::{Profile, shapes};
use headrace_sampling::ring::{Ring, Standing};
use headrace_sampling::section;

use super::PaperError;
use super::modes::Mode;

/// Greatest offset of the vehicle from the centre, up, down and sideways, m (Jorge et al. 2021, §8.1).
const DRIFT_M: f64 = 1.5;
/// Greatest yaw relative to the tunnel's direction, degrees (Jorge et al. 2021, §8.1).
const YAW_DEG: f64 = 15.0;
/// Number of computed ranges per turn, a hundredth of a degree apart.
///
/// Every step of Table 2 is a whole number of hundredths of a degree. The last step before a corner is found to 0.2 %
/// of its length.
const SOUNDINGS: u32 = 36_000;

/// Mounting positions of the heads on the vehicle (Jorge et al. 2021, §8).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Rig {
    /// One head, 0.15 m below the vehicle's middle.
    Vita1,
    /// Two heads, one behind the other.
    Vita2InLine,
    /// Three or four heads, each 0.15 m to the left or right of the vehicle's centre.
    Vita2Pairs,
}

/// T_y (distance between samples across the tunnel) of a rig in one mode, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Across {
    pub(super) mean_m: f64,
    pub(super) min_m: f64,
    pub(super) max_m: f64,
}

impl Rig {
    pub(super) fn of(heads: u8) -> Self {
        match heads {
            1 => Self::Vita1,
            2 => Self::Vita2InLine,
            _ => Self::Vita2Pairs,
        }
    }

    /// Offsets of the rig's heads from the vehicle's centre, left and up, m.
    fn offsets_m(self) -> &'static [[f64; 2]] {
        match self {
            Self::Vita1 => &[[0.0, -0.15]],
            Self::Vita2InLine => &[[0.0, 0.0]],
            Self::Vita2Pairs => &[[-0.15, 0.0], [0.15, 0.0]],
        }
    }
}

/// Ping distance T_y of a rig in each of the modes, in the tables' tunnel.
pub(super) fn across(rig: Rig, modes: &[Mode]) -> Result<Vec<Across>, PaperError> {
    let profile = shapes::ceran_blueprint()?;
    let floor_m = floor_m(&profile, rig)?;
    let largest_m = largest_chords_m(&profile, rig, modes)?;
    let of_mode = |(mode, max_m): (&Mode, f64)| {
        Ok(Across {
            mean_m: section::t_yp_m(profile.perimeter_m(), mode.turn.steps())?,
            min_m: section::t_y1_m(floor_m, mode.turn.step_rad())?,
            max_m,
        })
    };
    modes.iter().zip(largest_m).map(of_mode).collect()
}

/// Minimum distance of the rig's heads from the floor, m.
pub(super) fn floor_m(profile: &Profile, rig: Rig) -> Result<f64, PaperError> {
    let lowest_m = rig.offsets_m().iter().map(|[_, up_m]| *up_m).fold(0.0, f64::min);
    Ok(height_m(profile)? / 2.0 - DRIFT_M + lowest_m)
}

/// Height of the tunnel from floor to crown, m.
pub(super) fn height_m(profile: &Profile) -> Result<f64, PaperError> {
    let [y_m, z_m] = profile.reference();
    Ok(z_m + standing(profile, y_m, z_m, 0.0)?.sounding(PI)?.range_m())
}

/// The largest chord between neighbouring samples in each mode, for any phase of the pings within the turn, m.
///
/// The value is the worst case over the positions and headings that the paper allows. Drift and mounting offset are
/// added, whatever the heading.
fn largest_chords_m(profile: &Profile, rig: Rig, modes: &[Mode]) -> Result<Vec<f64>, PaperError> {
    let middle_m = height_m(profile)? / 2.0;
    let mut largest_m = vec![0.0; modes.len()];
    let mut ring = Ring::default();
    for [left_m, up_m] in rig.offsets_m() {
        for [y, z, yaw] in extremes() {
            let (y_m, z_m) = (left_m + y * DRIFT_M, middle_m + up_m + z * DRIFT_M);
            ring.recast(&standing(profile, y_m, z_m, yaw * YAW_DEG.to_radians())?, 0.0, SOUNDINGS)?;
            for (mode, most_m) in modes.iter().zip(&mut largest_m) {
                let [_, _, chord_m] = ring.chords_m((SOUNDINGS / mode.turn.steps()) as usize);
                *most_m = chord_m.max(*most_m);
            }
        }
    }
    Ok(largest_m)
}

/// All combinations of three drifts (left, up, in heading), each of which is -1, 0 or 1 times its maximum.
fn extremes() -> impl Iterator<Item = [f64; 3]> {
    const ENDS: [f64; 3] = [-1.0, 0.0, 1.0];
    ENDS.into_iter().flat_map(|y| ENDS.into_iter().flat_map(move |z| ENDS.map(|yaw| [y, z, yaw])))
}

fn standing(profile: &Profile, y_m: f64, z_m: f64, yaw_rad: f64) -> Result<Standing<'_>, PaperError> {
    let position = Point3::new(0.0, y_m, z_m);
    let attitude = Rot::<Tunnel, Body>::from_roll_pitch_yaw(0.0, 0.0, yaw_rad);
    let mount = Mount { position: Vec3::zero(), rotation: Rot::identity() };
    Ok(Standing::new(profile, &Pose { position, attitude }, &mount)?)
}
