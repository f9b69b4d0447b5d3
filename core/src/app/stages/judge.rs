//! A section to its verdict and flag.

use crate::app::flow::{Coverage, Digests, Finder, Notice, Notices};
use crate::coverage::Request;
use crate::tunnel::Profile;

/// Judges one section and says what has changed.
pub(in crate::app) fn judge_one(
    request: &Request,
    profile: &Profile,
    coverage: &mut Coverage,
    finder: &mut Finder,
    notices: &mut Notices,
    digests: &mut Digests,
) {
    let Coverage { store, sections, .. } = coverage;
    let Some(change) = sections.judge(request, store, &mut finder.0, profile) else { return };
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
