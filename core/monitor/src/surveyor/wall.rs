//! Turns returns classified as wall into samples. Counts and records doubtful returns.

use bevy_ecs::prelude::{Query, Res, ResMut};
use bevy_ecs::system::SystemState;
use bevy_ecs::world::World;

use super::classify::Class;
use super::judge::digest_observation;
use super::missing_samples::number_of;
use super::samples::note_sample;
use super::survey::{OutputRefs, Outputs};
use crate::entities::{HeadClassifier, HeadEntities, HeadSweep, Waiting};
use crate::messages::{Hidden, Outcome, PlacedPing};
use crate::observations::{ObservedKind, Occurrence};
use crate::resources::{Coverage, Digests, Tally, TunnelDesign};
use crate::result_stream::RecordKind;
use headrace_coverage::{Cause, Causes, Loss, MissingSample, StoreError, Taken};
use headrace_geometry::frames::{Point3, Tunnel};
use headrace_geometry::tunnel::WallPoint;

/// Samples farther than this beyond either end of the tunnel are recorded as outside, m.
const WELL_BEYOND_M: f64 = 1.0;

/// Inputs and outputs of processing classified returns, without the head.
pub(super) struct WallContext<'a> {
    pub(super) coverage: &'a mut Coverage,
    pub(super) tunnel: &'a TunnelDesign,
    pub(super) tally: &'a mut Tally,
    pub(super) outputs: OutputRefs<'a>,
}

/// Applies a ping's classified return, and the returns that waited for this ping. A ping without a return
/// breaks the sweep.
///
/// If the head has just become distrusted, returns the chainages of its samples, m.
pub(super) fn note_ping(
    context: &mut WallContext<'_>,
    sweep: &mut HeadSweep,
    (ping, class): (&PlacedPing, &Class),
) -> Option<[f64; 2]> {
    let (Outcome::Sample { point, .. }, Class::Return(sorted, is_distrusted)) = (ping.outcome, class) else {
        digest(context.outputs.digests, ping, RecordKind::NoSample);
        if let Some(waiting) = sweep.waiting.last_mut() {
            waiting.broken = true;
            waiting.new_sweep |= ping.new_sweep;
        } else {
            store(context, sweep, ping, false);
        }
        return None;
    };
    if let Some(taken) = sorted.waiting {
        for waiting in sweep.waiting.take() {
            settle(context, sweep, &waiting, (taken, *is_distrusted));
        }
    }
    match sorted.this {
        Taken::Wall => wall(context, sweep, ping, sorted.is_confirming),
        Taken::Waits if sweep.waiting.add(ping) => {}
        taken => rejected(context, sweep, ping, (taken != Taken::Other, *is_distrusted)),
    }
    let (why, between_m) = sorted.distrusted?;
    let (kind, off_m) = ObservedKind::of_distrust(why);
    let (source, occurrence) = (Some(ping.source), Occurrence { x_m: point.x(), off_m });
    let OutputRefs { digests, observations, .. } = &mut context.outputs;
    if observations.note_of(source, kind, ping.received, occurrence) {
        digest_observation(digests, kind, source, ping.received, occurrence);
    }
    Some(between_m)
}

/// Inputs and outputs of processing the waiting returns at the end of a dive.
type End<'w, 's> = (
    Query<'w, 's, (&'static HeadClassifier, &'static mut HeadSweep)>,
    Res<'w, HeadEntities>,
    ResMut<'w, Coverage>,
    Res<'w, TunnelDesign>,
    ResMut<'w, Tally>,
    Outputs<'w>,
);

