//! What other settings of the heads would change: a finer step, a longer range. Both take longer to go round, which counts where a section's
//! hole is to be told as it would have been with them.

use bevy_ecs::prelude::World;

use super::entities::HeadSpecification;
use headrace_coverage::OtherSettings;
use headrace_geometry::tunnel::Profile;
use headrace_sampling::head::{HeadMode, HeadSpec};
use headrace_sensor::device::Device;
use headrace_vehicle::Mission;

/// Range settings that are asked for, whole metres up to this one.
const LONGEST_M: u32 = 200;
/// Share of the target that the step along the wall of a mode that is fine enough leaves room in.
const FINE_ENOUGH: f64 = 0.75;
/// Steps closer together than this are equal, radians.
const SAME_STEP_RAD: f64 = 1e-6;

/// Modes of a head at the shortest range setting, its own or a longer one, that reaches all wall from the middle of the tunnel; none where
/// no setting does.
pub(super) fn reaching(device: &dyn Device, spec: &HeadSpec, mission: &Mission) -> Vec<HeadMode> {
    let profile = &mission.profile;
    let wall_m = profile.farthest_m(profile.reference());
    let set_m = wall_m * spec.sound_speed_mps / mission.site.sound_speed_mps;
    let [_, own_m] = spec.range_m;
    if own_m >= set_m {
        return device.modes(None).unwrap_or_default();
    }
    let longer_m = (1..=LONGEST_M).map(f64::from).filter(|range_m| *range_m >= set_m);
    longer_m.into_iter().find_map(|range_m| device.modes(Some(range_m)).ok()).unwrap_or_default()
}

/// Of all heads of a world, those that change most: what holds for the vehicle is what its slowest head does.
pub(super) fn of_heads(world: &mut World, profile: &Profile, target_m: f64) -> OtherSettings {
    let mut heads = world.query::<&HeadSpecification>();
    let farthest_m = profile.farthest_m(profile.reference());
    let each = heads.iter(world).map(|head| of_head(head, farthest_m, target_m));
    let worst = |worst: OtherSettings, other: OtherSettings| OtherSettings {
        finer_step: worst.finer_step.max(other.finer_step),
        finer_turn: worst.finer_turn.max(other.finer_turn),
        longer_turn: worst.longer_turn.max(other.longer_turn),
    };
    each.reduce(worst).unwrap_or_default()
}

fn of_head(head: &HeadSpecification, farthest_m: f64, target_m: f64) -> OtherSettings {
    let HeadSpecification { spec, modes, reaching } = head;
    let turn_s = |modes: &[HeadMode]| {
        let same = |mode: &&HeadMode| (mode.turn.step_rad() - spec.step_rad).abs() < SAME_STEP_RAD;
        modes.iter().find(same).map(|mode| mode.turn.period_s())
    };
    let Some(now_s) = turn_s(modes) else { return OtherSettings::default() };
    let finer = || modes.iter().filter(|mode| mode.turn.step_rad() < spec.step_rad - SAME_STEP_RAD);
    let by_step = |a: &&HeadMode, b: &&HeadMode| a.turn.step_rad().total_cmp(&b.turn.step_rad());
    // The step along a wall that beams meet squarely.
    let is_fine = |mode: &&HeadMode| mode.turn.step_rad() * farthest_m <= FINE_ENOUGH * target_m;
    let chosen = finer().filter(is_fine).max_by(by_step).or_else(|| finer().min_by(by_step));
    OtherSettings {
        finer_step: chosen.map_or(1.0, |mode| mode.turn.step_rad() / spec.step_rad),
        finer_turn: chosen.map_or(1.0, |mode| mode.turn.period_s() / now_s),
        longer_turn: turn_s(reaching).map_or(1.0, |then_s| (then_s / now_s).max(1.0)),
    }
}
