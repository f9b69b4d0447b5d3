use super::*;
use crate::entities::{Head, HeadFrontier, HeadSweep, HiddenAngles, Mounted};
use crate::fixtures::{coverage, mount, pipe};
use bevy_ecs::system::SystemState;
use bevy_ecs::world::World;
use headrace_geometry::frames::{Point3, Rot};
use headrace_geometry::math;
use headrace_sampling::layout::HeadLayout;
use headrace_sensor::device::{SensorInfo, SensorKind};
use headrace_sensor::reading::SourceId;

/// A real (not simulated) ping without a fix, with or without a return.
fn away(at_ms: u64, outcome: Outcome) -> PlacedPing {
    let at = MonoNs(at_ms * 1_000_000);
    PlacedPing {
        head: 1,
        received: at,
        valid_at: at,
        fix: None,
        reach: None,
        single_step: true,
        new_sweep: false,
        standing: false,
        outcome,
        angle_rad: 0.1,
        hidden: Hidden::No,
        longest_m: 5.0,
        source: SourceId(3),
        origin: None,
    }
}

/// An angle counts as hidden once seven in ten of its pings give no return. Only the last few hundred pings
/// count.
#[test]
fn angle_is_hidden_if_most_pings_get_no_return() {
    let hides = |pings: [u32; 2]| {
        let mut turning = Turning::default();
        for (count, is_lost) in pings.into_iter().zip([true, false]) {
            (0..count).for_each(|_| turning.note_hidden(true, is_lost));
        }
        turning.note_hidden(false, false);
        turning.is_hidden()
    };
    assert!(hides([0, 0]), "hidden until there is evidence");
    assert!(hides([70, 30]) && !hides([69, 31]));
    assert!(!hides([0, 3]) && hides([1, 0]));
    assert!(!hides([10_000, 400]), "the last hundreds of pings got returns");
}

/// The simulated pings of a silent head are lost as often as its real pings were, and in equally long series. The same
/// times always give the same losses.
#[test]
fn simulated_losses_match_the_share_and_clustering_of_real_losses() {
    let lost = |rate: LossRate| {
        let mut turning = Turning::default();
        (0..40_000).map(|k| turning.would_lose(MonoNs(k * 20_000_000), rate)).collect::<Vec<bool>>()
    };
    for (share, after_lost) in [(0.4, 0.4), (0.4, 0.95), (0.02, 0.5)] {
        let rate = LossRate { share, after_lost };
        let pings = lost(rate);
        let count = pings.iter().filter(|lost| **lost).count() as f64;
        let again = pings.windows(2).filter(|pair| pair[0] && pair[1]).count() as f64;
        assert!((count / 40_000.0 - share).abs() < 0.1 * share + 0.01, "{rate:?}: {count}");
        assert!((again / count - after_lost).abs() < 0.05, "{rate:?}: {again} of {count}");
        assert_eq!(pings, lost(rate));
    }
    assert!(lost(LossRate::default()).iter().all(|lost| !lost));
    assert!(lost(LossRate::independent(1.0)).iter().all(|lost| *lost));
}

#[test]
fn pings_without_a_fix_beyond_the_capacity_are_dropped_and_recorded() {
    let (mut missing_finder, mut missing_samples) =
        (MissingSampleFinder::default(), MissingSamples::default());
    let unplaced = Outcome::Unplaced(headrace_fusion::NoFix::Chainage);
    let missing = Outcome::Lost(Loss::Missing, None);
    for (k, outcome) in (0..ROOM).zip([unplaced, missing].into_iter().cycle()) {
        note_ping(&mut missing_finder, &away(k as u64, outcome), &mut missing_samples);
    }
    assert_eq!((missing_finder.away.len(), missing_finder.forgot), (ROOM, false));
    let [first, second] = [missing_finder.away[0], missing_finder.away[1]];
    assert_eq!((first.is_lost, second.is_lost), (false, true), "a return without a fix isn't lost");
    assert!([first, second].iter().all(|ping| ping.why == Causes::of(Cause::PositionLost) && ping.head == 1));
    note_ping(&mut missing_finder, &away(ROOM as u64, unplaced), &mut missing_samples);
    assert_eq!((missing_finder.away.len(), missing_finder.forgot), (ROOM, true), "the dropping is recorded");
}

fn samples_of(missing_samples: &MissingSamples) -> Vec<MissingSample> {
    missing_samples.between(f64::NEG_INFINITY, f64::INFINITY).copied().collect()
}

