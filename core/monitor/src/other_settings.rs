//! What other settings of the heads would change: a finer step, a longer range. Both take longer to go round, which counts where a section's
//! hole is to be told as it would have been with them.

use bevy_ecs::prelude::World;

use super::entities::HeadSpecification;
use super::head_words::HeadSettings;
use headrace_coverage::OtherSettings;
use headrace_geometry::frames::{Point3, Pose, Rot};
use headrace_geometry::tunnel::Profile;
use headrace_sampling::advice::{Looks, ModeName};
use headrace_sampling::head::{HeadMode, HeadSpec};
use headrace_sampling::ring::{Ring, Standing};
use headrace_sampling::spacing::speed_for_target_mps;
use headrace_sensor::device::Device;
use headrace_vehicle::Mission;

/// Range settings that are asked for, whole metres up to this one.
const LONGEST_M: u32 = 200;
/// Steps closer together than this are equal, radians.
const SAME_STEP_RAD: f64 = 1e-6;

impl HeadSpecification {
    /// Of a device that is a head, for a mission.
    pub fn of(device: &dyn Device, spec: HeadSpec, mission: &Mission) -> Self {
        let modes = device.modes(None).unwrap_or_default();
        Self { spec, modes, reaching: reaching(device, &spec, mission) }
    }

    /// With its source's id: what it could be set to in a tunnel that is inspected with a target T, m.
    pub fn settings(&self, name: &str, profile: &Profile, target_m: f64) -> HeadSettings {
        let [_, own_m] = self.spec.range_m;
        let range_m = self.reaching.as_ref().map(|(range_m, _)| *range_m);
        // As many as live advice looks at the wall with, whose mode is on the same screen.
        let rays = Looks::default().ring;
        let ring = self.ring_in_the_middle(profile, rays).unwrap_or_default();
        let finer = self.finer(target_m, |step_rad| ring.largest_step_m(Ring::stride(step_rad, rays)));
        HeadSettings {
            name: name.to_owned(),
            finer: finer.map(|mode| ModeName::new(mode.name)),
            longer_m: range_m.filter(|range_m| *range_m > own_m),
        }
    }

    /// Of the modes with a finer step, the one that lets the vehicle go fastest; where none meets the target, the finest. `t_y_m` is the step
    /// along the wall, m, of a step of the head, radians.
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

    /// The wall as it sees it where the vehicle is level in the middle; none where it is outside then.
    fn ring_in_the_middle(&self, profile: &Profile, rays: u32) -> Option<Ring> {
        let [y, z] = profile.reference();
        let pose = Pose { position: Point3::new(0.0, y, z), attitude: Rot::identity() };
        Ring::cast(&Standing::new(profile, &pose, &self.spec.mount).ok()?, 0.0, rays).ok()
    }
}

/// The shortest range setting of a head, m, its own or a longer one, that reaches all wall from the middle of the tunnel, with the modes
/// there; none where no setting does.
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
    // By steps that beams meet squarely: whether a mode would do in corners, too, the trial's samples say.
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
    fn the_mode_in_which_it_goes_fastest_is_taken_and_takes_longer() {
        // 0.9 degrees are 0.094 m on wall 6 m away, 0.6 degrees 0.063 m.
        let at = |target_m: f64| of_head(&head(2.4, None), 6.0, target_m);
        let roomy = at(0.2);
        assert!((roomy.finer_step - 0.375).abs() < 1e-9 && (roomy.finer_turn - 8.0 / 4.8).abs() < 1e-9);
        let close = at(0.1);
        assert!((close.finer_step - 0.25).abs() < 1e-9 && (close.finer_turn - 10.8 / 4.8).abs() < 1e-9);
        // None meets the target: the finest.
        assert_eq!(at(0.01), close);
        let finest = of_head(&head(0.6, None), 6.0, 0.2);
        assert_eq!((finest.finer_step, finest.finer_turn, finest.longer_turn), (1.0, 1.0, 1.0));
    }

    /// In a corner, or where beams graze the wall, a step is longer than where they meet it squarely: what would do there isn't named.
    #[test]
    fn the_wall_as_it_is_decides() {
        let ceran = shapes::ceran().unwrap();
        let named = |target_m: f64| head(2.4, None).settings("", &ceran, target_m).finer;
        let farthest_m = ceran.farthest_m(ceran.reference());
        assert!(0.9_f64.to_radians() * farthest_m < 0.13, "squarely FAST would do");
        assert_eq!(named(0.14).unwrap().as_str(), "medium");
        assert_eq!(named(0.5).unwrap().as_str(), "fast");
    }

    #[test]
    fn a_longer_range_takes_as_long_as_its_own_mode_does_there() {
        let far = vec![mode("fast", 0.9, 10.0), mode("fastest", 2.4, 6.0)];
        assert!((of_head(&head(2.4, Some((12.0, far.clone()))), 6.0, 0.2).longer_turn - 1.25).abs() < 1e-9);
        assert!((of_head(&head(0.9, Some((12.0, far))), 6.0, 0.2).longer_turn - 1.25).abs() < 1e-9);
        let near = vec![mode("fastest", 2.4, 4.0)];
        assert!((of_head(&head(2.4, Some((10.0, near))), 6.0, 0.2).longer_turn - 1.0).abs() < 1e-12);
    }
}
