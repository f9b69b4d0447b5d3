//! Driving figures of the vehicle and its heads at each advice update. They are stored with the passage of
//! each section.

use bevy_ecs::prelude::Resource;

use super::missing_samples::MissingSampleFinder;
use crate::resources::Plan;
use headrace_coverage::Drive;
use headrace_geometry::frames::Vec3;
use headrace_geometry::math;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_geometry::tunnel::{Profile, Yz};
use headrace_sampling::head::{HeadMotion, HeadSet};
use headrace_sampling::layout::HeadLayout;
use headrace_sampling::losses::Sampled;
use headrace_sampling::margin::position_margin_m;
use headrace_sampling::passes::{Passes, Phasing, Situation};
use headrace_sampling::swing::Looks;

/// Longest time between neighbouring passes over which the rotation of the vehicle is computed, seconds.
const LONGEST_S: f64 = 50.0;
/// Relative change of an input above which the fitting speed is computed again. The fitting speed is the largest
/// speed that meets the target.
const SAME_PASSES: f64 = 0.01;
/// Search for the fitting speed: number of speeds tried, and ratio of each speed to the previous one.
const SLOWER: u32 = 80;
const SLOWER_BY: f64 = 0.97;
/// Number of beams in a turn for which the steps along the wall are computed.
const RAYS: u32 = 72;
/// Movement across the tunnel after which the steps along the wall are computed again, m.
const MOVED_M: f64 = 0.05;
/// Heads are in phase if the time between passes is at most this multiple of the scheduled time.
const IN_STEP: f64 = 1.05;
/// Number of classes into which places in a sector are divided, by the wait until the head's next pass.
///
/// At an end of the sector, this wait is a whole sweep there and back. In the middle, the wait is half as long.
const WAITS: usize = 4;
/// Speed below which the vehicle counts as stationary, m/s.
const SLOW_MPS: f64 = 0.01;

/// Driving figures at the last advice update, and the data kept to compute the next ones.
#[derive(Debug, Clone, Default, Resource)]
pub(crate) struct Driving {
    pub(super) now: Drive,
    /// Step of the heads, radians, and the place in the cross-section, m, for which the steps along the wall
    /// were last computed.
    step_rad: f64,
    place_m: [f64; 2],
    /// Largest steps along the wall, m, by class of the wait until the next pass.
    ///
    /// In class n the wait is at most 1 - n / 8 of the longest wait. With heads that turn continuously, all
    /// waits are equal.
    steps_m: [f64; WAITS],
    /// Inputs for which the fitting speed was last computed.
    ///
    /// The inputs are the time between passes, seconds, the steps along the wall, m, and the target minus its
    /// margin, m.
    fitted: [f64; 3],
    looks: Looks,
    pub(super) missing_finder: MissingSampleFinder,
}

stateful!(Driving { state: now, step_rad, place_m, steps_m, fitted, looks, missing_finder; });

impl Driving {
    /// Updates the driving figures from the present situation, and from the same situation with no head
    /// silent or stalled.
    ///
    /// Allocates: never.
    pub(super) fn note(
        &mut self,
        at: MonoNs,
        [situation, healthy]: [&Situation; 2],
        profile: &Profile,
        plan: &Plan,
    ) {
        let Some(pose) = situation.pose else {
            self.now.swing_m = 0.0;
            return;
        };
        self.note_gaps(at, [situation, healthy], plan.planned_speed_mps);
        self.now.other = plan.other;
        self.note_fit(healthy, plan);
        let t_y_m = self.now.middle_t_y_m;
        let sampled = Sampled { target_m: plan.target.max_hole_m, t_y_m, perimeter_m: profile.perimeter_m() };
        self.now.passes_needed = sampled.passes_needed(situation.losses_of_turning());
        self.now.lost = situation.lost_at_most;
        let place_m = [pose.position.y(), pose.position.z()];
        self.note_steps(situation, place_m, profile);
        let look = pose.attitude * Vec3::new(1.0, 0.0, 0.0);
        // Two neighbouring passes may belong to heads at different places along the hull.
        let apart_s = apart_m(situation) / situation.speed_mps.abs().max(SLOW_MPS);
        let since = at - DurNs::from_secs_f64((self.now.healthy_gap_s + apart_s).min(LONGEST_S));
        let turned_rad = self.looks.turned_since(look, since);
        self.now.swing_m = turned_rad * profile.farthest_m(place_m);
        self.looks.keep(at, look);
    }