fn all_of(causes: &[Cause]) -> Causes {
    causes.iter().fold(Causes::default(), |all, cause| all.with(*cause))
}

/// At angles assumed to be hidden, losses are due to occlusion, unless other pings there do detect the wall.
#[test]
fn loss_at_an_occluded_angle_is_a_missing_return_once_other_pings_there_detect_wall() {
    let (mut missing_finder, mut missing_samples) =
        (MissingSampleFinder::default(), MissingSamples::default());
    let aim = Some(WallPoint { x_m: 3.0, arc_m: 2.0 });
    let lost = |loss: Loss| away(5, Outcome::Lost(loss, aim));
    let mut causes = |pings: &[PlacedPing]| {
        for ping in pings {
            note_ping(&mut missing_finder, ping, &mut missing_samples);
        }
        samples_of(&missing_samples).last().map(|missing| missing.why)
    };
    assert_eq!(causes(&[lost(Loss::Missing)]), Some(Causes::of(Cause::MissingReturns)));
    assert_eq!(causes(&[lost(Loss::OutOfRange)]), Some(Causes::of(Cause::OutOfRange)));
    assert_eq!(causes(&[lost(Loss::Occluded); 10]), Some(Causes::of(Cause::Occluded)));
    let point = Point3::new(3.0, 3.0, 3.0);
    let heard = PlacedPing { hidden: Hidden::Yes, ..away(5, Outcome::Sample { point, arc_m: 2.0 }) };
    causes(&[heard; 40]);
    assert_eq!(causes(&[lost(Loss::Occluded)]), Some(Causes::of(Cause::MissingReturns)));
    assert_eq!(causes(&[lost(Loss::OutOfRange)]), Some(Causes::of(Cause::OutOfRange)));
    let before = samples_of(&missing_samples).len();
    assert_eq!(before, 14, "pings with a return add none");
    note_ping(
        &mut missing_finder,
        &PlacedPing { standing: true, ..lost(Loss::Missing) },
        &mut missing_samples,
    );
    assert_eq!(samples_of(&missing_samples).len(), before, "a stalled head misses nothing at its own angle");
    assert!(missing_finder.stalled.has(1) && !missing_finder.stalled.has(0));
}

/// The head looks to the left, at wall 3 m away, and the vehicle is turned to the left by 0.1 rad. The beam
/// then meets the wall 3 tan 0.1 m astern.
#[test]
fn lost_ping_is_recorded_with_its_causes_at_the_aimed_wall_point() {
    let profile = pipe();
    let [y_m, z_m] = profile.reference();
    let attitude = Rot::from_roll_pitch_yaw(0.0, 0.0, 0.1);
    let pose = Pose { position: Point3::new(10.0, y_m, z_m), attitude };
    let drive = Drive { speed_mps: 0.3, healthy_gap_s: 2.0, ..Drive::default() };
    let causes_of_missing = |why: &[Cause], is_lost: bool, longest_m: f64, hidden: [u16; 2], hides: bool| {
        let mut coverage = coverage();
        let turning = Turning { longest_m, hidden, ..Turning::default() };
        let hides = |_| hides;
        let placing = Placing { mount: &mount(), turning: &turning, profile: &profile, hidden: &hides };
        let ping = Away { at: MonoNs(0), head: 0, angle_rad: math::FRAC_PI_2, why: all_of(why), is_lost };
        placing.add_missing(&pose, &ping, drive, &mut coverage);
        let found = samples_of(&coverage.missing_samples);
        let x_m = 10.0 - 3.0 * math::sin(0.1) / math::cos(0.1);
        let arc_m = profile.arc_of([y_m + 3.0, z_m]);
        assert!((found[0].x_m - x_m).abs() < 1e-9 && (found[0].arc_m - arc_m).abs() < 1e-9, "{found:?}");
        let section = coverage.sections.get(coverage.sections.index_of(x_m)).unwrap();
        assert_eq!((found.len(), section.passage.drive), (1, drive));
        found[0].why
    };
    let (position, silent) = (Cause::PositionLost, Cause::HeadSilent);
    let (missing, far, occluded) = (Cause::MissingReturns, Cause::OutOfRange, Cause::Occluded);
    let (seen_through, hidden) = ([1, 100], [99, 100]);
    for (why, is_lost, longest_m, counts, hides, expected) in [
        (&[position][..], false, 5.0, hidden, true, &[position][..]),
        (&[position], true, 5.0, hidden, false, &[position, missing]),
        (&[position], true, 2.9, hidden, false, &[position, far]),
        (&[position], true, 5.0, hidden, true, &[position, occluded]),
        (&[position], true, 5.0, seen_through, true, &[position, missing]),
        (&[silent], true, 5.0, hidden, false, &[silent]),
        (&[silent, missing], true, 5.0, hidden, false, &[silent, missing]),
        (&[silent, missing], true, 2.9, hidden, true, &[silent, far, occluded]),
        (&[silent, missing], true, 2.9, hidden, false, &[silent, far]),
        (&[silent, missing], true, 5.0, hidden, true, &[silent, occluded]),
        (&[silent, missing], true, 5.0, seen_through, true, &[silent, missing]),
    ] {
        assert_eq!(
            causes_of_missing(why, is_lost, longest_m, counts, hides),
            all_of(expected),
            "{why:?} {longest_m} {hides}"
        );
    }
}

