//! Interleaving of several heads by the paper's §5. The tests step the heads ping by ping along a straight tunnel.
//!
//! The tests collect the chainages at which each head looks at a given angle. Each head is stepped by its own
//! ping-by-ping schedule (`HeadProgram`). The formulas for the layout of the heads are therefore not checked against
//! themselves.

use headrace_geometry::frames::{Mount, Rot, Vec3};
use headrace_geometry::math::{PI, TAU, floor_to_i64};
use headrace_geometry::time::DurNs;
use headrace_sampling::SamplingError::{HeadCount, Negative, NotPositive, SectorNeedsHeads};
use headrace_sampling::head::{HeadBody, HeadProgram, HeadSpec};
use headrace_sampling::layout::HeadLayout::{self, PhaseShift, SectorOffset};
use headrace_sampling::layout::{
    InSector, Sector, alternating_m, hull_rule, in_step, programs, sectors, turned_over_rad,
};
use headrace_sampling::schedule::Schedule;
use proptest::{prelude::*, test_runner::RngSeed};

/// Angles that differ by less than this count as equal, radians. The value is far above rounding errors and far below
/// a step.
const SAME_RAD: f64 = 1e-9;
const SAME_M: f64 = 1e-7;
/// Number of pings in a turn, divisible by 2 to 6 sectors.
const STEPS: u32 = 120;
/// Directions in which the heads face: all forward; forward and aft in turn; the first forward and all others aft; all
/// aft.
const FACINGS: [fn(usize) -> bool; 4] = [|_| false, |k| k % 2 == 1, |k| k > 0, |_| true];

const SPEEDS_MPS: [f64; 3] = [0.1, 0.197, 0.8];

/// A set of heads mounted along a hull. All heads are on the hull's axis and turn in the same direction.
#[derive(Debug, Clone)]
struct Rig {
    hull_m: Vec<f64>,
    aft: Vec<bool>,
    steps: u32,
    turn_s: f64,
}

impl Rig {
    fn new(hull_m: &[f64], aft: fn(usize) -> bool, turn_s: f64) -> Self {
        Self { hull_m: hull_m.to_vec(), aft: (0..hull_m.len()).map(aft).collect(), steps: STEPS, turn_s }
    }

    fn step_rad(&self) -> f64 {
        TAU / f64::from(self.steps)
    }

    fn ping_s(&self) -> f64 {
        self.turn_s / f64::from(self.steps)
    }

    fn specs(&self) -> Vec<HeadSpec> {
        let spec = |(&x_m, &aft): (&f64, &bool)| HeadSpec {
            mount: Mount {
                position: Vec3::new(x_m, 0.0, 0.0),
                rotation: Rot::from_roll_pitch_yaw(0.0, 0.0, if aft { PI } else { 0.0 }),
            },
            step_rad: self.step_rad(),
            ping_period_s: self.ping_s(),
            range_m: [0.2, 10.0],
            sound_speed_mps: 1500.0,
            beam_rad: 0.02,
            body: HeadBody { radius_m: 0.04, ahead_m: 0.03, behind_m: 0.2 },
        };
        self.hull_m.iter().zip(&self.aft).map(spec).collect()
    }

    /// Simulates a dive at `speed_mps` with heads laid out for `planned_mps`. The dive is longer than the hull by the
    /// distance that the vehicle covers in some turns.
    fn dive(&self, layout: HeadLayout, planned_mps: f64, speed_mps: f64) -> Dive {
        let [back_m, front_m] = ends(&self.hull_m);
        let ping_m = speed_mps * self.ping_s();
        let pings = 5 * self.steps + u32::try_from(floor_to_i64((front_m - back_m) / ping_m)).unwrap();
        let track = |(k, program): (usize, &HeadProgram)| {
            let sense = if self.aft[k] { -1.0 } else { 1.0 };
            let body: Vec<f64> =
                walk(program, self.step_rad(), pings).iter().map(|own| sense * own).collect();
            let off = wrapped(body[0] - TAU * k as f64 / self.hull_m.len() as f64);
            assert!(
                self.hull_m[k] < front_m || off.abs() < SAME_RAD,
                "the foremost head {k} starts at {}",
                body[0]
            );
            Track { x_m: self.hull_m[k], ping_m, body }
        };
        let programmed = programs(&self.specs(), layout, planned_mps).unwrap();
        let travel_m = f64::from(pings - 1) * ping_m;
        Dive {
            tracks: programmed.iter().enumerate().map(track).collect(),
            shared_m: [front_m, back_m + travel_m],
        }
    }
}

