//! Predicted effect of alternative head settings: a finer angular step or a longer range.
//!
//! Both settings make a turn take longer. The predicted hole of a section allows for the longer turn.

use bevy_ecs::prelude::World;

use super::entities::HeadSpecification;
use super::head_descriptions::HeadSettings;
use headrace_coverage::OtherSettings;
use headrace_geometry::frames::{Point3, Pose, Rot};
use headrace_geometry::tunnel::Profile;
use headrace_sampling::advice::{Looks, ModeName};
use headrace_sampling::head::{HeadMode, HeadSpec};
use headrace_sampling::ring::{Ring, Standing};
use headrace_sampling::spacing::speed_for_target_mps;
use headrace_sensor::device::Device;
use headrace_vehicle::Mission;

/// Longest range setting that the search tries, m. Settings are tried in whole metres.
const LONGEST_M: u32 = 200;
/// Angular steps of a head that differ by at most this angle count as equal, radians.
const SAME_STEP_RAD: f64 = 1e-6;

impl HeadSpecification {
    /// Specification of a head device for a mission.
    pub fn of(device: &dyn Device, spec: HeadSpec, mission: &Mission) -> Self {
        let modes = device.modes(None).unwrap_or_default();
        Self { spec, modes, reaching: reaching(device, &spec, mission) }
    }

    /// Alternative settings in a tunnel inspected with target T, m. `name` is the id of the head's source.
    pub fn settings(&self, name: &str, profile: &Profile, target_m: f64) -> HeadSettings {
        let [_, own_m] = self.spec.range_m;
        let range_m = self.reaching.as_ref().map(|(range_m, _)| *range_m);
        // The live advice uses the same number of rays. The mode in the advice and this mode appear on the same screen,
        // so they must agree.
        let rays = Looks::default().ring;
        let ring = self.ring_in_the_middle(profile, rays).unwrap_or_default();
        let finer = self.finer(target_m, |step_rad| ring.largest_step_m(Ring::stride(step_rad, rays)));
        HeadSettings {
            name: name.to_owned(),
            finer: finer.map(|mode| ModeName::new(mode.name)),
            longer_m: range_m.filter(|range_m| *range_m > own_m),
        }
    }

    /// Returns the scan mode with a finer step that allows the highest speed. If no such mode meets the target, returns
    /// the finest mode.
    ///
    /// `t_y_m` converts a step of the head, radians, to the step along the wall, m.
    fn finer(&self, target_m: f64, t_y_m: impl Fn(f64) -> f64) -> Option<&HeadMode> {
        let step_rad = |mode: &HeadMode| mode.turn.step_rad();
        let finer = || self.modes.iter().filter(|mode| step_rad(mode) < self.spec.step_rad - SAME_STEP_RAD);
        let speed_mps = |mode: &HeadMode| {
            let t_y_m = t_y_m(step_rad(mode));
            speed_for_target_mps(target_m, t_y_m, mode.turn.period_s(), mode.turn.ping_period_s())
        };
        let fitting = finer().filter_map(|mode| Some((mode, speed_mps(mode)?)));
        let fastest = fitting.max_by(|(_, one_mps), (_, other_mps)| one_mps.total_cmp(other_mps));
        let finest = || finer().min_by(|one, other| step_rad(one).total_cmp(&step_rad(other)));
        fastest.map(|(mode, _)| mode).or_else(finest)
    }

    /// Wall as the head sees it from the tunnel's centre while roll, pitch and yaw are zero; `None` if the head is
    /// then outside the profile.
    fn ring_in_the_middle(&self, profile: &Profile, rays: u32) -> Option<Ring> {
        let [y, z] = profile.reference();
        let pose = Pose { position: Point3::new(0.0, y, z), attitude: Rot::identity() };
        Ring::cast(&Standing::new(profile, &pose, &self.spec.mount).ok()?, 0.0, rays).ok()
    }
}

