//! The plan against an oracle that tries all orders and directions, and against the list of missed stretches.

use proptest::prelude::*;

use super::*;

const TRANSIT_MPS: f64 = 0.2;

fn pass(near_m: f64, far_m: f64, inward_mps: f64, outward_mps: f64) -> Pass {
    Pass {
        run: RunId(0),
        near_m,
        far_m,
        missed_m: far_m - near_m - 2.0,
        inward_mps,
        outward_mps,
        is_speed_known: true,
        roll: Roll::Level,
        changes: Changes::default(),
    }
}

fn start(x_m: f64, left_s: Option<f64>) -> Start {
    Start { x_m, home_m: 0.0, transit_mps: TRANSIT_MPS, left_s, begun: None }
}

/// Stretch of the oracle: ends, speeds by direction (inward, outward), run-up at each end.
#[derive(Debug, Clone, Copy)]
struct Job {
    ends_m: [f64; 2],
    mps: [f64; 2],
    run_up_m: f64,
}

impl Job {
    /// Place at which the vehicle begins and ends a share of the job, its speed, and the covered length.
    fn drive(&self, is_inward: bool, share: f64) -> ([f64; 2], f64, f64) {
        let length_m = self.ends_m[1] - self.ends_m[0];
        let run_ups_m = 2.0 * self.run_up_m;
        let covered_m = (share * length_m - run_ups_m).max(0.0);
        if is_inward {
            ([self.ends_m[0], self.ends_m[0] + share * length_m], self.mps[0], covered_m)
        } else {
            ([self.ends_m[1], self.ends_m[1] - share * length_m], self.mps[1], covered_m)
        }
    }
}

/// Time and covered length of jobs in an order, with the home run. One of them may be done in part.
fn driven(x_m: f64, order: &[(Job, bool)], part: Option<(usize, f64)>) -> (f64, f64) {
    let (mut at_m, mut time_s, mut sum_m) = (x_m, 0.0, 0.0);
    for (number, (job, is_inward)) in order.iter().enumerate() {
        let share = part.filter(|(of, _)| *of == number).map_or(1.0, |(_, share)| share);
        let ([from_m, to_m], mps, covered_m) = job.drive(*is_inward, share);
        time_s += (from_m - at_m).abs() / TRANSIT_MPS + (to_m - from_m).abs() / mps;
        (at_m, sum_m) = (to_m, sum_m + covered_m);
    }
    (time_s + at_m.abs() / TRANSIT_MPS, sum_m)
}

/// Takes jobs in an order, each with whether it is driven inward.
type Visit<'a> = dyn FnMut(&[(Job, bool)]) + 'a;

/// Calls `visit` for every order and direction of every subset of the jobs. The last job of `jobs` is driven inward
/// only if `has_ahead`.
fn all_orders(jobs: &[Job], has_ahead: bool, order: &mut Vec<(usize, bool)>, visit: &mut Visit<'_>) {
    let resolved: Vec<(Job, bool)> =
        order.iter().map(|(number, is_inward)| (jobs[*number], *is_inward)).collect();
    visit(&resolved);
    for number in 0..jobs.len() {
        if order.iter().any(|(of, _)| *of == number) {
            continue;
        }
        for is_inward in [true, false] {
            if is_inward || !(has_ahead && number + 1 == jobs.len()) {
                order.push((number, is_inward));
                all_orders(jobs, has_ahead, order, visit);
                order.pop();
            }
        }
    }
}

fn jobs(passes: &[Pass], onward: Option<Onward>) -> Vec<Job> {
    let job = |pass: &Pass| Job {
        ends_m: [pass.near_m, pass.far_m],
        mps: [pass.inward_mps, pass.outward_mps],
        run_up_m: 1.0,
    };
    let ahead = |ahead: Onward| Job {
        ends_m: [ahead.from_m, ahead.to_m],
        mps: [ahead.at_most_mps; 2],
        run_up_m: 0.0,
    };
    passes.iter().map(job).chain(onward.map(ahead)).collect()
}

/// Least time for all jobs.
fn least_s(x_m: f64, jobs: &[Job], has_ahead: bool) -> f64 {
    let mut least_s = f64::INFINITY;
    all_orders(jobs, has_ahead, &mut Vec::new(), &mut |order| {
        if order.len() == jobs.len() {
            least_s = least_s.min(driven(x_m, order, None).0);
        }
    });
    least_s
}