/// Smallest and largest of the values.
fn ends(of: &[f64]) -> [f64; 2] {
    [of.iter().copied().fold(f64::MAX, f64::min), of.iter().copied().fold(f64::MIN, f64::max)]
}

/// Angle wrapped to between minus and plus half a turn.
fn wrapped(angle: f64) -> f64 {
    angle - TAU * (angle / TAU).round()
}

/// Angles of a head at its pings. They continue to grow over several turns, and are not reduced to one turn.
fn walk(program: &HeadProgram, step_rad: f64, pings: u32) -> Vec<f64> {
    let mut step_rad = if program.growing { step_rad } else { -step_rad };
    let Some((least, size)) = program.sector else {
        return (0..pings).map(|n| program.start_rad + f64::from(n) * step_rad).collect();
    };
    let mut along = wrapped(program.start_rad - (least + size / 2.0)) + size / 2.0;
    assert!(along > -SAME_RAD && along < size + SAME_RAD, "starts outside its sector: {program:?}");
    let mut angles = Vec::new();
    for _ in 0..pings {
        angles.push(least + along);
        if (if step_rad > 0.0 { size - along } else { along }) < SAME_RAD {
            step_rad = -step_rad;
        }
        along = (along + step_rad).clamp(0.0, size);
    }
    angles
}

/// Motion of a head: its start, the distance between pings, and its angle in the body frame at each ping.
struct Track {
    x_m: f64,
    ping_m: f64,
    body: Vec<f64>,
}

impl Track {
    /// Chainages at which the head looks at an angle of the body frame. If the head turns back exactly at this angle,
    /// the two passes count as one.
    fn passes(&self, angle: f64) -> Vec<f64> {
        let off: Vec<f64> = self.body.iter().map(|body| wrapped(body - angle)).collect();
        let mut found = Vec::new();
        for (n, &now) in off.iter().enumerate() {
            let before = if n == 0 { 0.0 } else { off[n - 1] };
            if now.abs() < SAME_RAD {
                found.push(self.x_m + n as f64 * self.ping_m);
            } else if before.abs() >= SAME_RAD && before * now < 0.0 && (before - now).abs() < PI {
                found.push(self.x_m + (n as f64 - now / (now - before)) * self.ping_m);
            }
        }
        found
    }

    /// Angle of the head in the body frame when the head is at a chainage.
    fn body_at(&self, chainage_m: f64) -> f64 {
        let n = (chainage_m - self.x_m) / self.ping_m;
        let whole = usize::try_from(floor_to_i64(n)).unwrap();
        self.body[whole] + (self.body[whole + 1] - self.body[whole]) * (n - whole as f64)
    }
}

struct Dive {
    tracks: Vec<Track>,
    /// First and last chainage of the stretch that all heads have passed, m.
    shared_m: [f64; 2],
}

impl Dive {
    /// Chainages at which any head passes an angle of the body frame, in order, within the chainages that all heads
    /// have passed.
    fn passes(&self, angle: f64) -> Vec<f64> {
        let mut all: Vec<f64> = self.tracks.iter().flat_map(|track| track.passes(angle)).collect();
        all.retain(|&m| m > self.shared_m[0] - SAME_M && m < self.shared_m[1] + SAME_M);
        all.sort_by(f64::total_cmp);
        all
    }

    /// Checks that all passes over an angle are evenly spaced, `apart_m` apart.
    fn assert_even(&self, angle: f64, apart_m: f64) {
        let (all, [first, last]) = (self.passes(angle), self.shared_m);
        assert!(all.len() > 3 && all[0] - first < apart_m + SAME_M, "{all:?} from {first}");
        assert!(last - all[all.len() - 1] < apart_m + SAME_M, "{all:?} up to {last}");
        for gap in gaps(&all) {
            assert!((gap - apart_m).abs() < SAME_M, "{gap} for {apart_m} at {angle}: {all:?}");
        }
    }

