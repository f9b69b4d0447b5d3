//! Converts georeferenced pings to samples, passes and sections, and judges sections.
//!
//! One loop over the pings does both, since earlier verdicts decide which sections are judged, and on which
//! evidence.

use bevy_ecs::prelude::{Res, ResMut, Single};

use super::alerting::RunInputs;
use super::coverage_extent::{Heads, note_beat};
use super::driving::{Driving, Plan};
use super::judge::{Results, judge_one};
use super::live::standing;
use super::missing_samples;
use super::navigation_alerts;
use super::outlier_filter::{self, FilterContext};
use crate::alerts::Alerts;
use crate::entities::HeadFrontier;
use crate::messages::{
    JudgedStates, Notices, Outcome, Placed, PlacedEvents, PlacedList, PlacedPing, Requests, Standing,
};
use crate::resources::{Coverage, Digests, Finder, Tally, Target, TunnelDesign, VehicleEntities};
use headrace_coverage::{Drive, HeadReach, Loss, PassError, Sections, Verdict, Visit};
use headrace_geometry::time::DurNs;
use headrace_geometry::tunnel::Profile;
use headrace_sampling::passes::Situation;

/// Interval between checks of the sections around a vehicle that stays in one place.
const LOOK_AROUND: DurNs = DurNs(1_000_000_000);
/// Time that a pilot needs to slow down before the vehicle reaches wall that hasn't passed, seconds.
const SOON_S: f64 = 5.0;
/// Speed at or below which the vehicle counts as going back, m/s.
const ASTERN_MPS: f64 = -0.02;
/// A ping is no evidence of the speed if this many standard deviations of its error relative to the previous
/// pass reach the target.
const ADRIFT_SD: f64 = 2.0;