/// At the end of a dive, treats the returns that still wait for classification as doubtful, because no more
/// returns will come. Allocates: outside a tick only.
pub(super) fn end_returns(world: &mut World) {
    let mut state = SystemState::<End<'_, '_>>::new(world);
    let Ok((mut sweeps, entities, mut coverage, tunnel, mut tally, mut outputs)) = state.get_mut(world)
    else {
        return;
    };
    let outputs = outputs.refs();
    let mut context = WallContext { coverage: &mut coverage, tunnel: &tunnel, tally: &mut tally, outputs };
    for head in &entities.0 {
        let found = sweeps.get_mut(*head);
        debug_assert!(found.is_ok(), "a head has no sweep");
        let Ok((classifier, mut sweep)) = found else { continue };
        for waiting in sweep.waiting.take() {
            let taken = (Taken::Doubtful, classifier.0.distrusted().is_some());
            settle(&mut context, &mut sweep, &waiting, taken);
        }
    }
}

/// Applies a waiting return that has been classified, and then the effects of the pings after it.
fn settle(
    context: &mut WallContext<'_>,
    sweep: &mut HeadSweep,
    waiting: &Waiting,
    (taken, is_distrusted): (Taken, bool),
) {
    if taken == Taken::Wall {
        wall(context, sweep, &waiting.ping, false);
    } else {
        rejected(context, sweep, &waiting.ping, (taken != Taken::Other, is_distrusted));
    }
    if let Some(last) = &mut sweep.last {
        last.unbroken &= !waiting.broken;
    }
    if waiting.new_sweep {
        sweep.last = None;
    }
}

/// Applies a return from wall. `is_confirming` has the same meaning as in [`Sorted`](headrace_coverage::Sorted).
fn wall(context: &mut WallContext<'_>, sweep: &mut HeadSweep, ping: &PlacedPing, is_confirming: bool) {
    context.tally.samples += 1;
    digest(context.outputs.digests, ping, RecordKind::Sample);
    let OutputRefs { digests, observations, .. } = &mut context.outputs;
    let kind = ObservedKind::OutsideTunnel;
    if let Some(occurrence) = beyond_end(ping, context.tunnel.length_m)
        && observations.note(kind, ping.received, occurrence)
    {
        digest_observation(digests, kind, None, ping.received, occurrence);
    }
    store(context, sweep, ping, is_confirming);
}

/// Stores a ping's sample. Without a sample the sweep is broken.
fn store(context: &mut WallContext<'_>, sweep: &mut HeadSweep, ping: &PlacedPing, is_confirming: bool) {
    match note_sample(context.coverage, sweep, context.tunnel, ping, is_confirming) {
        Ok(()) => {}
        Err(StoreError::Outside) => context.tally.outside += 1,
        Err(StoreError::Full) => context.tally.not_stored += 1,
    }
}

/// Counts a return that isn't accepted as wall. For holes and causes it is a missing return, aimed at the point where
/// its beam meets the design profile. `may_be_wall` says whether the return is doubtful.
fn rejected(
    context: &mut WallContext<'_>,
    sweep: &mut HeadSweep,
    ping: &PlacedPing,
    (may_be_wall, is_distrusted): (bool, bool),
) {
    context.tally.doubtful += 1;
    digest(context.outputs.digests, ping, RecordKind::Doubtful);
    let Outcome::Sample { point, .. } = ping.outcome else {
        debug_assert!(false, "a ping without a return was classified: {:?}", ping.outcome);
        return;
    };
    let aim = ping.origin.and_then(|origin| aim(context.tunnel, &origin, &point));
    let lost = PlacedPing { outcome: Outcome::Lost(Loss::Missing, aim), ..*ping };
    store(context, sweep, &lost, false);
    let Coverage { missing_samples, sections, .. } = &mut *context.coverage;
    // A head whose returns are all rejected counts as silent.
    if let Some(reach) = ping.reach
        && let Some(section) = sections.get_mut(sections.index_of(reach.middle_m()))
    {
        section.passage.missing += 1;
        if is_distrusted {
            section.passage.silent = section.passage.silent.with(ping.head);
        }
    }
    let Some(WallPoint { x_m, arc_m }) = aim else { return };
    // A doubtful echo at an angle just beside the vehicle's outline comes from the vehicle.
    let cause = match ping.hidden {
        Hidden::No if is_distrusted => Cause::HeadSilent,
        Hidden::No => Cause::MissingReturns,
        Hidden::Yes | Hidden::Beside => Cause::Occluded,
    };
    let may_be_wall = may_be_wall && ping.hidden == Hidden::No && !is_distrusted;
    missing_samples.add(MissingSample {
        x_m,
        arc_m,
        head: number_of(ping.head),
        why: Causes::of(cause),
        may_be_wall,
    });
    if let Some(section) = sections.get_mut(sections.index_of(x_m)) {
        section.doubtful += 1;
    }
}