/// Largest length that can be covered in a time, if one job may be done in part.
fn most_m(x_m: f64, jobs: &[Job], has_ahead: bool, time_s: f64) -> f64 {
    let mut most_m = 0.0_f64;
    all_orders(jobs, has_ahead, &mut Vec::new(), &mut |order| {
        let (whole_s, whole_m) = driven(x_m, order, None);
        if whole_s <= time_s {
            most_m = most_m.max(whole_m);
            return;
        }
        for number in 0..order.len() {
            if driven(x_m, order, Some((number, 0.0))).0 > time_s {
                continue;
            }
            let (mut low, mut high) = (0.0, 1.0);
            for _ in 0..40 {
                let middle = f64::midpoint(low, high);
                let fits = driven(x_m, order, Some((number, middle))).0 <= time_s;
                (low, high) = if fits { (middle, high) } else { (low, middle) };
            }
            most_m = most_m.max(driven(x_m, order, Some((number, low))).1);
        }
    });
    most_m
}

/// Scene: the vehicle's chainage, disjoint passes, and the tunnel ahead.
type Scene = (f64, Vec<Pass>, Option<Onward>);

fn scene(most_passes: usize) -> impl Strategy<Value = Scene> {
    let pass_figures = (0.5..12.0, 2.3..8.0, 0.05..0.15, 0.3..1.0);
    let passes = prop::collection::vec(pass_figures, 1..=most_passes);
    (passes, -0.1..1.2_f64, prop::option::of((0.05..0.15, 1.0..60.0))).prop_map(|(figures, place, ahead)| {
        let mut end_m = 0.0;
        let passes: Vec<Pass> = figures
            .into_iter()
            .map(|(gap_m, length_m, mps, share)| {
                let near_m = end_m + gap_m;
                end_m = near_m + length_m;
                pass(near_m, end_m, mps, mps * share)
            })
            .collect();
        let onward = ahead.map(|(at_most_mps, length_m)| Onward {
            from_m: end_m,
            to_m: end_m + length_m,
            at_most_mps,
        });
        ((place * end_m).clamp(0.0, end_m), passes, onward)
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, ..ProptestConfig::default() })]

    #[test]
    fn plan_takes_no_longer_than_the_best_of_all_orders_and_directions((x_m, passes, onward) in scene(6)) {
        // Six jobs in all keep the oracle fast.
        let onward = onward.filter(|_| passes.len() < 6);
        // Passes reach into the tunnel ahead by their run-up.
        let onward = onward.map(|ahead| Onward { from_m: ahead.from_m - 1.0, ..ahead });
        let found = plan(&start(x_m, None), &passes, onward);
        let least_s = least_s(x_m, &jobs(&passes, onward), onward.is_some());
        prop_assert!((found.takes_s - least_s).abs() < 1e-6 * least_s, "{} s, at best {least_s} s", found.takes_s);
        prop_assert!(found.all_fits());
    }

    #[test]
    fn plan_covers_as_much_as_the_best_of_all_orders_in_a_limited_time(
        (x_m, passes, onward) in scene(3),
        share in 0.05..1.0_f64,
    ) {
        let is_inside = |pass: &Pass| pass.near_m < x_m && x_m < pass.far_m;
        prop_assume!(!passes.iter().any(is_inside));
        let all_s = plan(&start(x_m, None), &passes, onward).takes_s;
        let left_s = x_m / TRANSIT_MPS + share * (all_s - x_m / TRANSIT_MPS);
        let found = plan(&start(x_m, Some(left_s)), &passes, onward);
        let jobs = jobs(&passes, onward);
        let all_m: f64 = jobs.iter().map(|job| job.ends_m[1] - job.ends_m[0] - 2.0 * job.run_up_m).sum();
        let covered_m = all_m - found.stays_missed_m - found.stays_ahead_m;
        let most_m = most_m(x_m, &jobs, onward.is_some(), left_s);
        prop_assert!((covered_m - most_m).abs() < 1e-4, "{covered_m} m, at best {most_m} m");
        prop_assert!(found.takes_s <= left_s + 1e-6, "{} of {left_s} s", found.takes_s);
    }

    #[test]
    fn more_time_never_leaves_more_wall_uncovered((x_m, passes, onward) in scene(8), shares in [0.0..1.2_f64, 0.0..1.2]) {
        let all_s = plan(&start(x_m, None), &passes, onward).takes_s;
        let stays_m = |share: f64| {
            let found = plan(&start(x_m, Some(share * all_s)), &passes, onward);
            found.stays_missed_m + found.stays_ahead_m
        };
        let (less, more) = (shares[0].min(shares[1]), shares[0].max(shares[1]));
        prop_assert!(stays_m(more) <= stays_m(less) + 1e-9);
    }

    #[test]
    fn plan_never_takes_longer_than_the_list((x_m, passes, onward) in scene(8)) {
        let jobs = jobs(&passes, onward);
        let planned_s = plan(&start(x_m, None), &passes, onward).takes_s;
        for listed_s in by_list(x_m, &jobs, onward.is_some()) {
            prop_assert!(planned_s <= listed_s + 1e-6, "{planned_s} s, by the list {listed_s} s");
        }
    }
}