    /// Checks that at any chainage all heads are at the same position within their sectors.
    fn assert_in_step(&self, within_rad: f64) {
        let [first, last] = self.shared_m;
        for place_m in (0..200).map(|n| first + (last - first) * f64::from(n) / 200.3) {
            for (k, track) in self.tracks.iter().enumerate() {
                let sector = TAU * k as f64 / self.tracks.len() as f64;
                let off = wrapped(track.body_at(place_m) - sector - self.tracks[0].body_at(place_m));
                assert!(off.abs() < within_rad, "head {k} is {off} rad off at {place_m} m");
            }
        }
    }

    /// Checks that only head `k` passes the angles of its sector, and that the distances between this head's passes
    /// alternate between two values.
    fn assert_two_distances(&self, k: usize, pitch_m: f64) {
        let heads = self.tracks.len();
        for share in [0.0, 0.03, 0.25, 0.4, 0.5, 0.75, 0.9, 1.0] {
            let angle = TAU * (k as f64 + share) / heads as f64;
            let mut own = self.tracks[k].passes(angle);
            if [0.0, 1.0].contains(&share) {
                // At the ends of its sector the head turns back, so two of its passes coincide.
                own = own.iter().flat_map(|&m| [m, m]).collect();
            } else {
                let by = |track: &&Track| !track.passes(angle).is_empty();
                assert_eq!(self.tracks.iter().filter(by).count(), 1, "another head passes sector {k}");
            }
            let [small, large] = alternating_m(pitch_m, heads, share).unwrap();
            assert!(gaps(&own).len() > 3 * heads && small >= 0.0, "{own:?}, {small}");
            for pair in gaps(&own).windows(2) {
                assert!(
                    (pair[0] + pair[1] - 2.0 * pitch_m / heads as f64).abs() < SAME_M,
                    "{pair:?} at {share}"
                );
                let [least, most] = ends(pair);
                assert!((least - small).abs() + (most - large).abs() < SAME_M, "{pair:?}, {small}, {large}");
            }
        }
    }
}

fn gaps(passes: &[f64]) -> Vec<f64> {
    passes.windows(2).map(|pair| pair[1] - pair[0]).collect()
}

/// Hulls with all heads at one place, with evenly spaced heads, and with unevenly spaced heads that aren't in order.
fn hulls(heads: usize) -> [Vec<f64>; 3] {
    let uneven = [0.4, -0.71, 1.102, 0.05, -0.33, 0.62];
    [vec![0.3; heads], (0..heads).map(|k| -0.3 * k as f64).collect(), uneven[..heads].to_vec()]
}

fn random_rig() -> impl Strategy<Value = Rig> {
    let (hull_m, aft) = (prop::collection::vec(-1.5..1.5, 6), prop::collection::vec(any::<bool>(), 6));
    (2..=6_usize, hull_m, aft, 20..150_u32, 2.0..25.0).prop_map(|(heads, hull_m, aft, steps, turn_s)| Rig {
        hull_m: hull_m[..heads].to_vec(),
        aft: aft[..heads].to_vec(),
        steps,
        turn_s,
    })
}

#[test]
fn phase_shifted_heads_pass_each_angle_at_equal_distances() {
    for (heads, facing) in (2..=6).flat_map(|heads| FACINGS.map(|facing| (heads, facing))) {
        for (hull_m, speed_mps) in hulls(heads).iter().flat_map(|hull_m| SPEEDS_MPS.map(|v| (hull_m, v))) {
            let dive = Rig::new(hull_m, facing, 8.0).dive(PhaseShift, speed_mps, speed_mps);
            for angle in (0..12).map(|n| TAU * f64::from(n) / 11.5) {
                dive.assert_even(angle, speed_mps * 8.0 / heads as f64);
            }
        }
    }
}