/// Shortest range setting that reaches all wall from the tunnel's centre, m, and the head's scan modes at
/// that setting.
///
/// The setting is the head's own setting or a longer one. `None` if no setting reaches all wall.
fn reaching(device: &dyn Device, spec: &HeadSpec, mission: &Mission) -> Option<(f64, Vec<HeadMode>)> {
    let profile = &mission.profile;
    let wall_m = profile.farthest_m(profile.reference());
    let set_m = wall_m * spec.sound_speed_mps / mission.site.sound_speed_mps;
    let [_, own_m] = spec.range_m;
    if own_m >= set_m {
        return Some((own_m, device.modes(None).unwrap_or_default()));
    }
    let longer_m = (1..=LONGEST_M).map(f64::from).filter(|range_m| *range_m >= set_m);
    longer_m.into_iter().find_map(|range_m| Some((range_m, device.modes(Some(range_m)).ok()?)))
}

/// Effect of the alternative settings: ratio of a head's new angular step to the present one, and ratio of the turn
/// periods. The head with the largest ratio decides for the vehicle.
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
    // A perpendicular beam is assumed for the step along the wall. The section's samples later show whether the mode is
    // also fine enough in corners.
    let chosen = head.finer(target_m, |step_rad| step_rad * farthest_m);
    OtherSettings {
        finer_step: chosen.map_or(1.0, |mode| mode.turn.step_rad() / spec.step_rad),
        finer_turn: chosen.map_or(1.0, |mode| mode.turn.period_s() / now_s),
        longer_turn: reaching
            .as_ref()
            .and_then(|(_, modes)| turn_s(modes))
            .map_or(1.0, |then_s| (then_s / now_s).max(1.0)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_geometry::frames::{Mount, Vec3};
    use headrace_geometry::tunnel::shapes;
    use headrace_sampling::head::{Basis, HeadBody, Turn};

    fn mode(name: &'static str, step_deg: f64, turn_s: f64) -> HeadMode {
        HeadMode { name, turn: Turn::new(step_deg.to_radians(), turn_s).unwrap(), basis: Basis::Table }
    }

    fn head(step_deg: f64, reaching: Option<(f64, Vec<HeadMode>)>) -> HeadSpecification {
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
    fn predicted_turn_period_is_that_of_the_mode_allowing_the_highest_speed() {
        // At 6 m from the wall, 0.9 degrees are 0.094 m, and 0.6 degrees are 0.063 m.
        let at = |target_m: f64| of_head(&head(2.4, None), 6.0, target_m);
        let roomy = at(0.2);
        assert!((roomy.finer_step - 0.375).abs() < 1e-9 && (roomy.finer_turn - 8.0 / 4.8).abs() < 1e-9);
        let close = at(0.1);
        assert!((close.finer_step - 0.25).abs() < 1e-9 && (close.finer_turn - 10.8 / 4.8).abs() < 1e-9);
        // No mode meets the target, so the search returns the mode with the finest step.
        assert_eq!(at(0.01), close);
        let finest = of_head(&head(0.6, None), 6.0, 0.2);
        assert_eq!((finest.finer_step, finest.finer_turn, finest.longer_turn), (1.0, 1.0, 1.0));
    }

    /// In a corner, or at a grazing angle, a step along the wall is longer than for a perpendicular beam.
    #[test]
    fn oblique_wall_needs_a_finer_mode() {
        let ceran = shapes::ceran().unwrap();
        let named = |target_m: f64| head(2.4, None).settings("", &ceran, target_m).finer;
        let farthest_m = ceran.farthest_m(ceran.reference());
        assert!(0.9_f64.to_radians() * farthest_m < 0.13, "FAST would do for a perpendicular beam");
        assert_eq!(named(0.14).unwrap().as_str(), "medium");
        assert_eq!(named(0.5).unwrap().as_str(), "fast");
    }

    #[test]
    fn long_range_setting_uses_the_turn_period_of_the_mode_at_that_range() {
        let far = vec![mode("fast", 0.9, 10.0), mode("fastest", 2.4, 6.0)];
        assert!((of_head(&head(2.4, Some((12.0, far.clone()))), 6.0, 0.2).longer_turn - 1.25).abs() < 1e-9);
        assert!((of_head(&head(0.9, Some((12.0, far))), 6.0, 0.2).longer_turn - 1.25).abs() < 1e-9);
        let near = vec![mode("fastest", 2.4, 4.0)];
        assert!((of_head(&head(2.4, Some((10.0, near))), 6.0, 0.2).longer_turn - 1.0).abs() < 1e-12);
    }
}