#[expect(clippy::too_many_arguments, reason = "a system's arguments are its inputs and outputs")]
pub(super) fn cover(
    (placed, of_events): (Res<'_, PlacedList>, Res<'_, PlacedEvents>),
    tunnel: Res<'_, TunnelDesign>,
    entities: Res<'_, VehicleEntities>,
    mut heads: Heads<'_, '_>,
    mut driving: Single<'_, '_, &mut Driving>,
    mut coverage: ResMut<'_, Coverage>,
    target: Res<'_, Target>,
    mut requests: ResMut<'_, Requests>,
    mut tally: ResMut<'_, Tally>,
    mut finder: ResMut<'_, Finder>,
    mut notices: ResMut<'_, Notices>,
    mut digests: ResMut<'_, Digests>,
    mut alerts: ResMut<'_, Alerts>,
    mut standings: ResMut<'_, JudgedStates>,
    mut runs: ResMut<'_, RunInputs>,
) {
    notices.0.clear();
    standings.0.clear();
    runs.0.clear();
    for (item, event) in placed.0.iter().zip(&of_events.0) {
        match item {
            Placed::Situation(at, situation, doubts) => {
                navigation_alerts::note(*at, situation, doubts, (&mut alerts, &mut notices, &mut digests));
                let driving = &mut **driving;
                let healthy = driving.lacking.healthy(*at, situation, &heads);
                let plan = Plan {
                    planned_mps: target.planned_speed_mps,
                    target_m: target.target_m,
                    confidence_sd: coverage.sections.confidence_sd(),
                    other: target.other,
                };
                driving.note(*at, [situation, &healthy], &tunnel.profile, &plan);
                missing_samples::note_beat(
                    &mut driving.lacking,
                    driving.now,
                    &heads,
                    (*at, situation),
                    &tunnel.profile,
                    &mut coverage,
                );
                note_beat(&mut coverage, &mut heads, &tunnel, (*at, situation), &mut requests);
                if at.0 % LOOK_AROUND.0.unsigned_abs() == 0 {
                    let reaches = heads.iter().filter_map(|(.., frontier)| frontier.0);
                    let outlook = coverage.frontier.outlook(reaches, *at);
                    coverage.sections.look_around(&outlook, &mut |request| requests.0.push(request));
                }
            }
            Placed::Ping(ping) => {
                count(&mut tally, ping);
                coverage.frontier.hear(ping.received);
                if let Some(fix) = &ping.fix {
                    let now = (ping.valid_at, fix.pose);
                    let driving = &mut **driving;
                    missing_samples::note_away(
                        &mut driving.lacking,
                        driving.now,
                        &heads,
                        now,
                        &tunnel.profile,
                        &mut coverage,
                    );
                }
                let head = entities.of_head(ping.head).and_then(|entity| heads.get_mut(entity).ok());
                let Some((.., mut sweep, mut frontier)) = head else { continue };
                let driving = &mut **driving;
                missing_samples::note_ping(&mut driving.lacking, ping, &mut coverage.lacks);
                note_passage(&mut coverage, &frontier, &driving.now, (ping, &tunnel.profile));
                let mut sorting = FilterContext {
                    coverage: &mut coverage,
                    tunnel: &tunnel,
                    tally: &mut tally,
                    notices: &mut notices,
                    digests: &mut digests,
                    alerts: &mut alerts,
                };
                let suspected_m = outlier_filter::note_ping(&mut sorting, &mut sweep, ping);
                note_reach(&mut frontier, ping);
                if let Some(between_m) = suspected_m {
                    let reaches = heads.iter().filter_map(|(.., frontier)| frontier.0);
                    let outlook = coverage.frontier.outlook(reaches, ping.received);
                    outlier_filter::suspect(&mut coverage, between_m, &outlook, &mut requests);
                }
                let reaches = heads.iter().filter_map(|(.., frontier)| frontier.0);
                note_frontier(&mut coverage, reaches, ping, &mut requests);
            }
        }
        for request in requests.0.drain(..) {
            let mut results = Results {
                finder: &mut finder,
                notices: &mut notices,
                digests: &mut digests,
                alerts: &mut alerts,
                runs: &mut runs,
                place: (*event, matches!(item, Placed::Situation(..))),
            };
            judge_one(&request, &tunnel.profile, &mut coverage, &mut results);
        }
        if let Placed::Situation(at, situation, doubts) = item {
            let sweeps = heads.iter().map(|(_, mounted, _, sweep, _)| (mounted.source, sweep));
            let passed = is_passed(&coverage, &heads, situation);
            let back_to_m = back_to_m(&coverage.sections, situation);
            standings.0.push(Standing {
                passed,
                back_to_m,
                ..standing(*at, &coverage, &alerts, doubts, sweeps)
            });
        }
    }
}

/// Whether all wall that the heads see now and in the next seconds has passed, so that any speed is fine.
fn is_passed(coverage: &Coverage, heads: &Heads<'_, '_>, situation: &Situation) -> bool {
    let Coverage { sections, .. } = coverage;
    let reaches = heads.iter().map(|(.., frontier)| frontier.0.map(|reach| reach.latest()));
    let all = reaches.reduce(|all, reach| Some(all?.with(reach?))).flatten();
    let Some(all) = all.filter(|_| situation.pose.is_some()) else { return false };
    let (ahead_m, around_m) = (SOON_S * situation.speed_mps, sections.target_m() / 2.0);
    let from_m = all.from_m.min(all.from_m + ahead_m) - around_m;
    let to_m = all.to_m.max(all.to_m + ahead_m) + around_m;
    let mut indices = sections.index_of(from_m)..=sections.index_of(to_m);
    indices.all(|index| sections.get(index).is_some_and(|section| section.verdict == Verdict::Pass))
}

/// Place where a vehicle that goes back must turn round for a missed stretch, m.
///
/// The stretch is the nearest one that isn't ahead of the vehicle.
fn back_to_m(sections: &Sections, situation: &Situation) -> Option<f64> {
    let x_m = situation.pose.filter(|_| situation.speed_mps < ASTERN_MPS)?.position.x();
    let missed = sections.runs().all().iter().filter(|run| run.is_open());
    let backs = missed.map(|run| sections.back_to_m(sections.bounds_m(run.from).0));
    backs.filter(|back_m| *back_m < x_m).reduce(f64::max)
}