#[test]
fn sector_heads_stay_in_phase_and_their_pass_distances_alternate() {
    for (heads, facing) in (2..=6).flat_map(|heads| FACINGS.map(|facing| (heads, facing))) {
        for speed_mps in SPEEDS_MPS {
            let pitch_m = speed_mps * 21.6;
            // The distances between heads are whole numbers of pings, so that all heads pass any chainage at the same
            // steps of their turns.
            let hull_m =
                [37, 0, 251, 90, 90, 163].map(|pings| -f64::from(pings) * pitch_m / f64::from(STEPS));
            let rig = Rig::new(&hull_m[..heads], facing, 21.6);
            assert_eq!(sectors(&rig.specs()), (0..heads).collect::<Vec<_>>());
            let dive = rig.dive(SectorOffset, speed_mps, speed_mps);
            dive.assert_in_step(1e-7);
            for k in 0..heads {
                dive.assert_two_distances(k, pitch_m);
                // At the border of two sectors, the heads of both sectors turn back. They do so at evenly spaced
                // chainages.
                dive.assert_even(TAU * (k + 1) as f64 / heads as f64, pitch_m / heads as f64);
            }
            // If the distances between heads aren't whole numbers of pings, a head may reach the end of its sector up
            // to one ping early or late.
            for hull_m in hulls(heads) {
                let rig = Rig::new(&hull_m, facing, 21.6);
                rig.dive(SectorOffset, speed_mps, speed_mps).assert_in_step(rig.step_rad());
            }
        }
    }
}

/// The cases are steps of 2.4 degrees in sectors of 90 degrees, and steps of 0.9 degrees in sectors of 120 degrees. The
/// last step of a sector is shorter, and makes the sweep longer than twice the turn time divided by the number of
/// heads.
#[test]
fn heads_in_sectors_not_divisible_by_the_angular_step_are_in_phase_within_two_pings() {
    for (steps, heads, turn_s) in [(150, 4, 4.8), (400, 3, 8.0)] {
        let rig = Rig { steps, ..Rig::new(&hulls(heads)[2], |_| false, turn_s) };
        rig.dive(SectorOffset, 0.1, 0.1).assert_in_step(2.0 * rig.step_rad());
    }
}

#[test]
fn algorithm_1_gives_a_head_the_angle_of_the_lead_head_at_the_same_chainage() {
    for (of, (behind_m, speed_mps)) in (2..=6_usize)
        .flat_map(|of| [(0.0, 0.3), (0.3, 0.197), (1.102, 0.5), (3.7, 0.4), (-0.6, 0.197)].map(|at| (of, at)))
    {
        let (size, rig) = (TAU / of as f64, Rig::new(&[0.0], |_| false, 6.6));
        let program = HeadProgram { start_rad: 0.0, growing: true, sector: Some((0.0, size)) };
        let ping_m = speed_mps * rig.ping_s();
        let lead = Track { x_m: 0.0, ping_m, body: walk(&program, rig.step_rad(), 8 * STEPS) };
        // The tested chainages begin at a place that both heads have passed, and are 1.37 pings apart.
        for now_m in (0..150).map(|n| 3.8 + f64::from(n) * 1.37 * ping_m) {
            let state = |m: f64| (lead.body_at(m), lead.body_at(m + SAME_M) > lead.body_at(m));
            let ((angle_rad, growing), (along, outward)) = (state(now_m), state(now_m - behind_m));
            for (number, reversed) in (0..of).flat_map(|k| [(k, false), (k, true)]) {
                let sector = Sector { number, of, behind_m, reversed };
                let got = in_step(InSector { angle_rad, growing }, &sector, 6.6, speed_mps).unwrap();
                let body = if reversed { -got.angle_rad } else { got.angle_rad };
                let off = wrapped(body - along - number as f64 * size);
                assert!(off.abs() < 1e-8, "{sector:?} {off} off, lead at {angle_rad} {growing}");
                assert!((0.0..TAU).contains(&got.angle_rad), "{got:?}");
                // At the places where a head turns back, either direction of its motion is right.
                if along > 1e-5 && along < size - 1e-5 {
                    assert_eq!(got.growing, outward != reversed, "{sector:?}, lead {angle_rad} {growing}");
                }
            }
        }
    }
}

