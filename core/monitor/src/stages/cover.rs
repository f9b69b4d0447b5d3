//! Georeferenced pings to samples, passes and sections, and sections to verdicts.
//!
//! Both in one pass over the pings: which sections are judged, and on which evidence, depends on earlier verdicts.

use bevy_ecs::prelude::{Res, ResMut, Single};

use super::alerting::RunInputs;
use super::doubt;
use super::driving::{Driving, Plan};
use super::judge::{Results, judge_one};
use super::lacking;
use super::live::standing;
use super::walls::{self, Sorting};
use super::way::{Heads, note_beat};
use crate::alerts::Alerts;
use crate::entities::HeadFrontier;
use crate::messages::{
    Notices, Outcome, Placed, PlacedEvents, PlacedList, PlacedPing, Requests, Standing, Standings,
};
use crate::resources::{Coverage, Digests, Finder, Tally, Target, TunnelDesign, VehicleEntities};
use headrace_coverage::{Drive, HeadReach, Loss, PassError, Sections, Verdict, Visit};
use headrace_geometry::time::DurNs;
use headrace_geometry::tunnel::Profile;
use headrace_sampling::passes::Situation;

/// Interval between checks of the sections of a still zone.
const LOOK_AROUND: DurNs = DurNs(1_000_000_000);
/// Time in which a pilot slows down before wall that hasn't passed, seconds.
const SOON_S: f64 = 5.0;
/// A vehicle goes back at this speed or faster, m/s.
const ASTERN_MPS: f64 = -0.02;
/// So many standard deviations of a pass against the one before make up the target where a speed says nothing.
const ADRIFT_SD: f64 = 2.0;

#[expect(clippy::too_many_arguments, reason = "a system's arguments are what it reads and writes")]
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
    mut standings: ResMut<'_, Standings>,
    mut runs: ResMut<'_, RunInputs>,
) {
    notices.0.clear();
    standings.0.clear();
    runs.0.clear();
    for (item, event) in placed.0.iter().zip(&of_events.0) {
        match item {
            Placed::Situation(at, situation, doubts) => {
                doubt::note(*at, situation, doubts, (&mut alerts, &mut notices, &mut digests));
                let driving = &mut **driving;
                let healthy = driving.lacking.healthy(*at, situation, &heads);
                let plan = Plan {
                    planned_mps: target.planned_speed_mps,
                    target_m: target.target_m,
                    confidence_sd: coverage.sections.confidence_sd(),
                    other: target.other,
                };
                driving.note(*at, [situation, &healthy], &tunnel.profile, &plan);
                lacking::note_beat(
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
                    lacking::note_away(
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
                lacking::note_ping(&mut driving.lacking, ping, &mut coverage.lacks);
                note_passage(&mut coverage, &frontier, &driving.now, (ping, &tunnel.profile));
                let mut sorting = Sorting {
                    coverage: &mut coverage,
                    tunnel: &tunnel,
                    tally: &mut tally,
                    notices: &mut notices,
                    digests: &mut digests,
                    alerts: &mut alerts,
                };
                let suspected_m = walls::note_ping(&mut sorting, &mut sweep, ping);
                note_reach(&mut frontier, ping);
                if let Some(between_m) = suspected_m {
                    let reaches = heads.iter().filter_map(|(.., frontier)| frontier.0);
                    let outlook = coverage.frontier.outlook(reaches, ping.received);
                    walls::suspect(&mut coverage, between_m, &outlook, &mut requests);
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

/// Whether all wall that heads see here, and in the next seconds, has passed: nothing is to be gained or missed.
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

/// Where a vehicle that goes back is to turn round for the nearest missed stretch that isn't ahead of it, m.
fn back_to_m(sections: &Sections, situation: &Situation) -> Option<f64> {
    let x_m = situation.pose.filter(|_| situation.speed_mps < ASTERN_MPS)?.position.x();
    let missed = sections.runs().all().iter().filter(|run| run.is_open());
    let backs = missed.map(|run| sections.back_to_m(sections.bounds_m(run.from).0));
    backs.filter(|back_m| *back_m < x_m).reduce(f64::max)
}

fn count(tally: &mut Tally, ping: &PlacedPing) {
    tally.without_fix += u64::from(ping.fix.is_none());
    match ping.outcome {
        // Counted when it is known what the return is.
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

/// Adds a ping to the passage of the section that its head is in.
fn note_passage(
    coverage: &mut Coverage,
    frontier: &HeadFrontier,
    drive: &Drive,
    (ping, profile): (&PlacedPing, &Profile),
) {
    // Without a fix, a ping counts where its head was last known to be.
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

/// Updates the head's reach.
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

/// Updates the frontier, and requests judging of the sections now due.
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
    use headrace_coverage::{HoleFinder, Judging, Lacks, Reach, Request, SampleStore, StoreLayout};
    use headrace_geometry::frames::{Point3, Pose, Rot};
    use headrace_geometry::time::MonoNs;
    use headrace_geometry::tunnel::shapes;
    use headrace_sampling::head::MAX_HEADS;
    use headrace_sampling::layout::HeadLayout;
    use headrace_sampling::losses::LossRate;

    /// Sections of which those of these indices have failed.
    fn missed(failed: &[i64]) -> Sections {
        let profile = shapes::circle(3.0).unwrap();
        let perimeter_m = profile.perimeter_m();
        let layout = StoreLayout { perimeter_m, from_m: 0.0, to_m: 30.0, cell_m: 0.25, capacity: 100 };
        let mut sections = Sections::new(0.25, 0.5, 0.0, 30.0);
        let mut judging = Judging {
            store: &SampleStore::new(layout),
            lacks: &Lacks::default(),
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

    /// Half a metre, the target, before the stretch from 5 m on, or that from 10 m on.
    #[test]
    fn who_goes_back_turns_round_before_the_nearest_missed_stretch() {
        let turns_m = |failed: &[i64], speed_mps: f64, x_m: Option<f64>| {
            let pose =
                x_m.map(|x_m| Pose { position: Point3::new(x_m, 0.0, 3.0), attitude: Rot::identity() });
            let situation = Situation {
                pose,
                speed_mps,
                pass_error_m: 0.0,
                layout: HeadLayout::PhaseShift,
                configured: 0,
                heads: [None; MAX_HEADS],
                losses: [LossRate::default(); MAX_HEADS],
            };
            back_to_m(&missed(failed), &situation)
        };
        let two = [20, 21, 40];
        assert_eq!(turns_m(&two, -0.1, Some(12.0)), Some(9.5));
        assert_eq!(turns_m(&two, -0.1, Some(9.6)), Some(9.5));
        assert_eq!(turns_m(&two, -0.1, Some(9.4)), Some(4.5), "past the one there is the other");
        assert_eq!(turns_m(&two, -0.1, Some(4.4)), None, "past both");
        assert_eq!(turns_m(&[], -0.1, Some(12.0)), None, "nothing is missed");
        assert_eq!(turns_m(&two, -0.1, None), None, "nobody knows where it is");
        assert_eq!((turns_m(&two, 0.1, Some(12.0)), turns_m(&two, -0.01, Some(12.0))), (None, None));
    }
}