/// Situation of a dive at 0.1 m/s from chainage 1 m. Its only head turned at 50 pings a second until 10 s,
/// then fell silent.
struct Dive {
    world: World,
    profile: Profile,
    coverage: Coverage,
    missing_finder: MissingSampleFinder,
}

const STEP_RAD: f64 = 0.0157;

fn at(seconds: f64) -> MonoNs {
    MonoNs(0) + DurNs::from_secs_f64(seconds)
}

impl Dive {
    fn new() -> Self {
        let profile = pipe();
        let mut world = World::new();
        let mounted =
            Mounted { source: SourceId(0), info: SensorInfo { mount: mount(), kind: SensorKind::Head } };
        let (sweep, frontier) = (HeadSweep::default(), HeadFrontier::default());
        world.spawn((Head(0), mounted, HiddenAngles(Vec::new()), sweep, frontier));
        let mut missing_finder = MissingSampleFinder::default();
        let (seen, last) = (Some((at(10.0), 1.0, STEP_RAD / 0.02, STEP_RAD)), Some(at(10.0)));
        missing_finder.heads[0] =
            Turning { seen, pinged: last, moved: last, longest_m: 5.0, ..Turning::default() };
        Self { world, coverage: coverage(), profile, missing_finder }
    }

    /// Missing samples recorded by an advice update with or without a fix.
    fn update(&mut self, seconds: f64, has_fix: bool) -> Vec<MissingSample> {
        let [y_m, z_m] = self.profile.reference();
        let position = Point3::new(1.0 + 0.1 * seconds, y_m, z_m);
        let situation = Situation {
            pose: has_fix.then_some(Pose { position, attitude: Rot::identity() }),
            speed_mps: 0.1,
            pass_error_m: 0.0,
            layout: HeadLayout::PhaseShift,
            configured: 1,
            heads: [None; MAX_HEADS],
            deaf: headrace_sampling::head::HeadSet::default(),
            losses: [LossRate::default(); MAX_HEADS],
            lost_at_most: LossRate::default(),
        };
        let mut state = SystemState::<Heads<'_, '_>>::new(&mut self.world);
        let heads = state.get_mut(&mut self.world).unwrap();
        let update = (at(seconds), &situation);
        let now = Drive { healthy_gap_s: 2.0, ..Drive::default() };
        note_update(&mut self.missing_finder, now, &heads, update, &self.profile, &mut self.coverage);
        samples_of(&self.coverage.missing_samples)
    }

    /// Whether the missing samples belong to the pings expected after 10 s, in order, each at its expected
    /// place.
    fn are_pings_after_10_s(&self, missing_samples: &[MissingSample], why: &[Cause]) -> bool {
        let [y_m, z_m] = self.profile.reference();
        (1_u32..).zip(missing_samples).all(|(ping, missing)| {
            let after_s = 0.02 * f64::from(ping);
            let (sin, cos) = math::sin_cos(1.0 + STEP_RAD * f64::from(ping));
            let arc_m = self.profile.arc_of([y_m + 3.0 * sin, z_m - 3.0 * cos]);
            let off_m = math::wrap_signed(missing.arc_m - arc_m, self.profile.perimeter_m());
            let x_m = 1.0 + 0.1 * (10.0 + after_s);
            (missing.x_m - x_m).abs() < 1e-6 && off_m.abs() < 1e-6 && missing.why == all_of(why)
        })
    }
}