#[test]
fn pass_gaps_above_the_planned_speed_differ_by_the_phase_errors() {
    let (turn_s, planned_mps, speed_mps) = (8.0, 0.197, 0.25);
    let pitch_m = speed_mps * turn_s;
    for (heads, facing) in (2..=6).flat_map(|heads| FACINGS.map(|facing| (heads, facing))) {
        for hull_m in &hulls(heads)[1..] {
            let dive = Rig::new(hull_m, facing, turn_s).dive(PhaseShift, planned_mps, speed_mps);
            // Delay of a head at position x along the hull, in turns: x / (v T) - x / (v' T), with planned speed v,
            // driven speed v' and turn time T. It adds to the head's planned phase.
            let late = |x_m: f64| (ends(hull_m)[1] - x_m) * (1.0 / planned_mps - 1.0 / speed_mps) / turn_s;
            let first: Vec<f64> = dive.tracks.iter().map(|track| track.passes(1.0)[0]).collect();
            for k in 1..heads {
                let turns = late(hull_m[k]) - late(hull_m[0]) - k as f64 / heads as f64;
                let off = (first[k] - first[0]) / pitch_m - turns;
                assert!((off - off.round()).abs() < 1e-9, "head {k} of {hull_m:?}: {off} turns off");
            }
            let [_, widest] = ends(&gaps(&dive.passes(1.0)));
            assert!(widest > pitch_m / heads as f64 + 0.05, "{widest} for {heads} heads at {hull_m:?}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        // The random seed is fixed. With other seeds, about one start angle in a million is so close to a step of the
        // head that rounding decides which ping reaches it.
        cases: 100, failure_persistence: None, rng_seed: RngSeed::Fixed(881), ..ProptestConfig::default()
    })]

    #[test]
    fn heads_anywhere_along_the_hull_interleave(rig in random_rig(), speed_mps in 0.05..1.0, angle in 0.0..TAU) {
        let apart_m = speed_mps * rig.turn_s / rig.hull_m.len() as f64;
        rig.dive(PhaseShift, speed_mps, speed_mps).assert_even(angle, apart_m);
    }

    /// The driven speed differs from the planned speed, so that the gaps between passes are not all equal.
    #[test]
    fn shifting_or_reversing_all_heads_does_not_change_the_pass_gaps(
        rig in random_rig(), layout in prop::sample::select(vec![PhaseShift, SectorOffset]),
        shift_m in -3.0..3.0, speed_mps in 0.05..1.0, angle in 0.0..TAU,
    ) {
        let spacing = |rig: &Rig| gaps(&rig.dive(layout, speed_mps, 1.3 * speed_mps).passes(angle));
        let shifted = Rig { hull_m: rig.hull_m.iter().map(|x_m| x_m + shift_m).collect(), ..rig.clone() };
        let mirrored = Rig { aft: rig.aft.iter().map(|aft| !aft).collect(), ..rig.clone() };
        for (was, is) in [(spacing(&rig), spacing(&shifted)), (spacing(&rig), spacing(&mirrored))] {
            prop_assert!(was.len() > 2 && was.len() == is.len(), "{was:?} {is:?}");
            prop_assert!(was.iter().zip(&is).all(|(was, is)| (was - is).abs() < SAME_M), "{was:?} {is:?}");
        }
    }

    #[test]
    fn schedule_angles_match_stepping_each_head_ping_by_ping(
        rig in random_rig(), layout in prop::sample::select(vec![PhaseShift, SectorOffset]), speed_mps in 0.05..1.0,
    ) {
        let schedule = Schedule::new(&rig.specs(), layout, speed_mps).unwrap();
        for (k, program) in schedule.programs().enumerate() {
            let (least, size) = program.sector.unwrap_or((0.0, TAU));
            for (n, own) in walk(program, rig.step_rad(), 3 * rig.steps).into_iter().enumerate() {
                for part in [0.01, 0.5, 0.99] {
                    let since = DurNs::from_secs_f64((n as f64 + part) * rig.ping_s());
                    let got = schedule.angle_rad(k, since).unwrap();
                    prop_assert!(wrapped(got - own).abs() < 1e-8, "{got} for {own} at ping {n}: {program:?}");
                    prop_assert!(got >= least - SAME_RAD && got <= least + size + SAME_RAD, "{got}: {program:?}");
                }
            }
        }
    }
}

