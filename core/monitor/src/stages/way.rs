//! The way: where vehicle and heads have been, pinging or not, and what they leave behind where no head pings.

use bevy_ecs::prelude::Query;

use super::georeference::reach;
use crate::entities::{Head, HeadFrontier, HeadSweep, HiddenAngles, Mounted};
use crate::messages::Requests;
use crate::resources::{Coverage, TunnelDesign};
use headrace_coverage::{HeadReach, Reach};
use headrace_geometry::time::MonoNs;
use headrace_sampling::passes::Situation;

/// A head: number, mount, hidden angles, sweep and reach.
pub(super) type Heads<'w, 's> = Query<'w, 's, HeadParts>;
type HeadParts = (
    &'static Head,
    &'static Mounted,
    &'static HiddenAngles,
    &'static mut HeadSweep,
    &'static mut HeadFrontier,
);

/// Updates the way for a beat with a fix; where no head is alive, requests judging of the sections that are left.
pub(super) fn note_beat(
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
        let here = reach(&pose, &mounted.info.mount, tunnel);
        all = Some(all.map_or(here, |all| all.with(here)));
        span = span.with(Reach { from_m: here.middle_m(), to_m: here.middle_m() });
        if coverage.frontier.is_silent(frontier.0.as_ref(), at) {
            note_silence(coverage, head.0, frontier.0.map(|before| before.latest()), here);
            frontier.0 = Some(HeadReach::silent_at(frontier.0, here));
        } else if situation.deaf.has(head.0) {
            note_silence(coverage, head.0, None, here);
        } else if frontier.0.is_none() {
            // Not heard yet, and perhaps about to ping.
            frontier.0 = Some(HeadReach::silent_at(None, here));
        }
    }
    if let Some(all) = all {
        coverage.frontier.pass(all);
    }
    let reaches = heads.iter().filter_map(|(.., frontier)| frontier.0);
    let Coverage { sections, frontier, .. } = coverage;
    let moved = frontier.beat(span, reaches.clone(), at, sections.section_m(), sections.left_m());
    if sections.may_be_due(&moved) {
        let outlook = frontier.outlook(reaches, at);
        sections.due(&moved, &outlook, &mut |request| requests.0.push(request));
    }
}

/// Marks the sections that a silent head has gone through since it was last known to be somewhere.
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
