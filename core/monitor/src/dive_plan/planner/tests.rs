use super::super::missed::Missed;
use super::*;
use crate::fixtures::{mount, situation};
use headrace_geometry::frames::{Mount, Vec3};
use headrace_geometry::math::TAU;
use headrace_sampling::head::MAX_HEADS;

const SETTINGS: PlanSettings =
    PlanSettings { end_m: 40.0, transit_mps: 0.2, planned_mps: 0.1, run_up_m: 1.0 };
const STEP_S: f64 = 0.2;

fn missed(number: u32, near_m: f64, far_m: f64, is_rolled: bool) -> Missed {
    let (missed_m, changes) = (far_m - near_m - 2.0, Changes::default());
    Missed { run: RunId(number), near_m, far_m, missed_m, at_most_mps: 0.08, is_rolled, changes }
}

/// Dive in which the vehicle does what the first step says.
struct Dive {
    planner: Planner,
    missed: Vec<Missed>,
    x_m: f64,
    speed_mps: f64,
    updates: u32,
    plan: Option<DivePlan>,
    left_s: Option<f64>,
}

impl Dive {
    fn at(x_m: f64, missed: &[Missed]) -> Self {
        let mut planner = Planner::new(SETTINGS);
        planner.progress.visited_m = Some([0.0, 0.0, x_m]);
        Self { planner, missed: missed.to_vec(), x_m, speed_mps: 0.0, updates: 0, plan: None, left_s: None }
    }

    fn update(&mut self) -> Option<DiveStep> {
        let mut list = MissedList::default();
        self.missed.iter().for_each(|entry| list.add(*entry));
        let situation = Situation { speed_mps: self.speed_mps, ..situation(Some(self.x_m)) };
        let at = MonoNs(0) + DurNs::from_secs_f64(STEP_S * f64::from(self.updates));
        self.updates += 1;
        let now = Now { at, situation: &situation, is_sure: true, v_max_mps: Some(0.1), left_s: self.left_s };
        self.plan = self.planner.update(&now, &list, self.plan);
        self.plan?.steps[0]
    }

    /// Drives towards the end of a step, at most for one update.
    fn follow(&mut self, step: &DiveStep) {
        let mps = step.at_most_mps.unwrap_or(SETTINGS.transit_mps);
        let before_m = self.x_m;
        self.x_m += (step.to_m - before_m).clamp(-mps * STEP_S, mps * STEP_S);
        self.speed_mps = (self.x_m - before_m) / STEP_S;
    }
}

/// Stretches are cleared here by the number of complete slow passes, which is counted apart from the planner.
#[test]
fn vehicle_that_follows_the_first_step_makes_every_pass_in_the_planned_time() {
    let all = [missed(0, 5.0, 9.0, false), missed(1, 14.0, 18.0, true), missed(2, 24.0, 29.5, false)];
    let mut dive = Dive::at(27.0, &all);
    let mut instructions = Vec::new();
    let (mut reached, mut passes) = ([None; 3], [0; 3]);
    let mut planned_s = None;
    while !dive.missed.is_empty() {
        let step = dive.update().unwrap();
        planned_s = planned_s.or(dive.plan.map(|plan| plan.takes_s));
        let instruction = (step.kind, (step.to_m * 10.0).round());
        if instructions.last() != Some(&instruction) {
            instructions.push(instruction);
        }
        dive.follow(&step);
        for (entry, (reached, passes)) in all.iter().zip(reached.iter_mut().zip(&mut passes)) {
            let is_slow = dive.speed_mps.abs() <= 0.0801;
            let is_within = (entry.near_m - 0.01..=entry.far_m + 0.01).contains(&dive.x_m);
            let ends = [entry.near_m, entry.far_m].map(|end_m| (dive.x_m - end_m).abs() < 0.01);
            if ends[0] || ends[1] {
                let is_other = reached.is_some_and(|before: bool| before != ends[1]);
                *passes += u32::from(is_other && is_slow);
                *reached = Some(ends[1]);
            } else if !is_slow || !is_within {
                *reached = None;
            }
            if *passes > u32::from(entry.is_rolled) {
                dive.missed.retain(|left| left.run != entry.run);
            }
        }
        assert!(instructions.len() <= 12, "steps don't change needlessly: {instructions:?}");
        assert!(dive.updates < 20_000, "the dive ends: {instructions:?}");
    }
    let home_s = dive.x_m / SETTINGS.transit_mps;
    let took_s = STEP_S * f64::from(dive.updates) + home_s;
    let planned_s = planned_s.unwrap();
    assert!(
        (took_s - planned_s).abs() < 0.02 * planned_s,
        "{took_s} s, planned {planned_s} s: {instructions:?}"
    );
}

