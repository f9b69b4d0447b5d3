//! Processes the georeferenced pings and advice updates of a tick, up to the next advice update or the next
//! ping that makes sections due for judging.

use bevy_ecs::prelude::Res;
use bevy_ecs::system::SystemParam;

use super::classify::{Class, Classified};
use super::heads::Heads;
use super::survey::{Outputs, Survey};
use super::wall::{self, WallContext};
use super::{count, coverage_extent, due, missing_samples, navigation_doubts, passages};
use crate::entities::HeadEntities;
use crate::messages::{PlacedPing, Placement, Update};
use crate::placer::PlacedTick;
use crate::resources::TunnelDesign;

/// The tunnel as designed, and the heads.
#[derive(SystemParam)]
pub(super) struct Site<'w> {
    tunnel: Res<'w, TunnelDesign>,
    entities: Res<'w, HeadEntities>,
}

/// Processes pings until sections are due for judging, or until an advice update has been processed.
pub(super) fn walk(
    placed: Res<'_, PlacedTick>,
    classified: Res<'_, Classified>,
    site: Site<'_>,
    mut heads: Heads<'_, '_>,
    mut survey: Survey<'_>,
    mut outputs: Outputs<'_>,
) {
    debug_assert!(survey.requests.0.is_empty(), "the sections due before have been judged");
    let next = survey.cursor.next;
    let items = placed.items.iter().zip(&classified.0).skip(next);
    for (item, class) in items {
        survey.cursor.next += 1;
        survey.cursor.stop = (item.event, matches!(item.placement, Placement::Update(_)));
        match &item.placement {
            Placement::Update(update) => {
                note_update(update, &site, &mut heads, &mut survey, &mut outputs);
                return;
            }
            Placement::Ping(ping) => note_ping((ping, class), &site, &mut heads, &mut survey, &mut outputs),
        }
        if !survey.requests.0.is_empty() {
            return;
        }
    }
}

fn note_update(
    Update { at, situation, doubts, .. }: &Update,
    site: &Site<'_>,
    heads: &mut Heads<'_, '_>,
    survey: &mut Survey<'_>,
    outputs: &mut Outputs<'_>,
) {
    let Survey { coverage, driving, requests, plan, tally, gaps, .. } = survey;
    gaps.note(*at, situation, tally.without_fix);
    let (said, seen) = ((*at, situation, doubts), (&**coverage, &*heads));
    if let Some(between_m) = navigation_doubts::note(said, seen, &mut outputs.refs()) {
        due::suspect(coverage, between_m, (heads, *at), requests);
    }
    let profile = &site.tunnel.profile;
    let healthy = driving.missing_finder.healthy(*at, situation, heads);
    driving.note(*at, [situation, &healthy], profile, plan);
    let now = driving.now;
    missing_samples::note_update(
        &mut driving.missing_finder,
        now,
        heads,
        (*at, situation),
        profile,
        coverage,
    );
    coverage_extent::note_update(coverage, heads, &site.tunnel, (*at, situation), requests);
    due::look_around(coverage, heads, *at, requests);
}

fn note_ping(
    (ping, class): (&PlacedPing, &Class),
    site: &Site<'_>,
    heads: &mut Heads<'_, '_>,
    survey: &mut Survey<'_>,
    outputs: &mut Outputs<'_>,
) {
    let Survey { coverage, driving, requests, tally, .. } = survey;
    let tunnel = &*site.tunnel;
    count::count(tally, ping);
    coverage.frontier.hear(ping.received);
    if let Some(fix) = &ping.fix {
        let (now, here) = (driving.now, (ping.valid_at, fix.pose));
        missing_samples::note_away(&mut driving.missing_finder, now, heads, here, &tunnel.profile, coverage);
    }
    let head = site.entities.of_head(ping.head).and_then(|entity| heads.get_mut(entity).ok());
    debug_assert!(head.is_some(), "head {} of a placed ping is unknown to the surveyor", ping.head);
    let Some((.., mut sweep, mut frontier)) = head else { return };
    missing_samples::note_ping(&mut driving.missing_finder, ping, &mut coverage.missing_samples);
    passages::note_passage(coverage, &frontier, &driving.now, (ping, &tunnel.profile));
    let mut context = WallContext { coverage, tunnel, tally, outputs: outputs.refs() };
    let suspected_m = wall::note_ping(&mut context, &mut sweep, (ping, class));
    passages::note_reach(&mut frontier, ping);
    if let Some(between_m) = suspected_m {
        due::suspect(coverage, between_m, (heads, ping.received), requests);
    }
    let reaches = heads.iter().filter_map(|(.., frontier)| frontier.0);
    due::note_frontier(coverage, reaches, ping, requests);
}
