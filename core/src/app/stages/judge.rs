//! Sections to verdicts and flags.

use bevy_ecs::prelude::{Res, ResMut};

use crate::app::flow::{Coverage, Digests, Finder, Notice, Notices, Requests};
use crate::coverage::Request;

pub(super) fn judge(
    requests: Res<'_, Requests>,
    mut coverage: ResMut<'_, Coverage>,
    mut finder: ResMut<'_, Finder>,
    mut notices: ResMut<'_, Notices>,
    mut digests: ResMut<'_, Digests>,
) {
    notices.0.clear();
    for request in &requests.0 {
        judge_one(request, &mut coverage, &mut finder, &mut notices, &mut digests);
    }
}

/// Judges one section and says what has changed.
pub(in crate::app) fn judge_one(
    request: &Request,
    coverage: &mut Coverage,
    finder: &mut Finder,
    notices: &mut Notices,
    digests: &mut Digests,
) {
    let Coverage { store, sections, .. } = coverage;
    let Some(change) = sections.judge(request, store, &mut finder.0) else { return };
    notices.0.push(Notice::Section { section: request.section, at: request.at, change });
    let Some(section) = sections.get(request.section) else { return };
    digests
        .judgements
        .integer(request.at.0)
        .integer(request.section as u64)
        .integer(change as u64)
        .integer(section.verdict as u64)
        .number(section.hole.map_or(0.0, |hole| hole.diameter_m))
        .number(section.hole_sigma_m)
        .integer(section.evidence.map_or(u64::MAX, |evidence| evidence.cause as u64));
}