#[test]
fn pass_is_given_up_if_the_vehicle_is_too_fast_or_turns() {
    for (speed_mps, back_m) in [(-0.15, 0.0), (-0.05, 0.5)] {
        let mut dive = Dive::at(40.0, &[missed(0, 20.0, 30.0, false)]);
        dive.update();
        dive.x_m = 30.0;
        dive.update();
        for x_m in [29.0, 27.0, 25.0] {
            (dive.x_m, dive.speed_mps) = (x_m, -0.05);
            dive.update();
        }
        let step = dive.update().unwrap();
        assert_eq!((step.kind, step.to_m), (StepKind::Inspect, 20.0), "the pass goes on");
        (dive.x_m, dive.speed_mps) = (25.0 + back_m, speed_mps);
        let step = dive.update().unwrap();
        assert_eq!(step.kind, StepKind::Go, "{speed_mps} m/s, {back_m} m back: {step:?}");
    }
}

#[test]
fn remaining_time_limits_the_plan() {
    let mut dive = Dive::at(30.0, &[missed(0, 10.0, 20.0, false)]);
    dive.update();
    assert!(dive.plan.is_some_and(|plan| plan.all_fits() && plan.left_s.is_none()));
    let mut dive = Dive::at(30.0, &[missed(0, 10.0, 20.0, false)]);
    dive.left_s = Some(170.0);
    dive.update();
    let plan = dive.plan.unwrap();
    assert!(plan.is_in_time() && !plan.all_fits() && plan.stays_ahead_m > 5.0, "{plan:?}");
}

#[test]
fn no_plan_is_made_without_a_position_or_a_missed_stretch() {
    let mut dive = Dive::at(30.0, &[]);
    assert_eq!(dive.update(), None);
    let now_without = situation(None);
    let now = Now { at: MonoNs(0), situation: &now_without, is_sure: false, v_max_mps: None, left_s: None };
    let mut list = MissedList::default();
    list.add(missed(0, 10.0, 20.0, false));
    assert_eq!(dive.planner.update(&now, &list, None), None);
}

/// Two heads turn in 8 s, the first one `apart_m` ahead of the second.
fn two_heads(apart_m: f64) -> Situation {
    let mut heads = [None; MAX_HEADS];
    for (number, slot) in heads.iter_mut().take(2).enumerate() {
        let position = Vec3::new(apart_m * (0.5 - number as f64), 0.0, 0.0);
        *slot = Some(HeadMotion {
            mount: Mount { position, ..mount() },
            angle_rad: 0.0,
            rate_radps: TAU / 8.0,
            step_rad: 0.0157,
            sector_rad: None,
        });
    }
    Situation { configured: 2, heads, ..situation(Some(5.0)) }
}

/// In phase, the heads pass every 4 s. Heads that are an odd number of quarter advances apart pass together on the way
/// out, every 8 s, and the vehicle must be about half as fast.
#[test]
fn heads_apart_along_the_hull_may_need_a_lower_speed_on_the_way_out() {
    let share = |apart_m: f64| outward_mps(&two_heads(apart_m), 0.1, 0.1) / 0.1;
    assert!((share(0.0) - 1.0).abs() < 1e-9);
    // Half the advance of a turn, 0.4 m: in phase in both directions.
    assert!((share(0.4) - 1.0).abs() < 1e-6, "{}", share(0.4));
    let quarter = share(0.2);
    assert!((0.4..0.9).contains(&quarter), "{quarter}");
}