/// Point at which a beam would have met the design profile.
fn aim(tunnel: &TunnelDesign, origin: &Point3<Tunnel>, point: &Point3<Tunnel>) -> Option<WallPoint> {
    let beam = *point - *origin;
    let length_m = Some(beam.norm()).filter(|length_m| *length_m > 0.0)?;
    let across = [beam.y() / length_m, beam.z() / length_m];
    let wall = tunnel.profile.cast([origin.y(), origin.z()], across)?;
    Some(WallPoint { x_m: origin.x() + wall.range_m * beam.x() / length_m, arc_m: wall.arc_m })
}

/// A sample well beyond either end of the tunnel, with the sample's distance from that end.
///
/// A vehicle that turns at an end has heads slightly beyond the end, which is normal.
fn beyond_end(ping: &PlacedPing, length_m: f64) -> Option<Occurrence> {
    let Outcome::Sample { point, .. } = ping.outcome else { return None };
    let x_m = point.x();
    let off_m = (-x_m).max(x_m - length_m);
    (off_m > WELL_BEYOND_M).then_some(Occurrence { x_m, off_m })
}

fn digest(digests: &mut Digests, ping: &PlacedPing, kind: RecordKind) {
    let digest = digests.pings.record(kind).integer(ping.received.0).integer(u64::from(ping.source.0));
    match ping.outcome {
        Outcome::Sample { point, arc_m } => {
            let outcome = if kind == RecordKind::Sample { 0 } else { 3 };
            digest.integer(outcome).number(point.x()).number(point.y()).number(point.z()).number(arc_m);
        }
        Outcome::Lost(loss, _) => {
            digest.integer(1).integer(loss as u64);
        }
        Outcome::Unplaced(missing_finder) => {
            digest.integer(2).integer(missing_finder as u64);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::classify::classify;
    use super::super::survey::Found;
    use super::*;
    use crate::fixtures::{coverage, heard, pinged, tunnel};
    use crate::observations::Observations;
    use headrace_coverage::{HeadWall, Relief, SampleStore, StoreLayout};

    struct Bench {
        coverage: Coverage,
        tunnel: TunnelDesign,
        tally: Tally,
        observations: Observations,
        digests: Digests,
        head: HeadWall,
        relief: Relief,
        sweep: HeadSweep,
    }

    impl Bench {
        fn new() -> Self {
            Self {
                coverage: coverage(),
                tunnel: tunnel(),
                tally: Tally::default(),
                observations: Observations::default(),
                digests: Digests::default(),
                head: HeadWall::default(),
                relief: Relief::default(),
                sweep: HeadSweep::default(),
            }
        }

        /// Classifies and applies a test ping. Returns the number of samples and the number of doubtful
        /// returns so far.
        fn note(&mut self, ping: &PlacedPing) -> (u64, u64) {
            let class = classify(&mut self.head, ping, &self.tunnel, &mut self.relief);
            let outputs = OutputRefs {
                notices: &mut Vec::new(),
                runs: &mut Vec::new(),
                digests: &mut self.digests,
                observations: &mut self.observations,
            };
            let (coverage, tally) = (&mut self.coverage, &mut self.tally);
            let mut context = WallContext { coverage, tunnel: &self.tunnel, tally, outputs };
            assert_eq!(note_ping(&mut context, &mut self.sweep, (ping, &class)), None);
            (self.tally.samples, self.tally.doubtful)
        }

        fn missing_samples(&self) -> Vec<MissingSample> {
            self.coverage.missing_samples.between(f64::NEG_INFINITY, f64::INFINITY).copied().collect()
        }
    }

    const STEP_RAD: f64 = 0.0157;

    /// Test ping with this number in the turn, and a return at this range, m. The wall is at 3 m.
    fn at(number: u32, range_m: f64) -> PlacedPing {
        heard(5.1, 1.0 + STEP_RAD * f64::from(number), range_m)
    }

    /// An isolated echo in front of the wall waits for the next return. After that it counts as a missing
    /// sample, for holes and for causes.
    #[test]
    fn isolated_echo_counts_as_a_missing_sample_at_the_aimed_wall_point() {
        for (hidden, cause) in [(Hidden::No, Cause::MissingReturns), (Hidden::Beside, Cause::Occluded)] {
            let mut bench = Bench::new();
            assert_eq!(bench.note(&at(0, 3.0)), (1, 0));
            assert_eq!(bench.note(&PlacedPing { hidden, ..at(1, 1.5) }), (1, 0), "it waits");
            assert_eq!((bench.note(&at(2, 3.0)), bench.missing_samples().len()), ((2, 1), 1));
            let missing = bench.missing_samples()[0];
            let Outcome::Sample { arc_m, .. } = at(1, 3.0).outcome else { panic!() };
            assert!((missing.x_m - 5.1).abs() < 1e-9 && (missing.arc_m - arc_m).abs() < 1e-9, "{missing:?}");
            assert_eq!(missing.why, Causes::of(cause));
            let section = bench.coverage.sections.get(20).unwrap();
            assert_eq!((section.samples, section.doubtful, section.passage.missing), (2, 1, 1));
            assert!(section.t_y_m.count == 1 && section.deviation.mean_m().is_some());
        }
    }

    /// A rock of 0.35 m in height and 0.9 m in width is wall, from its first return on.
    #[test]
    fn undecided_return_is_wall_once_the_next_returns_agree() {
        let mut bench = Bench::new();
        bench.note(&at(0, 3.0));
        let mut found = Vec::new();
        for number in 1..24 {
            found.push(bench.note(&at(number, 2.65)));
        }
        assert_eq!(found[0], (1, 0), "the first return waits");
        assert_eq!(found.last(), Some(&(24, 0)), "{found:?}");
        assert!(bench.missing_samples().is_empty() && bench.sweep.waiting.last_mut().is_none());
        // All samples are one angular step apart, so the head's pass covers the arc length of each sample.
        let crossed = |number: f64| {
            let Outcome::Sample { arc_m, .. } = heard(5.1, 1.0 + STEP_RAD * number, 2.65).outcome else {
                panic!()
            };
            bench.coverage.store.clone().nearest_pass_m(WallPoint { x_m: 5.1, arc_m }, 0.5).is_some()
        };
        assert!((1..22).all(|number| crossed(f64::from(number) + 0.5)));
    }

    #[test]
    fn samples_are_counted_even_if_the_store_is_full() {
        let mut bench = Bench::new();
        let perimeter_m = bench.tunnel.profile.perimeter_m();
        let layout = StoreLayout { perimeter_m, from_m: 0.0, to_m: 32.0, cell_m: 0.25, capacity: 2 };
        bench.coverage.store = SampleStore::new(layout);
        for number in 0..5 {
            bench.note(&at(number, 3.0));
        }
        assert_eq!((bench.tally.samples, bench.tally.not_stored, bench.tally.outside), (5, 3, 0));
    }

    /// All returns but the first are from a rock. Pings that arrive while the first return waits take effect when that
    /// return is classified.
    #[test]
    fn lost_ping_after_an_undecided_return_interrupts_the_sweep() {
        let is_stepped = |between: Option<PlacedPing>| {
            let mut bench = Bench::new();
            bench.note(&at(0, 3.0));
            bench.note(&at(1, 2.65));
            if let Some(between) = between {
                bench.note(&between);
            }
            let last = (4..24).map(|number| bench.note(&at(number, 2.65))).last();
            assert_eq!(last, Some((22, 0)), "the rock is wide enough to be wall");
            let Outcome::Sample { arc_m, .. } = heard(5.1, 1.0 + 2.5 * STEP_RAD, 2.65).outcome else {
                panic!()
            };
            let is_crossed =
                bench.coverage.store.nearest_pass_m(WallPoint { x_m: 5.1, arc_m }, 0.5).is_some();
            (is_crossed, bench.coverage.sections.get(20).unwrap().t_y_m.count)
        };
        let lost = pinged(5.1, 1.0 + 2.0 * STEP_RAD);
        assert_eq!(is_stepped(None), (true, 21));
        assert_eq!(is_stepped(Some(lost)), (false, 21));
        assert_eq!(
            is_stepped(Some(PlacedPing { new_sweep: true, ..lost })),
            (false, 20),
            "it has no previous sample"
        );
    }

    /// The digest of results depends on the place of each sample.
    #[test]
    fn digest_includes_the_place_of_a_sample() {
        let digest = |x_m: f64| {
            let mut bench = Bench::new();
            assert_eq!(bench.note(&heard(x_m, 1.0, 3.0)), (1, 0));
            bench.digests.pings.value()
        };
        let none = Digests::default().pings.value();
        assert!(digest(5.1) != none && digest(5.1) == digest(5.1) && digest(5.1) != digest(5.2));
    }

    #[test]
    fn returns_beyond_the_tunnel_are_counted_with_their_largest_distance() {
        let mut bench = Bench::new();
        let mut note = |x_m: f64| {
            bench.note(&PlacedPing { new_sweep: true, ..heard(x_m, 1.0, 3.0) });
            assert!(bench.observations.iter().all(|known| known.kind == ObservedKind::OutsideTunnel));
            bench.observations.iter().map(|known| known.occurrences).collect::<Vec<_>>()
        };
        assert_eq!(note(29.9), []);
        assert_eq!(note(30.9), [], "heads reach beyond the end");
        for (x_m, count, beyond_m) in [(31.1, 1, 1.1), (31.5, 2, 1.5)] {
            let [found] = note(x_m)[..] else { panic!("{x_m}") };
            assert!((found.worst_m - beyond_m).abs() < 1e-9 && found.count == count, "{found:?}");
            assert!((found.first_m - 31.1).abs() < 1e-9, "{found:?}");
        }
        assert_eq!((bench.tally.samples, bench.tally.outside), (4, 0));
        bench.note(&PlacedPing { new_sweep: true, ..heard(33.0, 1.0, 3.0) });
        assert_eq!((bench.tally.samples, bench.tally.outside), (5, 1), "beyond the store");
    }

    #[test]
    fn undecided_return_at_the_end_of_a_dive_is_doubtful() {
        let mut bench = Bench::new();
        bench.note(&at(0, 3.0));
        bench.note(&at(1, 1.5));
        let mut world = World::new();
        let head = world.spawn((HeadClassifier(bench.head), bench.sweep)).id();
        world.insert_resource(HeadEntities(vec![head]));
        world.insert_resource(Found::with_room(0));
        world.insert_resource(bench.coverage);
        world.insert_resource(bench.tunnel);
        world.insert_resource(bench.tally);
        world.insert_resource(bench.digests);
        world.insert_resource(bench.observations);
        end_returns(&mut world);
        let tally = *world.resource::<Tally>();
        assert_eq!((tally.samples, tally.doubtful), (1, 1));
        let missing_samples = &world.resource::<Coverage>().missing_samples;
        assert_eq!(missing_samples.between(5.0, 5.2).count(), 1);
    }
}
