//! Coverage extent: the chainages at which the vehicle and its heads have been, whether the heads pinged or
//! not.
//!
//! If no head pings, sections that the vehicle has left are judged here.

use super::heads::Heads;
use super::survey::Requests;
use crate::resources::{Coverage, TunnelDesign};
use headrace_coverage::{HeadReach, Reach};
use headrace_geometry::time::MonoNs;
use headrace_sampling::passes::Situation;

/// Extends the coverage extent at an advice update with a fix.
///
/// If no head works, requests judging of the sections that the vehicle has left.
pub(super) fn note_update(
    coverage: &mut Coverage,
    heads: &mut Heads<'_, '_>,
    tunnel: &TunnelDesign,
    (at, situation): (MonoNs, &Situation),
    requests: &mut Requests,
) {
    let Some(pose) = situation.pose.filter(|_| !heads.is_empty()) else { return };
    let mut all: Option<Reach> = None;
    let mut span = Reach { from_m: pose.position.x(), to_m: pose.position.x() };
    for (head, mounted, .., mut frontier) in heads.iter_mut() {
        let here = tunnel.reach(&pose, &mounted.info.mount);
        all = Some(all.map_or(here, |all| all.with(here)));
        span = span.with(Reach { from_m: here.middle_m(), to_m: here.middle_m() });
        if coverage.frontier.is_silent(frontier.0.as_ref(), at) {
            note_silence(coverage, head.0, frontier.0.map(|before| before.latest()), here);
            frontier.0 = Some(HeadReach::silent_at(frontier.0, here));
        } else if situation.deaf.has(head.0) {
            note_silence(coverage, head.0, None, here);
        } else if frontier.0.is_none() {
            // No ping of this head has arrived yet, but one may come soon.
            frontier.0 = Some(HeadReach::silent_at(None, here));
        }
    }
    if let Some(all) = all {
        coverage.frontier.pass(all);
    }
    let reaches = heads.iter().filter_map(|(.., frontier)| frontier.0);
    let Coverage { sections, frontier, .. } = coverage;
    let moved = frontier.update(span, reaches.clone(), at, sections.section_m(), sections.left_m());
    if sections.may_be_due(&moved) {
        let outlook = frontier.outlook(reaches, at);
        sections.due(&moved, &outlook, &mut |request| requests.0.push(request));
    }
}