fn count(tally: &mut Tally, ping: &PlacedPing) {
    tally.without_fix += u64::from(ping.fix.is_none());
    match ping.outcome {
        // Counted later, when the return is classified.
        Outcome::Sample { .. } => {}
        Outcome::Lost(Loss::Missing, _) => tally.missing += 1,
        Outcome::Lost(Loss::OutOfRange, _) => tally.out_of_range += 1,
        Outcome::Lost(Loss::Occluded, _) => tally.occluded += 1,
        Outcome::Unplaced(lacking) => {
            tally.unplaced += 1;
            if let Some(count) = tally.lacking.get_mut(lacking as usize) {
                *count += 1;
            }
        }
    }
}

/// Adds a ping to the passage of the section that the ping's head is in.
fn note_passage(
    coverage: &mut Coverage,
    frontier: &HeadFrontier,
    drive: &Drive,
    (ping, profile): (&PlacedPing, &Profile),
) {
    // A ping without a fix counts at its head's last known place.
    let Some(reach) = ping.reach.or_else(|| Some(frontier.0?.latest())) else { return };
    let index = coverage.sections.index_of(reach.middle_m());
    let turns = coverage.frontier.turns();
    let target_m = coverage.sections.target_m();
    let Some(section) = coverage.sections.get_mut(index) else { return };
    let passage = &mut section.passage;
    passage.pings += 1;
    passage.standing += u32::from(ping.standing);
    match ping.outcome {
        Outcome::Sample { .. } => {}
        Outcome::Lost(Loss::Missing, _) => passage.missing += 1,
        Outcome::Lost(Loss::OutOfRange, _) => passage.out_of_range += 1,
        Outcome::Lost(Loss::Occluded, _) => passage.occluded += 1,
        Outcome::Unplaced(_) => passage.unplaced += 1,
    }
    let Some(fix) = ping.fix else { return };
    passage.placed += 1;
    if PassError::of(&fix).exceeds(target_m / ADRIFT_SD, profile) {
        passage.adrift = true;
    } else {
        passage.drive = passage.drive.or_worse(Drive { speed_mps: fix.speed_mps.abs(), ..*drive });
    }
    section.note_pass(&Visit::of(&fix, ping.valid_at, turns), profile);
}

/// Updates the head's reach with a ping.
fn note_reach(frontier: &mut HeadFrontier, ping: &PlacedPing) {
    match (ping.fix, ping.reach) {
        (Some(_), Some(reach)) => frontier.0 = Some(HeadReach::after(frontier.0, ping.received, reach)),
        _ => {
            if let Some(reach) = &mut frontier.0 {
                reach.heard(ping.received);
            }
        }
    }
}