    /// Updates the fitting speed, the largest speed that meets the target, if the heads' passes have changed.
    fn note_fit(&mut self, healthy: &Situation, plan: &Plan) {
        let now = &mut self.now;
        let margin_m = position_margin_m(plan.target, healthy.pass_error_m, now.middle_t_y_m);
        let sure_m = plan.target.max_hole_m - margin_m;
        let passes = [now.all_gap_s, now.middle_t_y_m, sure_m];
        if passes.iter().zip(self.fitted).all(|(now, then)| (now - then).abs() <= SAME_PASSES * now.abs()) {
            return;
        }
        self.fitted = passes;
        let along = |(number, step_m): (usize, &f64)| {
            let wait = 1.0 - number as f64 / (2 * WAITS) as f64;
            math::sqrt(((sure_m - step_m) * (sure_m + step_m)).max(0.0)) / wait
        };
        let along_m = self.steps_m.iter().enumerate().map(along).fold(f64::INFINITY, f64::min);
        now.fits_along_m = along_m;
        let scheduled = Phasing::of(healthy).as_scheduled(healthy.configured, now.planned_mps);
        let fits = |mps: f64| {
            let passes = scheduled.at(mps);
            let gap_s = passes.gap_s(passes.heads()).unwrap_or(f64::INFINITY);
            mps * (gap_s + now.ping_period_s) <= along_m
        };
        let most_mps = along_m / (now.all_gap_s + now.ping_period_s).max(1e-9);
        let mut slower = (0..SLOWER).scan(most_mps, |mps, _| {
            *mps *= SLOWER_BY;
            Some(*mps)
        });
        now.fits_mps = if now.planned_mps > 0.0 && fits(now.planned_mps) {
            now.planned_mps
        } else {
            slower.find(|mps| fits(*mps)).unwrap_or(0.0)
        };
    }

    /// Updates the largest steps along the wall if the vehicle's place or the heads' angular step has changed
    /// enough.
    fn note_steps(&mut self, situation: &Situation, place_m: Yz, profile: &Profile) {
        let step_rad = situation.heads.iter().flatten().map(|motion| motion.step_rad).fold(0.0, f64::max);
        if step_rad <= 0.0 {
            return;
        }
        let anew = (step_rad - self.step_rad).abs() > 1e-9;
        if anew {
            let sectors = if situation.layout == HeadLayout::SectorOffset { situation.configured } else { 0 };
            self.steps_m = steps_by_wait_m(profile, profile.reference(), step_rad, sectors);
            self.now.middle_t_y_m = self.steps_m.into_iter().fold(0.0, f64::max);
        }
        let off_m = math::hypot(place_m[0] - self.place_m[0], place_m[1] - self.place_m[1]);
        if anew || off_m > MOVED_M {
            let steps_m = steps_by_wait_m(profile, place_m, step_rad, 0);
            self.now.t_y_m = steps_m.into_iter().fold(self.now.middle_t_y_m, f64::max);
            self.place_m = place_m;
        }
        self.step_rad = step_rad;
    }