#[test]
fn missing_samples_of_a_silent_head_are_at_its_extrapolated_angles() {
    let mut dive = Dive::new();
    assert_eq!(dive.update(10.2, true).len(), 0, "the head may still ping");
    // After one second 50 samples are missing, and after two seconds 100.
    let first = dive.update(11.0, true);
    assert!(first.len() == 50 && dive.are_pings_after_10_s(&first, &[Cause::HeadSilent]), "{first:?}");
    let second = dive.update(12.0, true);
    assert!(second.len() == 100 && dive.are_pings_after_10_s(&second, &[Cause::HeadSilent]));
    // The head pings, but is stalled.
    let mut dive = Dive::new();
    dive.missing_finder.heads[0].pinged = Some(at(10.9));
    let first = dive.update(11.0, true);
    assert!(first.len() == 50 && dive.are_pings_after_10_s(&first, &[Cause::HeadStalled]));
}

/// For pings without a fix, the missing position is an additional cause. The pings are assigned positions
/// along the track as soon as there is a fix again.
#[test]
fn simulated_pings_without_a_fix_are_placed_at_the_next_fix() {
    let mut dive = Dive::new();
    dive.update(10.0, true);
    assert_eq!((dive.update(11.0, false).len(), dive.missing_finder.away.len()), (0, 50));
    let all = dive.update(12.0, true);
    assert_eq!((all.len(), dive.missing_finder.away.len(), dive.missing_finder.forgot), (100, 0, false));
    assert!(dive.are_pings_after_10_s(&all[..50], &[Cause::HeadSilent, Cause::PositionLost]), "{all:?}");
    assert!(all[50..].iter().all(|missing| missing.why == Causes::of(Cause::HeadSilent)));
    // The driving figures of the missing samples have the mean speed between the two fixes.
    let section = dive.coverage.sections.get(8).unwrap();
    assert!((section.passage.drive.speed_mps - 0.1).abs() < 1e-9, "{:?}", section.passage.drive);
    // If there are more pings without a fix than the capacity, the first pings are kept.
    let mut dive = Dive::new();
    dive.update(10.0, true);
    dive.update(10.0 + 0.02 * (ROOM as f64 + 500.0), false);
    assert_eq!((dive.missing_finder.away.len(), dive.missing_finder.forgot), (ROOM, true));
    assert_eq!(dive.missing_finder.away[ROOM - 1].at, at(10.0 + 0.02 * ROOM as f64));
    let seen = |dive: &Dive| dive.coverage.sections.get(10).map(|section| section.passage.unseen);
    assert_eq!(seen(&dive), Some(false));
    dive.update(700.0, true);
    assert_eq!(
        (seen(&dive), dive.missing_finder.forgot),
        (Some(true), false),
        "the missing samples there are unknown"
    );
}

/// After a gap in a log, the work of an advice update stays bounded, and the dropped pings are recorded.
#[test]
fn gap_in_the_log_keeps_only_the_latest_simulated_pings() {
    for (owed, is_forgotten) in [(ROOM, false), (ROOM + 1, true)] {
        let mut dive = Dive::new();
        dive.update(10.0, true);
        let missing_samples = dive.update(10.0 + 0.02 * owed as f64, true);
        assert_eq!((missing_samples.len(), dive.missing_finder.forgot), (ROOM, is_forgotten));
        let last_m = missing_samples.last().unwrap().x_m;
        assert!((last_m - (2.0 + 0.002 * owed as f64)).abs() < 1e-6, "{last_m}");
    }
}

/// Random numbers from times are evenly distributed, whatever the interval between the times, and no two are
/// equal.
#[test]
fn random_numbers_from_times_are_evenly_distributed() {
    for period_ns in [1_u64, 18_000_000, 20_000_000, 1 << 30, 1_000_000_000] {
        let draws: Vec<f64> = (0..16_384).map(|k| unit_of(3_600_000_000_000 + k * period_ns)).collect();
        let mut counts = [0_i32; 16];
        for draw in &draws {
            counts[usize::try_from(math::floor_to_i64(16.0 * draw)).unwrap()] += 1;
        }
        // 1024 numbers are expected in each class. The tolerance is five standard deviations.
        assert!(counts.iter().all(|count| (count - 1024).abs() < 160), "{period_ns}: {counts:?}");
        // After a number in the lower half, the next number is evenly distributed, too: neighbouring numbers
        // are independent.
        let after_low = draws.windows(2).filter(|pair| pair[0] < 0.5 && pair[1] < 0.5).count();
        assert!(after_low.abs_diff(4096) < 300, "{period_ns}: {after_low}");
        let mut sorted = draws;
        sorted.sort_by(f64::total_cmp);
        assert!(sorted.windows(2).all(|pair| pair[0] < pair[1]), "{period_ns}");
    }
}
