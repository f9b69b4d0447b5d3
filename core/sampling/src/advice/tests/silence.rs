//! Displayed advice while a head is silent, and after its return. The heads are those of the shipped vehicles.

use super::*;
use crate::schedule::Schedule;
use headrace_geometry::time::{DurNs, MonoNs};

/// Time between two advice updates, s.
const BEAT_S: f64 = 0.2;
/// Time until silence is noticed, s.
const NOTICED_S: f64 = 2.0;
/// Ratio of the driven to the displayed speed above which screens say TOO FAST.
const TOO_FAST: f64 = 1.05;

/// Heads of a vehicle with their positions (m) and directions, the coverage target (m), and the planned speed (m/s).
struct Vehicle {
    heads: &'static [([f64; 3], bool)],
    target_m: f64,
    planned_mps: f64,
}

const X_M: f64 = 0.551;
const VEHICLES: [Vehicle; 3] = [
    Vehicle {
        heads: &[([X_M, 0.0, 0.0], false), ([-X_M, 0.0, 0.0], true)],
        target_m: 1.0,
        planned_mps: 0.197,
    },
    Vehicle {
        heads: &[([X_M, 0.0, 0.0], false), ([-X_M, 0.15, 0.0], true), ([-X_M, -0.15, 0.0], true)],
        target_m: 0.7,
        planned_mps: 0.11,
    },
    Vehicle {
        heads: &[
            ([X_M, 0.15, 0.0], false),
            ([X_M, -0.15, 0.0], false),
            ([-X_M, 0.15, 0.0], true),
            ([-X_M, -0.15, 0.0], true),
        ],
        target_m: 0.5,
        planned_mps: 0.1,
    },
];

/// A head that is silent for a while, and then takes some time to return to its program.
#[derive(Debug, Clone, Copy)]
struct Fault {
    head: usize,
    from_s: f64,
    for_s: f64,
    homing_s: f64,
}

impl Fault {
    /// Time from which the head turns as programmed, s.
    fn over_s(&self) -> f64 {
        self.from_s + self.for_s + self.homing_s
    }
}

impl Vehicle {
    /// Case with the heads as scheduled, at a driven speed.
    fn case(&self, speed_mps: f64) -> Case {
        let x_m: Vec<f64> = self.heads.iter().map(|(place, _)| place[0]).collect();
        let mut case = Case::new(&vec![0.0; x_m.len()], &x_m, speed_mps, self.target_m);
        case.specs = self.heads.iter().map(|(place, aft)| fixtures::head(*place, *aft, 0.03)).collect();
        self.turn(&mut case, 0.0);
        case
    }

    /// Sets the heads to their scheduled angles at a time.
    fn turn(&self, case: &mut Case, at_s: f64) {
        let schedule = Schedule::new(&case.specs, HeadLayout::PhaseShift, self.planned_mps).unwrap();
        let angle_rad =
            |head: usize, at_s: f64| schedule.angle_rad(head, DurNs::from_secs_f64(at_s)).unwrap();
        for (head, (slot, spec)) in case.situation.heads.iter_mut().zip(&case.specs).enumerate() {
            let ping_s = (at_s / spec.ping_period_s).floor() * spec.ping_period_s + 1e-6;
            let [before_rad, last_rad] =
                [ping_s, ping_s + spec.ping_period_s].map(|at_s| angle_rad(head, at_s));
            let step_rad = math::wrap_signed(last_rad - before_rad, TAU);
            let rate_radps = step_rad / spec.ping_period_s;
            *slot = Some(HeadMotion {
                mount: spec.mount,
                angle_rad: before_rad + rate_radps * (at_s - ping_s),
                rate_radps,
                step_rad: step_rad.abs(),
                sector_rad: None,
            });
        }
    }

    /// Largest speed that meets the target with the heads at their scheduled phases, m/s. The head `without` is left
    /// out, if one is given.
    fn limit_mps(&self, speed_mps: f64, without: Option<usize>) -> f64 {
        let mut case = self.case(speed_mps);
        if let Some(head) = without {
            case.situation.heads[head] = None;
        }
        case.advice().v_max_mps / (1.0 - SPEED_MARGIN)
    }

    /// Displayed speed at each update of a dive with a fault: times (s) and speeds (m/s).
    fn displayed(&self, speed_mps: f64, fault: &Fault) -> Vec<(f64, f64)> {
        let mut case = self.case(speed_mps);
        let mut advisor = case.advisor();
        let (mut returning, mut steady) = (ReturningHeads::default(), Hysteresis::new(self.target_m));
        let updates = (0_i64..).map(|update| update as f64 * BEAT_S);
        let display = |at_s: f64| {
            self.turn(&mut case, at_s);
            let silent_s = fault.from_s + NOTICED_S..fault.from_s + fault.for_s;
            let slot = &mut case.situation.heads[fault.head];
            if silent_s.contains(&at_s) {
                *slot = None;
            } else if (silent_s.end..fault.over_s()).contains(&at_s) {
                let motion = slot.as_mut().unwrap();
                (motion.rate_radps, motion.step_rad) = (motion.rate_radps.signum() * 2.8, 0.042);
                motion.angle_rad = 2.8 * at_s;
            }
            let [y_m, z_m] = case.profile.reference();
            let position = Point3::new(100.0 + speed_mps * at_s, y_m, z_m);
            case.situation.pose = Some(Pose { position, attitude: Rot::identity() });
            let at = MonoNs(1_000_000_000) + DurNs::from_secs_f64(at_s);
            let counted = returning.left_out(at, &case.situation);
            let advice = advisor.advise(&counted, Swing::default(), None);
            let in_step = Phasing::of(&counted).in_step();
            (at_s, steady.show(at, in_step, advice).v_max_mps)
        };
        updates.take_while(|at_s| *at_s < fault.over_s() + 40.0).map(display).collect()
    }
}