    fn note_gaps(&mut self, at: MonoNs, [situation, healthy]: [&Situation; 2], planned_mps: f64) {
        if healthy.heads.iter().flatten().count() == 0 {
            return;
        }
        let speed_mps = situation.speed_mps;
        let gap_s = |passes: &Passes| passes.gap_s(passes.heads()).unwrap_or(0.0);
        let as_it_is = Phasing::of(situation);
        let passes = as_it_is.at(speed_mps);
        let turning = passes.heads().len();
        let phasing = Phasing::of(healthy);
        let all = phasing.at(speed_mps);
        let healthy_gap_s = gap_s(&all);
        let scheduled = phasing.as_scheduled(situation.configured, planned_mps);
        let planned_gap_s = gap_s(&scheduled.at(speed_mps)).min(healthy_gap_s);
        let plan_mps = if planned_mps > 0.0 { planned_mps } else { speed_mps };
        let stalled = self.missing_finder.stalled;
        let in_step = passes.heads().iter().filter(|head| !stalled.has(*head));
        let in_step = in_step.fold(HeadSet::default(), HeadSet::with);
        let scheduled_at_plan = scheduled.at(plan_mps);
        let left_at_plan_s = scheduled_at_plan.gap_s(in_step);
        let gap_at_plan_s = gap_s(&as_it_is.at(plan_mps));
        let healthy_at_plan_s = gap_s(&phasing.at(plan_mps));
        let all_turn = turning == situation.configured && self.missing_finder.all_turn(at);
        // At a speed other than the planned one, the evenness of passes doesn't show whether the heads are in
        // phase. Therefore the times between passes at the planned speed are compared.
        if all_turn && gap_at_plan_s <= IN_STEP * gap_s(&scheduled_at_plan).min(healthy_at_plan_s) {
            self.missing_finder.stalled = HeadSet::default();
        }
        let periods = healthy.heads.iter().flatten().map(HeadMotion::ping_period_s);
        self.now = Drive {
            speed_mps: speed_mps.abs(),
            planned_mps,
            gap_s: if turning > 0 { gap_s(&passes) } else { self.now.gap_s },
            even_gap_s: if turning > 0 { passes.even_gap_s() } else { self.now.even_gap_s },
            healthy_gap_s,
            planned_gap_s,
            all_gap_s: all.even_gap_s(),
            gap_at_plan_s: if turning > 0 { gap_at_plan_s } else { self.now.gap_at_plan_s },
            healthy_at_plan_s,
            left_at_plan_s: left_at_plan_s.unwrap_or(self.now.left_at_plan_s),
            ping_period_s: periods.fold(0.0, f64::max),
            is_unheard: healthy.heads.iter().flatten().count() < situation.configured,
            is_in_sectors: situation.layout == HeadLayout::SectorOffset,
            ..self.now
        };
    }
}

/// Largest steps along the wall between two neighbouring beams, m, by class of the wait until the next pass.
///
/// The beams come from `place_m` and are `step_rad` apart. The head sweeps `sectors` sectors. Without sectors
/// all classes equal the first.
fn steps_by_wait_m(profile: &Profile, place_m: Yz, step_rad: f64, sectors: usize) -> [f64; WAITS] {
    let arc_m = |angle_rad: f64| {
        let wall = profile.cast(place_m, [math::sin(angle_rad), -math::cos(angle_rad)]);
        wall.map(|wall| wall.arc_m)
    };
    let mut steps_m = [0.0_f64; WAITS];
    for k in 0..RAYS {
        let angle_rad = math::TAU * f64::from(k) / f64::from(RAYS);
        let Some((from_m, to_m)) = arc_m(angle_rad).zip(arc_m(angle_rad + step_rad)) else { continue };
        let step_m = math::wrap_signed(to_m - from_m, profile.perimeter_m()).abs();
        let share = math::wrap(f64::from(k) * sectors as f64 / f64::from(RAYS), 1.0);
        let number = math::floor_to_i64(share.min(1.0 - share) * (2 * WAITS) as f64);
        let place = usize::try_from(number).unwrap_or(0).min(WAITS - 1);
        if let Some(slot) = steps_m.get_mut(place) {
            *slot = slot.max(step_m);
        }
    }
    steps_m
}