/// Times to follow the list of missed stretches, from the far end to the portal, and to be back at the portal: each
/// stretch inward before the vehicle goes on, inward on the way out, and outward on the way out.
fn by_list(x_m: f64, jobs: &[Job], has_ahead: bool) -> [f64; 3] {
    let (missed, ahead) = jobs.split_at(jobs.len() - usize::from(has_ahead));
    let listed = |is_inward: bool| missed.iter().rev().map(move |job| (*job, is_inward));
    let ahead = || ahead.iter().map(|job| (*job, true));
    let time_s = |order: Vec<(Job, bool)>| driven(x_m, &order, None).0;
    [
        time_s(listed(true).chain(ahead()).collect()),
        time_s(ahead().chain(listed(true)).collect()),
        time_s(ahead().chain(listed(false)).collect()),
    ]
}

/// Random number in [0, 1).
fn random(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 33) as f64 / f64::from(1_u32 << 31)
}

/// Speeds are those of shipped vehicles: 0.05 to 0.15 m/s inwards, and `outward` times that on the way out.
fn random_scene(state: &mut u64, has_ahead: bool, outward: f64) -> Scene {
    let mut end_m = 10.0 * random(state);
    let passes: Vec<Pass> = (0..2 + (*state >> 40) % 5)
        .map(|_| {
            let near_m = end_m + 1.0 + 20.0 * random(state);
            end_m = near_m + 3.0 + 8.0 * random(state);
            let mps = 0.05 + 0.1 * random(state);
            pass(near_m, end_m, mps, outward * mps)
        })
        .collect();
    let x_m = end_m + 20.0 * random(state);
    let ahead_m = 10.0 + 50.0 * random(state);
    let at_most_mps = 0.05 + 0.1 * random(state);
    (x_m, passes, has_ahead.then_some(Onward { from_m: x_m, to_m: x_m + ahead_m, at_most_mps }))
}

/// The list and its alerts say: go back, then pass inward. The saving depends on when the list is followed and on the
/// speed outwards, so all are printed.
#[test]
fn plan_takes_20_percent_less_time_than_the_list_in_50_scenes() {
    let mut found = Vec::new();
    for (outward, has_ahead) in [(1.0, true), (1.0, false), (0.5, true), (0.5, false)] {
        let (mut planned_s, mut listed_s, mut state) = (0.0, [0.0; 3], 54);
        for _ in 0..50 {
            let (x_m, passes, onward) = random_scene(&mut state, has_ahead, outward);
            planned_s += plan(&start(x_m, None), &passes, onward).takes_s;
            let listed = by_list(x_m, &jobs(&passes, onward), has_ahead);
            listed_s.iter_mut().zip(listed).for_each(|(sum, s)| *sum += s);
        }
        let saved_pct = listed_s.map(|s| 100.0 * (1.0 - planned_s / s));
        println!(
            "speed outwards {outward} of inwards, tunnel ahead {has_ahead}: less than the list by {saved_pct:.0?} % \
             (at once, inward on the way out, outward on the way out)"
        );
        found.push(saved_pct);
    }
    // Following the list at once.
    assert!(found[0][0] >= 20.0 && found[1][0] >= 20.0 && found[2][0] >= 20.0, "{found:?}");
    // With slow passes outwards and no tunnel ahead, the list has almost the best order already.
    assert!(found[3].iter().all(|pct| *pct >= 0.0), "{found:?}");
}

/// A pass that needs both rolls is two steps, and a limited time leaves out the pass that covers least.
#[test]
fn steps_state_order_direction_speed_and_roll() {
    let rolled = Pass { roll: Roll::Left, ..pass(5.0, 10.0, 0.1, 0.0) };
    let found = plan(&start(30.0, None), &[rolled, pass(20.0, 26.0, 0.08, 0.08)], None);
    let steps: Vec<_> =
        found.steps.iter().flatten().map(|step| (step.kind, step.from_m, step.to_m, step.roll)).collect();
    let expected = [
        (StepKind::Go, 30.0, 26.0, Roll::Level),
        (StepKind::Inspect, 26.0, 20.0, Roll::Level),
        (StepKind::Go, 20.0, 5.0, Roll::Level),
    ];
    assert_eq!(steps, expected);
    // Inspect left, go back, inspect right, and home.
    assert_eq!(found.step_count, 7);
    let time_s = 4.0 / 0.2 + 6.0 / 0.08 + 15.0 / 0.2 + 2.0 * 5.0 / 0.1 + 5.0 / 0.2 + 10.0 / 0.2;
    assert!((found.takes_s - time_s).abs() < 1e-9);
    // No time is left for anything but the way back.
    let late = plan(&start(30.0, Some(100.0)), &[rolled], None);
    assert!(!late.is_in_time() && !late.all_fits() && (late.stays_missed_m - 3.0).abs() < 1e-9);
    assert_eq!(late.steps[0].map(|step| step.kind), Some(StepKind::Home));
}