/// Updates the frontier, and requests judging of the sections that are due.
fn note_frontier(
    coverage: &mut Coverage,
    heads: impl Iterator<Item = HeadReach> + Clone,
    ping: &PlacedPing,
    requests: &mut Requests,
) {
    let Coverage { sections, frontier, .. } = coverage;
    let Some(reach) = ping.reach else { return };
    let moved =
        frontier.advance(reach, heads.clone(), ping.received, sections.section_m(), sections.left_m());
    if sections.may_be_due(&moved) {
        let outlook = frontier.outlook(heads, ping.received);
        sections.due(&moved, &outlook, &mut |request| requests.0.push(request));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::entities::{Head, HeadSweep, HiddenAngles, Mounted};
    use crate::fixtures::{coverage, fix, heard, mount, pinged, pipe, situation};
    use bevy_ecs::system::SystemState;
    use bevy_ecs::world::World;
    use headrace_coverage::{HoleFinder, Judging, MissingSamples, Reach, Request};
    use headrace_fusion::{Fix, NoFix};
    use headrace_geometry::time::MonoNs;
    use headrace_sensor::device::{SensorInfo, SensorKind};
    use headrace_sensor::reading::SourceId;

    /// Sections for a test. The ones with these indices have failed.
    fn missed(failed: &[i64]) -> Sections {
        let (Coverage { store, mut sections, .. }, profile) = (coverage(), pipe());
        let mut judging = Judging {
            store: &store,
            lacks: &MissingSamples::default(),
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

    /// The place is half a metre before the missed stretch that begins at 5 m, or before the one at 10 m.
    /// Half a metre is the target.
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
            "the vehicle is past one, and the other remains"
        );
        assert_eq!(turns_m(&two, -0.1, Some(4.4)), None, "past both");
        assert_eq!(turns_m(&[], -0.1, Some(12.0)), None, "no section is missed");
        assert_eq!(turns_m(&two, -0.1, None), None, "its place is unknown");
        assert_eq!((turns_m(&two, 0.1, Some(12.0)), turns_m(&two, -0.01, Some(12.0))), (None, None));
    }

    #[test]
    fn every_ping_is_counted_once_by_its_outcome() {
        let mut tally = Tally::default();
        let of = |outcome: Outcome, has_fix: bool| {
            let ping = pinged(5.1, 1.0);
            PlacedPing { outcome, fix: ping.fix.filter(|_| has_fix), ..ping }
        };
        let pings = [
            heard(5.1, 1.0, 3.0),
            of(Outcome::Lost(Loss::Missing, None), true),
            of(Outcome::Lost(Loss::Missing, None), false),
            of(Outcome::Lost(Loss::OutOfRange, None), true),
            of(Outcome::Lost(Loss::Occluded, None), true),
            of(Outcome::Lost(Loss::Occluded, None), true),
            of(Outcome::Lost(Loss::Occluded, None), true),
            of(Outcome::Unplaced(NoFix::Chainage), false),
            of(Outcome::Unplaced(NoFix::Section), false),
            of(Outcome::Unplaced(NoFix::Section), false),
        ];
        for ping in pings {
            count(&mut tally, &ping);
        }
        let expected = Tally {
            missing: 2,
            out_of_range: 1,
            occluded: 3,
            unplaced: 3,
            lacking: [0, 1, 2],
            without_fix: 4,
            ..Tally::default()
        };
        assert_eq!(tally, expected, "a return is counted once it is classified");
    }

    /// A ping without a fix counts at its head's last known place.
    #[test]
    fn passage_counts_all_pings_and_keeps_the_worst_driving_figures() {
        let (mut coverage, profile) = (coverage(), pipe());
        let here = Reach { from_m: 7.0, to_m: 7.2 };
        let frontier = HeadFrontier(Some(HeadReach::after(None, MonoNs(0), here)));
        let drive = Drive { healthy_gap_s: 2.0, speed_mps: 0.4, ..Drive::default() };
        let slow =
            PlacedPing { fix: Some(Fix { speed_mps: -0.05, ..fix(5.1, 0.01) }), ..heard(5.1, 1.0, 3.0) };
        let fast = PlacedPing { fix: Some(Fix { speed_mps: 0.2, ..fix(5.1, 0.02) }), ..pinged(5.1, 1.0) };
        let of = |loss: Loss| PlacedPing { outcome: Outcome::Lost(loss, None), ..slow };
        let away = PlacedPing {
            fix: None,
            reach: None,
            standing: true,
            outcome: Outcome::Unplaced(NoFix::Heading),
            ..slow
        };
        for ping in [slow, fast, slow, of(Loss::OutOfRange), of(Loss::Occluded), away, away] {
            note_passage(&mut coverage, &frontier, &drive, (&ping, &profile));
        }
        let passage = coverage.sections.get(20).unwrap().passage;
        let counts = [passage.pings, passage.placed, passage.missing, passage.out_of_range, passage.occluded];
        assert_eq!((counts, passage.unplaced, passage.standing), ([5, 5, 1, 1, 1], 0, 0));
        assert_eq!((passage.drive, passage.adrift), (Drive { speed_mps: 0.2, ..drive }, false));
        assert_eq!(passage.pass_error, PassError::of(&fast.fix.unwrap()));
        let elsewhere = coverage.sections.get(28).unwrap().passage;
        let counts = [elsewhere.pings, elsewhere.placed, elsewhere.unplaced, elsewhere.standing];
        assert_eq!(counts, [2, 0, 2, 2]);
        // A head that never had a fix has no known place.
        note_passage(&mut coverage, &HeadFrontier(None), &drive, (&away, &profile));
        assert_eq!(coverage.sections.get(28).unwrap().passage, elsewhere);
    }

    /// A ping is no evidence of the speed if two standard deviations against the previous pass reach the
    /// target. The error of a hole is 1.2 times that of a pass.
    #[test]
    fn ping_with_an_uncertain_position_does_not_count_for_the_speed() {
        let profile = pipe();
        let noted = |sd_m: f64| {
            let mut coverage = coverage();
            let ping = PlacedPing { fix: Some(fix(5.1, sd_m)), ..heard(5.1, 1.0, 3.0) };
            let drive = Drive { healthy_gap_s: 2.0, ..Drive::default() };
            note_passage(&mut coverage, &HeadFrontier(None), &drive, (&ping, &profile));
            let passage = coverage.sections.get(20).unwrap().passage;
            (passage.adrift, passage.drive.speed_mps > 0.0)
        };
        assert_eq!((noted(0.2), noted(0.215)), ((false, true), (true, false)));
    }

    #[test]
    fn head_that_pings_without_a_fix_keeps_its_last_position() {
        let at = |seconds: u64| MonoNs(seconds * 1_000_000_000);
        let ping = |seconds: u64, x_m: Option<f64>| PlacedPing {
            received: at(seconds),
            fix: x_m.map(|x_m| fix(x_m, 0.0)),
            reach: x_m.map(|x_m| Reach { from_m: x_m, to_m: x_m }),
            ..pinged(5.0, 1.0)
        };
        let mut frontier = HeadFrontier(None);
        note_reach(&mut frontier, &ping(1, None));
        assert_eq!(frontier.0, None);
        note_reach(&mut frontier, &ping(2, Some(5.0)));
        note_reach(&mut frontier, &ping(9, None));
        let expected = HeadReach::after(None, at(9), Reach { from_m: 5.0, to_m: 5.0 });
        assert_eq!(frontier.0, Some(expected), "heard at 9 s, with the reach of 2 s");
        note_reach(&mut frontier, &ping(10, Some(6.0)));
        assert_eq!(frontier.0.map(|reach| reach.latest()), Some(Reach { from_m: 6.0, to_m: 6.0 }));
    }

    /// At 0.4 m/s, 2 m are covered in five seconds. The checked wall extends from a quarter of a metre behind
    /// the rear head to a quarter of a metre ahead of the front head's future place.
    #[test]
    fn condition_is_passed_only_if_visible_and_upcoming_wall_has_passed() {
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
                let sweep = HeadSweep::default();
                world.spawn((
                    Head(number),
                    mounted,
                    HiddenAngles(Vec::new()),
                    sweep,
                    HeadFrontier(Some(reach)),
                ));
            }
            let mut state = SystemState::<Heads<'_, '_>>::new(&mut world);
            let heads = state.get_mut(&mut world).unwrap();
            is_passed(&coverage, &heads, &Situation { speed_mps, ..situation(x_m) })
        };
        // Inwards: from 4.75 m, section 19, to 8.25 m, section 33. Going back: from 2.75 m, section 11, to
        // 6.25 m, section 25.
        assert!(passed(19..34, 0.4, Some(5.5)) && passed(11..26, -0.4, Some(5.5)));
        assert!(passed(19..26, 0.0, Some(5.5)));
        for between in [20..34, 19..33, 19..26] {
            assert!(!passed(between.clone(), 0.4, Some(5.5)), "{between:?}");
        }
        assert!(!passed(12..26, -0.4, Some(5.5)) && !passed(11..25, -0.4, Some(5.5)));
        assert!(!passed(0..120, 0.4, None), "nothing is known without a position");
    }
}
