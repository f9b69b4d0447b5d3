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

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_geometry::frames::{Mount, Rot, Vec3};
    use headrace_sampling::head::{Basis, HeadBody, Turn};

    fn mode(name: &'static str, step_deg: f64, turn_s: f64) -> HeadMode {
        HeadMode { name, turn: Turn::new(step_deg.to_radians(), turn_s).unwrap(), basis: Basis::Table }
    }

    fn head(step_deg: f64, reaching: Vec<HeadMode>) -> HeadSpecification {
        let spec = HeadSpec {
            mount: Mount { position: Vec3::zero(), rotation: Rot::identity() },
            step_rad: step_deg.to_radians(),
            ping_period_s: 0.02,
            range_m: [0.3, 10.0],
            sound_speed_mps: 1500.0,
            beam_rad: 0.03,
            body: HeadBody { radius_m: 0.0, ahead_m: 0.0, behind_m: 0.0 },
        };
        let modes = vec![mode("medium", 0.6, 10.8), mode("fast", 0.9, 8.0), mode("fastest", 2.4, 4.8)];
        HeadSpecification { spec, modes, reaching }
    }

    #[test]
    fn the_coarsest_mode_that_leaves_room_is_taken_and_takes_longer() {
        // 0.9 degrees are 0.094 m on wall 6 m away, 0.6 degrees 0.063 m.
        let at = |target_m: f64| of_head(&head(2.4, Vec::new()), 6.0, target_m);
        let roomy = at(0.2);
        assert!((roomy.finer_step - 0.375).abs() < 1e-9 && (roomy.finer_turn - 8.0 / 4.8).abs() < 1e-9);
        let close = at(0.1);
        assert!((close.finer_step - 0.25).abs() < 1e-9 && (close.finer_turn - 10.8 / 4.8).abs() < 1e-9);
        // None leaves room: the finest.
        assert_eq!(at(0.01), close);
        let finest = of_head(&head(0.6, Vec::new()), 6.0, 0.2);
        assert_eq!((finest.finer_step, finest.finer_turn, finest.longer_turn), (1.0, 1.0, 1.0));
    }

    #[test]
    fn a_longer_range_takes_as_long_as_its_own_mode_does_there() {
        let far = vec![mode("fast", 0.9, 10.0), mode("fastest", 2.4, 6.0)];
        assert!((of_head(&head(2.4, far.clone()), 6.0, 0.2).longer_turn - 1.25).abs() < 1e-9);
        assert!((of_head(&head(0.9, far), 6.0, 0.2).longer_turn - 1.25).abs() < 1e-9);
        let near = vec![mode("fastest", 2.4, 4.0)];
        assert!((of_head(&head(2.4, near), 6.0, 0.2).longer_turn - 1.0).abs() < 1e-12);
    }
}