#[test]
fn sector_of_12_5_steps_ends_with_a_half_step() {
    let rig = Rig { steps: 50, ..Rig::new(&[0.0; 4], |_| false, 5.0) };
    let schedule = Schedule::new(&rig.specs(), SectorOffset, 0.2).unwrap();
    assert!((schedule.sweep_s().unwrap() - 2.6).abs() < 1e-9, "{:?}", schedule.sweep_s());
    let out = (0..13).map(|n| 7.2 * f64::from(n));
    let sweep: Vec<f64> = out.clone().chain(out.map(|degrees| 90.0 - degrees)).collect();
    for (n, degrees) in (0..1000).zip(sweep.iter().cycle()) {
        // A head must keep a ping's angle from the ping's exact nanosecond until a microsecond before the next ping.
        // Rounding could break this, because 0.3 / 0.1 is below 3 in floating point.
        for ns in [100_000_000 * n, 100_000_000 * n + 99_999_000] {
            let got = schedule.angle_rad(0, DurNs(ns)).unwrap().to_degrees();
            assert!((got - degrees).abs() < 1e-6, "{got} for {degrees} at {ns} ns");
        }
    }
    assert_eq!((schedule.angle_rad(0, DurNs(-1)), schedule.angle_rad(4, DurNs::ZERO)), (None, None));
}

#[test]
fn impossible_layout_is_a_named_error() {
    let specs = |heads: usize| Rig::new(&vec![0.0; heads], |_| false, 8.0).specs();
    let refusal = |heads: &[HeadSpec], layout, speed_mps| {
        let refused = programs(heads, layout, speed_mps).unwrap_err();
        assert_eq!(Schedule::new(heads, layout, speed_mps).unwrap_err().to_string(), refused.to_string());
        refused
    };
    assert_eq!(refusal(&specs(1), SectorOffset, 0.2), SectorNeedsHeads { heads: 1 });
    assert_eq!(alternating_m(1.0, 1, 0.5), Err(SectorNeedsHeads { heads: 1 }));
    let (lead, far) = (InSector { angle_rad: 0.1, growing: true }, Vec3::new(f64::NAN, 0.0, 0.0));
    let sector = Sector { number: 1, of: 2, behind_m: 0.3, reversed: false };
    for layout in [PhaseShift, SectorOffset] {
        for heads in [0, 9] {
            assert_eq!(refusal(&specs(heads), layout, 0.2), HeadCount { heads });
        }
        for bad in [-0.1, f64::NAN, f64::INFINITY] {
            assert!(matches!(refusal(&specs(2), layout, bad), Negative { .. }), "{bad} m/s");
            let slow = HeadSpec { ping_period_s: bad, ..specs(1)[0] };
            assert!(matches!(refusal(&[slow; 2], layout, 0.2), NotPositive { .. }), "a ping in {bad} s");
            assert!(matches!(in_step(lead, &sector, 8.0, bad), Err(Negative { .. })), "{bad} m/s");
            assert!(matches!(in_step(lead, &sector, bad, 0.2), Err(NotPositive { .. })), "{bad} s");
            assert!(matches!(turned_over_rad(1.0, 0.3, bad), Err(Negative { .. })), "{bad} m/s");
            assert!(matches!(hull_rule(0.3, 2, bad, 8.0), Err(NotPositive { .. })), "{bad} m/s");
            assert!(alternating_m(bad, 2, 0.5).is_err() && alternating_m(1.0, 2, bad).is_err(), "{bad}");
        }
        let nowhere = HeadSpec { mount: Mount { position: far, ..specs(1)[0].mount }, ..specs(1)[0] };
        assert!(matches!(refusal(&[specs(1)[0], nowhere], layout, 0.2), Negative { .. }));
    }
}

#[test]
fn step_of_zero_or_less_is_a_named_error_in_both_layouts() {
    for (layout, step_rad) in [PhaseShift, SectorOffset].into_iter().flat_map(|l| [(l, 0.0), (l, -0.1)]) {
        let head = HeadSpec { step_rad, ..Rig::new(&[0.0], |_| false, 8.0).specs()[0] };
        assert!(programs(&[head; 2], layout, 0.2).is_err(), "{layout:?} in steps of {step_rad}");
    }
}

#[test]
fn lead_head_outside_sector_0_is_a_named_error() {
    let sector = Sector { number: 1, of: 4, behind_m: 0.3, reversed: false };
    for angle_rad in [-0.1, 1.6, 6.2, f64::NAN] {
        let got = in_step(InSector { angle_rad, growing: true }, &sector, 8.0, 0.2);
        assert!(got.is_err(), "a lead at {angle_rad}, outside 0 to a quarter turn, gives {got:?}");
    }
}