/// The heads' supply fails, and all heads go home together when it returns.
#[test]
fn heads_that_all_return_together_count_once_they_turn_in_their_usual_steps() {
    for vehicle in &VEHICLES {
        let usual = vehicle.case(vehicle.planned_mps).situation;
        let silent = Situation { heads: usual.heads.map(|_| None), ..usual };
        let mut homing = usual;
        for motion in homing.heads.iter_mut().flatten() {
            (motion.rate_radps, motion.step_rad) = (motion.rate_radps.signum() * 2.8, 0.042);
        }
        let mut returning = ReturningHeads::default();
        let mut counted = |at_s: i64, situation: &Situation| {
            let at = MonoNs(0) + DurNs::from_millis(1000 * at_s);
            returning.left_out(at, situation).heads.iter().flatten().count()
        };
        let all = counted(0, &usual);
        assert!(all > 0 && counted(1, &silent) == 0);
        assert_eq!([counted(6, &homing), counted(7, &homing), counted(8, &usual)], [0, 0, all]);
    }
}

/// Numbers from a seed.
fn drawn(seed: &mut u64, from: f64, to: f64) -> f64 {
    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    from + (to - from) * (*seed >> 11) as f64 / (1_u64 << 53) as f64
}

/// The displayed speed falls once, when the silence is noticed, and rises once, a second after the head's return.
#[test]
fn silent_head_changes_the_displayed_speed_once_when_it_fails_and_once_when_it_returns() {
    let mut seed = 5;
    for number in 0..36_usize {
        let vehicle = &VEHICLES[number % 3];
        let fault = Fault {
            head: number / 3 % vehicle.heads.len(),
            from_s: drawn(&mut seed, 20.0, 30.0),
            for_s: drawn(&mut seed, 5.0, 40.0),
            homing_s: if number % 2 == 0 { 0.0 } else { drawn(&mut seed, 0.1, 2.0) },
        };
        let speed_mps = drawn(&mut seed, 0.6, 1.0) * vehicle.limit_mps(vehicle.planned_mps, None);
        let healthy_mps = vehicle.limit_mps(speed_mps, None);
        let without_mps = vehicle.limit_mps(speed_mps, Some(fault.head));
        let displayed = vehicle.displayed(speed_mps, &fault);
        let what = format!("{number}: {speed_mps} m/s, {healthy_mps} and {without_mps} m/s, {fault:?}");
        let changes: Vec<_> = displayed
            .windows(2)
            .filter(|pair| (pair[0].1 - pair[1].1).abs() > 1e-9)
            .map(|pair| pair[1])
            .collect();
        assert!(changes.len() <= 2, "{what}: {changes:?}");
        for (at_s, mps) in displayed {
            let after = |changed_s: f64, within_s: f64| (changed_s..changed_s + within_s).contains(&at_s);
            let noticed_s = fault.from_s + NOTICED_S;
            let is_silent = (noticed_s + BEAT_S..fault.over_s()).contains(&at_s);
            let limit_mps = if is_silent { without_mps } else { healthy_mps };
            assert!(mps <= limit_mps * 1.001, "{what}: {mps} at {at_s}");
            let is_settled = !after(noticed_s, BEAT_S) && !after(fault.over_s(), 1.0 + 2.0 * BEAT_S);
            assert!(!is_settled || mps >= 0.85 * limit_mps, "{what}: {mps} at {at_s}");
            let is_too_fast = speed_mps > TOO_FAST * mps;
            assert!(!is_settled || !is_too_fast || speed_mps > limit_mps, "{what}: too fast at {at_s}");
        }
    }
}

/// The displayed speed hardly depends on the driven speed.
#[test]
fn displayed_speed_changes_by_at_most_a_tenth_for_each_centimetre_per_second_of_driven_speed() {
    let long_ago = Fault { head: 0, from_s: -20.0, for_s: 1.0, homing_s: 0.0 };
    for vehicle in &VEHICLES {
        let speeds = (4..60).map(|k| 0.005 * f64::from(k)).take_while(|mps| *mps < 1.5 * vehicle.planned_mps);
        let displayed: Vec<(f64, f64)> =
            speeds.map(|mps| (mps, vehicle.displayed(mps, &long_ago).last().unwrap().1)).collect();
        for pair in displayed.windows(3) {
            let (before_mps, after_mps) = (pair[0].1, pair[2].1);
            assert!((after_mps / before_mps - 1.0).abs() < 0.1, "{pair:?}");
        }
    }
}
