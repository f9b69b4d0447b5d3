//! Reports the length of each verdict and the observations that hold at an advice update.

use bevy_ecs::prelude::{Query, Res};

use super::classify::{Class, Classified};
use super::survey::{Cursor, Outputs};
use crate::dive_plan::missed::MissedList;
use crate::entities::{Head, HeadFrontier, Mounted};
use crate::live_state::state::ASTERN_MPS;
use crate::live_state::{ActiveObservation, ActiveObservations};
use crate::messages::{Doubts, Placement, Standing};
use crate::observations::{MOST_OBSERVATIONS, Observation, Observations, ObservedKind};
use crate::placer::PlacedTick;
use crate::resources::Coverage;
use headrace_coverage::{Sections, Verdict};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sampling::passes::Situation;
use headrace_sensor::reading::SourceId;

/// Time that the pilot needs to slow down before the vehicle reaches wall that has not passed yet, seconds.
const SOON_S: f64 = 5.0;
/// Time for which an observation without a duration holds after its latest occurrence.
const HOLDS: DurNs = DurNs(10_000_000_000);

/// Components of a head: number, source and reach.
type Heads<'w, 's> = Query<'w, 's, (&'static Head, &'static Mounted, &'static HeadFrontier)>;

pub(super) fn report_standing(
    placed: Res<'_, PlacedTick>,
    classified: Res<'_, Classified>,
    heads: Heads<'_, '_>,
    coverage: Res<'_, Coverage>,
    cursor: Res<'_, Cursor>,
    mut outputs: Outputs<'_>,
) {
    let Some(last) = cursor.next.checked_sub(1) else { return };
    let (Some(item), Some(Class::Update(distrusted))) = (placed.items.get(last), classified.0.get(last))
    else {
        return;
    };
    let Placement::Update(update) = &item.placement else { return };
    let standing = Standing {
        metres: coverage.metres(),
        missed_from_m: coverage.sections.missed_from_m(),
        unsure: coverage.unsure,
        passed: is_passed(&coverage, &heads, &update.situation),
        back_to_m: back_to_m(&coverage.sections, &update.situation),
        missed: MissedList::of(&coverage.sections),
        observations: active(update.at, &outputs.observations, &update.doubts, &|source, kind| {
            let mut heads = heads.iter().filter(|(_, mounted, _)| mounted.source == source);
            let why = |head: &Head| distrusted.get(head.0).copied().flatten();
            heads.any(|(head, ..)| why(head).is_some_and(|why| ObservedKind::of_distrust(why).0 == kind))
        }),
    };
    outputs.found.standings.push(standing);
}

/// Observations that apply at present. `is_distrusted` tells whether a head is distrusted for the reason that a kind of
/// observation names.
fn active(
    at: MonoNs,
    observations: &Observations,
    doubts: &Doubts,
    is_distrusted: &dyn Fn(SourceId, ObservedKind) -> bool,
) -> ActiveObservations {
    let mut active = [None; MOST_OBSERVATIONS];
    let holds = observations.iter().filter(|known| match known.kind {
        ObservedKind::CableDoubted => doubts.cable.is_some_and(|doubt| doubt.log == known.source),
        ObservedKind::SettingDoubted => doubts.setting.is_some(),
        ObservedKind::OutsideTunnel | ObservedKind::ProfileContradicted => {
            at.since(known.latest).0 <= HOLDS.0
        }
        kind @ (ObservedKind::HeadScattered | ObservedKind::HeadConstant | ObservedKind::HeadOutvoted) => {
            known.source.is_some_and(|source| is_distrusted(source, kind))
        }
    });
    for (slot, known) in active.iter_mut().zip(holds) {
        let Observation { kind, source, occurrences, .. } = *known;
        *slot = Some(ActiveObservation { kind, source, occurrences });
    }
    active
}

/// Whether every part of the wall visible to the heads now and in the next seconds has the verdict pass, so
/// that any speed is fine.
fn is_passed(coverage: &Coverage, heads: &Heads<'_, '_>, situation: &Situation) -> bool {
    let Coverage { sections, .. } = coverage;
    let reaches = heads.iter().map(|(.., frontier)| frontier.0.map(|reach| reach.latest()));
    let all = reaches.reduce(|all, reach| Some(all?.with(reach?))).flatten();
    let Some(all) = all.filter(|_| situation.pose.is_some()) else { return false };
    let (ahead_m, around_m) = (SOON_S * situation.speed_mps, sections.target().max_hole_m / 2.0);
    let from_m = all.from_m.min(all.from_m + ahead_m) - around_m;
    let to_m = all.to_m.max(all.to_m + ahead_m) + around_m;
    let mut indices = sections.index_of(from_m)..=sections.index_of(to_m);
    indices.all(|index| sections.get(index).is_some_and(|section| section.verdict == Verdict::Pass))
}

/// Chainage at which a vehicle that goes back must turn round to pass a missed stretch again, m.
///
/// The stretch is the nearest one that isn't ahead of the vehicle.
fn back_to_m(sections: &Sections, situation: &Situation) -> Option<f64> {
    let x_m = situation.pose.filter(|_| situation.speed_mps < ASTERN_MPS)?.position.x();
    let missed = sections.runs().all().iter().filter(|run| run.is_open());
    let backs = missed.map(|run| sections.back_to_m(sections.bounds_m(run.from).0));
    backs.filter(|back_m| *back_m < x_m).reduce(f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{coverage, mount, pipe, situation};
    use crate::observations::Occurrence;
    use bevy_ecs::system::SystemState;
    use bevy_ecs::world::World;
    use headrace_coverage::{HeadReach, HoleFinder, Judging, MissingSamples, Reach, Request};
    use headrace_sensor::device::{SensorInfo, SensorKind};

    /// Test sections. The sections with the indices in `failed` have failed.
    fn missed(failed: &[i64]) -> Sections {
        let (Coverage { store, mut sections, .. }, profile) = (coverage(), pipe());
        let mut judging = Judging {
            store: &store,
            missing_samples: &MissingSamples::default(),
            finder: &mut HoleFinder::default(),
            profile: &profile,
            tell: &mut |_, _| {},
        };
        for section in failed {
            let request = Request {
                section: *section,
                at: MonoNs(0),
                swept_by_all: None,
                none_alive: false,
                to_come: Some(Reach { from_m: 29.0, to_m: f64::INFINITY }),
                not_passed: None,
                ended: None,
                only_fails: false,
            };
            sections.judge(&request, &mut judging);
        }
        sections
    }

    /// The turning point is half a metre before the missed stretch that begins at 5 m, or before the one at
    /// 10 m. Half a metre is the target.
    #[test]
    fn turning_point_on_the_way_back_is_before_the_nearest_missed_stretch() {
        let turns_m = |failed: &[i64], speed_mps: f64, x_m: Option<f64>| {
            back_to_m(&missed(failed), &Situation { speed_mps, ..situation(x_m) })
        };
        let two = [20, 21, 40];
        assert_eq!(turns_m(&two, -0.1, Some(12.0)), Some(9.5));
        assert_eq!(turns_m(&two, -0.1, Some(9.6)), Some(9.5));
        assert_eq!(
            turns_m(&two, -0.1, Some(9.4)),
            Some(4.5),
            "the vehicle has passed one, and the other remains"
        );
        assert_eq!(turns_m(&two, -0.1, Some(4.4)), None, "past both");
        assert_eq!(turns_m(&[], -0.1, Some(12.0)), None, "no section is missed");
        assert_eq!(turns_m(&two, -0.1, None), None, "its place is unknown");
        assert_eq!((turns_m(&two, 0.1, Some(12.0)), turns_m(&two, -0.01, Some(12.0))), (None, None));
    }

    /// At 0.4 m/s, 2 m are covered in five seconds. The checked wall extends from a quarter of a metre behind
    /// the rear head to a quarter of a metre ahead of the front head's future place.
    #[test]
    fn passed_condition_holds_only_if_all_wall_in_view_and_ahead_has_passed() {
        let passed = |between: core::ops::Range<i64>, speed_mps: f64, x_m: Option<f64>| {
            let mut coverage = coverage();
            for index in between {
                coverage.sections.get_mut(index).unwrap().verdict = Verdict::Pass;
            }
            let mut world = World::new();
            for (number, here_m) in [5.0, 6.0].into_iter().enumerate() {
                let reach = HeadReach::after(None, MonoNs(0), Reach { from_m: here_m, to_m: here_m });
                let info = SensorInfo { mount: mount(), kind: SensorKind::Head };
                let mounted = Mounted { source: SourceId(0), info };
                world.spawn((Head(number), mounted, HeadFrontier(Some(reach))));
            }
            let mut state = SystemState::<Heads<'_, '_>>::new(&mut world);
            let heads = state.get_mut(&mut world).unwrap();
            is_passed(&coverage, &heads, &Situation { speed_mps, ..situation(x_m) })
        };
        // Checked wall on the way inwards: from 4.75 m, section 19, to 8.25 m, section 33. Going back: from
        // 2.75 m, section 11, to 6.25 m, section 25.
        assert!(passed(19..34, 0.4, Some(5.5)) && passed(11..26, -0.4, Some(5.5)));
        assert!(passed(19..26, 0.0, Some(5.5)));
        for between in [20..34, 19..33, 19..26] {
            assert!(!passed(between.clone(), 0.4, Some(5.5)), "{between:?}");
        }
        assert!(!passed(12..26, -0.4, Some(5.5)) && !passed(11..25, -0.4, Some(5.5)));
        assert!(!passed(0..120, 0.4, None), "nothing is known without a position");
    }

    /// A distrusted head has an observation for its own reason only.
    #[test]
    fn distrusted_head_has_only_the_observation_for_its_reason() {
        let kinds = [ObservedKind::HeadScattered, ObservedKind::HeadConstant, ObservedKind::HeadOutvoted];
        let (mut observations, at) = (Observations::default(), MonoNs(5));
        for (source, kind) in (0..3).flat_map(|source| kinds.map(|kind| (SourceId(source), kind))) {
            observations.note_of(Some(source), kind, at, Occurrence { x_m: 1.0, off_m: 0.5 });
        }
        let doubts = Doubts { cable: None, setting: None, unverified_mounts: false, stand_s: 0, hung: 0 };
        for (head, kind) in (0..3).zip(kinds) {
            let is_distrusted =
                |source: SourceId, asked: ObservedKind| source == SourceId(head) && asked == kind;
            let found = active(at, &observations, &doubts, &is_distrusted);
            let found: Vec<_> = found.iter().flatten().map(|known| (known.source, known.kind)).collect();
            assert_eq!(found, [(Some(SourceId(head)), kind)]);
        }
    }
}