/// Distance along the hull between the foremost and the rearmost turning head, m.
fn apart_m(situation: &Situation) -> f64 {
    let x_m = || situation.heads.iter().flatten().map(|motion| motion.mount.position.x());
    (x_m().fold(f64::NEG_INFINITY, f64::max) - x_m().fold(f64::INFINITY, f64::min)).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_coverage::OtherSettings;
    use headrace_geometry::frames::{Mount, Point3, Pose, Rot};
    use headrace_geometry::tunnel::shapes;
    use headrace_sampling::Target;
    use headrace_sampling::head::MAX_HEADS;
    use headrace_sampling::losses::LossRate;

    const STEP_RAD: f64 = 0.9 * math::TAU / 360.0;

    /// Situation of four heads side by side that turn in 8 s, with these angles, on a vehicle in the centre
    /// of a pipe.
    fn situation(angles_deg: [f64; 4], speed_mps: f64, profile: &Profile) -> Situation {
        let mut heads = [None; MAX_HEADS];
        for (slot, angle_deg) in heads.iter_mut().zip(angles_deg) {
            *slot = Some(HeadMotion {
                mount: Mount { position: Vec3::zero(), rotation: Rot::identity() },
                angle_rad: angle_deg.to_radians(),
                rate_radps: math::TAU / 8.0,
                step_rad: STEP_RAD,
                sector_rad: None,
            });
        }
        let [y_m, z_m] = profile.reference();
        Situation {
            pose: Some(Pose { position: Point3::new(5.0, y_m, z_m), attitude: Rot::identity() }),
            speed_mps,
            pass_error_m: 0.0,
            layout: HeadLayout::PhaseShift,
            configured: 4,
            heads,
            deaf: headrace_sampling::head::HeadSet::default(),
            losses: [LossRate::default(); MAX_HEADS],
            lost_at_most: LossRate::default(),
        }
    }

    fn plan(planned_speed_mps: f64) -> Plan {
        let (target, layout) = (Target::new(0.5), HeadLayout::PhaseShift);
        Plan { target, layout, planned_speed_mps, other: OtherSettings::default() }
    }

    const EVEN: [f64; 4] = [0.0, 90.0, 180.0, 270.0];

    fn noted(driving: &mut Driving, angles_deg: [f64; 4], speed_mps: f64, planned_mps: f64) -> Drive {
        let profile = shapes::circle(3.0).unwrap();
        let plan = plan(planned_mps);
        let situation = situation(angles_deg, speed_mps, &profile);
        driving.note(MonoNs(60_000_000_000), [&situation, &situation], &profile, &plan);
        driving.now
    }

    /// Four heads are a quarter of a turn apart and turn in 8 s. Without one of them, the longest gap between
    /// the others is half a turn.
    #[test]
    fn stalled_head_counts_as_stalled_until_it_is_back_in_phase() {
        let near = |found: f64, expected: f64| (found - expected).abs() < 1e-9;
        let mut driving = Driving::default();
        assert!(near(noted(&mut driving, EVEN, 0.2, 0.2).left_at_plan_s, 2.0), "no head has stalled");
        driving.missing_finder.stalled = HeadSet::default().with(1);
        // The restored head is a sixteenth of a turn late.
        let late = noted(&mut driving, [0.0, 67.5, 180.0, 270.0], 0.2, 0.2);
        assert!(near(late.left_at_plan_s, 4.0) && near(late.gap_s, 2.5) && near(late.planned_gap_s, 2.0));
        assert!(near(late.even_gap_s, 2.0), "as if the heads were evenly spread");
        assert!(driving.missing_finder.stalled.has(1));
        let again = noted(&mut driving, EVEN, 0.2, 0.2);
        assert!(near(again.left_at_plan_s, 4.0) && near(again.gap_s, 2.0));
        assert!(driving.missing_finder.stalled.is_empty(), "the head is in phase again");
        assert!(near(noted(&mut driving, EVEN, 0.2, 0.2).left_at_plan_s, 2.0));
    }

    #[test]
    fn time_between_passes_is_kept_while_all_heads_are_stalled() {
        let profile = shapes::circle(3.0).unwrap();
        let plan = plan(0.2);
        let mut driving = Driving::default();
        let before = noted(&mut driving, EVEN, 0.2, 0.2);
        let healthy = situation(EVEN, 0.2, &profile);
        let none = Situation { heads: [None; MAX_HEADS], ..healthy };
        driving.note(MonoNs(90_000_000_000), [&none, &healthy], &profile, &plan);
        let times = |drive: &Drive| [drive.gap_s, drive.even_gap_s, drive.gap_at_plan_s].map(f64::to_bits);
        assert_eq!(times(&driving.now), times(&before), "{:?}", driving.now);
    }

    /// From the centre of a pipe of 3 m radius a step measures 0.0471 m along the wall. This leaves 0.4978 m
    /// of the target along the tunnel, to be driven in 2 s plus one ping period.
    #[test]
    fn speed_that_meets_the_target_allows_for_steps_along_the_wall() {
        let along_m = math::sqrt(0.25 - 9.0 * STEP_RAD * STEP_RAD);
        let most_mps = along_m / 2.02;
        let fits_mps = |planned_mps: f64| {
            let mut driving = Driving::default();
            // The steps along the wall are known only after the first advice update.
            noted(&mut driving, EVEN, -0.1, planned_mps);
            let now = noted(&mut driving, EVEN, -0.1, planned_mps);
            assert!((now.fits_along_m - along_m).abs() < 1e-6 && (now.speed_mps - 0.1).abs() < 1e-12);
            assert!((now.t_y_m - 3.0 * STEP_RAD).abs() < 1e-6 && (now.ping_period_s - 0.02).abs() < 1e-12);
            now.fits_mps
        };
        assert!((fits_mps(0.2) - 0.2).abs() < 1e-12, "as planned");
        // Neighbouring speeds of the search differ by 3 %. The fastest suitable one is found.
        for planned_mps in [0.0, 1.02 * most_mps] {
            let found = fits_mps(planned_mps);
            assert!(found <= most_mps && found > 0.96 * most_mps, "{planned_mps}: {found} of {most_mps}");
        }
    }

    /// The place is 1 m below the centre of a pipe of 3 m radius. Per radian, a step measures 2 m along the
    /// floor, 4 m along the ceiling and 3 m at the sides.
    #[test]
    fn largest_step_is_found_for_each_class_of_waiting_time_until_the_next_pass() {
        const SMALL_RAD: f64 = 1e-4;
        let profile = shapes::circle(3.0).unwrap();
        let [y_m, z_m] = profile.reference();
        let of = |[right_m, up_m]: [f64; 2], sectors: usize| {
            let steps_m = steps_by_wait_m(&profile, [y_m - right_m, z_m + up_m], SMALL_RAD, sectors);
            steps_m.map(|step_m| step_m / SMALL_RAD)
        };
        let near = |found: f64, expected: f64| (found - expected).abs() < 0.02 * expected;
        let all = of([0.0, -1.0], 0);
        assert!(
            near(all[0], 4.0) && all[1..].iter().all(|step| step.abs() <= 0.0),
            "all waits must be equal: {all:?}"
        );
        // Two sectors end at the floor and at the ceiling. The middle quarter of each sector is at a side of
        // the pipe.
        let below = of([0.0, -1.0], 2);
        assert!(near(below[0], 4.0) && (3.0..3.5).contains(&below[3]), "{below:?}");
        assert!(below.windows(2).all(|pair| pair[0] > pair[1]), "decreasing from the ceiling on: {below:?}");
        for aside_m in [-1.0, 1.0] {
            let beside = of([aside_m, 0.0], 2);
            assert!(near(beside[3], 4.0) && (3.0..3.7).contains(&beside[0]), "{beside:?}");
        }
        // Four sectors also end at the sides. The middle quarter of each upper sector begins at 34 degrees,
        // where a step measures 3.83 m per radian.
        let four = of([0.0, -1.0], 4);
        assert!(near(four[0], 4.0) && near(four[3], 3.83), "{four:?}");
        // From the centre a step measures the same everywhere.
        assert!(of([0.0, 0.0], 3).iter().all(|step| near(*step, 3.0)));
    }

    /// The farther the vehicle is from the centre, the longer is a step on the opposite wall.
    #[test]
    fn steps_are_recomputed_after_a_5_cm_move_sideways_or_a_changed_head_step() {
        let profile = shapes::circle(3.0).unwrap();
        let mut driving = Driving::default();
        let mut t_y_m = |aside_m: f64, finer: f64| {
            let mut situation = situation(EVEN, 0.1, &profile);
            for motion in situation.heads.iter_mut().flatten() {
                motion.step_rad *= finer;
            }
            let [y_m, z_m] = profile.reference();
            driving.note_steps(&situation, [y_m + aside_m, z_m], &profile);
            (driving.now.t_y_m, driving.now.middle_t_y_m)
        };
        let near = |found: (f64, f64), t_y_m: f64, middle_m: f64| {
            (found.0 - t_y_m).abs() < 1e-5 && (found.1 - middle_m).abs() < 1e-5
        };
        let middle_m = 3.0 * STEP_RAD;
        assert!(near(t_y_m(0.0, 1.0), middle_m, middle_m));
        assert!(near(t_y_m(0.04, 1.0), middle_m, middle_m), "little has changed");
        assert!(near(t_y_m(0.3, 1.0), 3.3 * STEP_RAD, middle_m));
        assert!(near(t_y_m(0.26, 1.0), 3.3 * STEP_RAD, middle_m), "little has changed since");
        assert!(near(t_y_m(0.26, 0.5), 1.63 * STEP_RAD, 0.5 * middle_m), "another mode");
        assert!(near(t_y_m(0.0, 0.5), 0.5 * middle_m, 0.5 * middle_m));
    }
}