/// Marks the sections that a silent head has passed since its last known place.
fn note_silence(coverage: &mut Coverage, head: usize, before: Option<Reach>, here: Reach) {
    let (now_m, before_m) = (here.middle_m(), before.unwrap_or(here).middle_m());
    let gone =
        coverage.sections.index_of(now_m.min(before_m))..=coverage.sections.index_of(now_m.max(before_m));
    for index in gone {
        if let Some(section) = coverage.sections.get_mut(index) {
            section.passage.silent = section.passage.silent.with(head);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::entities::{Head, HeadFrontier, HeadSweep, HiddenAngles, Mounted};
    use crate::fixtures::{coverage, mount, situation, tunnel};
    use bevy_ecs::system::SystemState;
    use bevy_ecs::world::World;
    use headrace_geometry::frames::{Mount, Vec3};
    use headrace_sampling::head::HeadSet;
    use headrace_sensor::device::{SensorInfo, SensorKind};
    use headrace_sensor::reading::SourceId;

    fn at(seconds: u64) -> MonoNs {
        MonoNs(seconds * 1_000_000_000)
    }

    /// A vehicle with heads half a metre ahead and half a metre astern of its origin, at 4.5 m and 3.5 m.
    /// `heard_s` has the times of the heads' last pings.
    struct Bench {
        world: World,
        coverage: Coverage,
        requests: Requests,
    }

    impl Bench {
        fn new(heard_s: [Option<u64>; 2]) -> Self {
            let (mut world, mut coverage) = (World::new(), coverage());
            for (number, (ahead_m, heard_s)) in [0.5, -0.5].into_iter().zip(heard_s).enumerate() {
                let info = SensorInfo {
                    mount: Mount { position: Vec3::new(ahead_m, 0.0, 0.0), ..mount() },
                    kind: SensorKind::Head,
                };
                let mounted = Mounted { source: SourceId(0), info };
                let here = Reach { from_m: 4.0 + ahead_m, to_m: 4.0 + ahead_m };
                let reach = heard_s.map(|seconds| HeadReach::after(None, at(seconds), here));
                if let Some(seconds) = heard_s {
                    coverage.frontier.hear(at(seconds));
                }
                let sweep = HeadSweep::default();
                world.spawn((Head(number), mounted, HiddenAngles(Vec::new()), sweep, HeadFrontier(reach)));
            }
            Self { world, coverage, requests: Requests(Vec::new()) }
        }

        /// Assumed chainages of the heads, m, after an advice update with the vehicle at chainage `x_m`.
        fn update(&mut self, seconds: u64, x_m: Option<f64>) -> [Option<f64>; 2] {
            let tunnel = tunnel();
            let mut state = SystemState::<Heads<'_, '_>>::new(&mut self.world);
            let mut heads = state.get_mut(&mut self.world).unwrap();
            let update = (at(seconds), &situation(x_m));
            note_update(&mut self.coverage, &mut heads, &tunnel, update, &mut self.requests);
            let mut places = heads.iter().map(|(.., reach)| reach.0.map(|reach| reach.latest().middle_m()));
            [places.next().flatten(), places.next().flatten()]
        }

        /// Indices of the sections that a head has passed without pinging.
        fn silent(&self, head: usize) -> Vec<i64> {
            let sections = 0..128;
            let passage = |index: &i64| self.coverage.sections.get(*index).unwrap().passage.silent.has(head);
            sections.filter(passage).collect()
        }
    }

    #[test]
    fn silent_head_is_assumed_to_move_with_the_vehicle() {
        // The second head is silent from 1 s on. The first one keeps pinging.
        let mut bench = Bench::new([Some(9), Some(1)]);
        assert_eq!(bench.update(10, Some(5.0)), [Some(4.5), Some(4.5)], "the first head is at its last ping");
        // Sections 14 to 18 contain the wall from 3.5 m to 4.5 m, which the silent head has passed.
        assert_eq!((bench.silent(0), bench.silent(1)), (vec![], (14..=18).collect()));
        assert_eq!(bench.update(11, Some(5.6)), [Some(4.5), Some(5.1)]);
        assert_eq!((bench.silent(0), bench.silent(1)), (vec![], (14..=20).collect()));
        let way = bench.coverage.frontier.way().unwrap();
        assert!((way.from_m - 4.5).abs() < 1e-9 && (way.to_m - 6.1).abs() < 1e-9, "{way:?}");
        // All heads have passed the stretch from the front head's first place to the rear head's last place.
        let through = bench.coverage.frontier.through();
        assert_eq!(through, None, "empty: 5.1 m isn't beyond 5.5 m");
        bench.update(12, Some(7.0));
        let through = bench.coverage.frontier.through().unwrap();
        assert!((through.from_m - 5.5).abs() < 1e-9 && (through.to_m - 6.5).abs() < 1e-9, "{through:?}");
    }

    #[test]
    fn sections_left_by_silent_heads_are_judged_at_the_next_advice_update() {
        let mut bench = Bench::new([Some(1), Some(1)]);
        bench.update(10, Some(5.0));
        bench.requests.0.clear();
        for seconds in 11..=20 {
            bench.update(seconds, Some(5.0 + 0.3 * (seconds - 10) as f64));
        }
        // The extent begins at 4.5 m, with the rear head. The judged sections end a quarter of a metre before the
        // rear head's place at 7.5 m.
        let whole = bench.requests.0.iter().filter(|request| !request.only_fails);
        let mut left: Vec<i64> = whole.map(|request| request.section).collect();
        left.sort_unstable();
        left.dedup();
        assert_eq!(left, (18..=28).collect::<Vec<_>>());
        assert_eq!(bench.silent(0).last(), Some(&34), "8.5 m");
    }

    #[test]
    fn coverage_extent_is_unknown_until_there_is_a_fix() {
        let mut bench = Bench::new([Some(1), None]);
        assert_eq!(bench.update(10, None), [Some(4.5), None]);
        assert!(bench.coverage.frontier.way().is_none() && bench.silent(0).is_empty());
        assert_eq!(HeadSet::default(), bench.coverage.sections.get(18).unwrap().passage.silent);
    }
}
