//! Judges a section: verdict, flag and run.

use super::alerting::RunInputs;
use crate::alert_list::RunInput;
use crate::alerts::{AlertKind, Alerts};
use crate::messages::{Notice, Notices};
use crate::resources::{Coverage, Digests, Finder};
use crate::result_stream::RecordKind;
use headrace_coverage::{Judging, Request, RunChange, RunId, Sections};
use headrace_geometry::time::MonoNs;
use headrace_geometry::tunnel::Profile;
use headrace_sensor::reading::SourceId;

/// Search state and outputs of judging, apart from the sections.
pub(crate) struct Results<'a> {
    pub(crate) finder: &'a mut Finder,
    pub(crate) notices: &'a mut Notices,
    pub(crate) digests: &'a mut Digests,
    pub(crate) alerts: &'a mut Alerts,
    pub(crate) runs: &'a mut RunInputs,
    /// Index of the event at which is judged, and whether that is at a beat before it.
    pub(crate) place: (usize, bool),
}

/// Judges one section and publishes the changes.
pub(crate) fn judge_one(
    request: &Request,
    profile: &Profile,
    coverage: &mut Coverage,
    results: &mut Results<'_>,
) {
    let Coverage { store, sections, unsure, lacks, .. } = coverage;
    let Results { finder, notices, digests, alerts, runs, place } = results;
    let begun = notices.0.len();
    let mut tell = |id: RunId, change: RunChange| {
        notices.0.push(Notice::Run { id, at: request.at, change });
        digests.judgements.record(RecordKind::Run).integer(u64::from(id.0)).integer(change as u64);
    };
    let mut judging = Judging { store, lacks, finder: &mut finder.0, profile, tell: &mut tell };
    let change = sections.judge(request, &mut judging);
    note_runs(notices.0.get(begun..).unwrap_or_default(), *place, sections, runs);
    let Some(change) = change else { return };
    notices.0.push(Notice::Section { section: request.section, at: request.at, change });
    if let Some(here) = sections.unsure(request.section)
        && !unsure.as_mut().is_some_and(|last| last.join(&here, sections.section_m()))
    {
        *unsure = Some(here);
    }
    let Some(section) = sections.get(request.section) else { return };
    digests
        .judgements
        .record(RecordKind::Section)
        .integer(request.at.0)
        .integer(request.section as u64)
        .integer(change as u64)
        .integer(section.verdict as u64)
        .number(section.hole.map_or(0.0, |hole| hole.diameter_m))
        .number(section.hole_sd_m)
        .integer(section.evidence.map_or(u64::MAX, |evidence| evidence.cause as u64))
        .number(section.hole.map_or(0.0, |hole| hole.x_m))
        .number(section.hole.map_or(0.0, |hole| hole.arc_m));
    if let Some(evidence) = section.evidence {
        digests
            .judgements
            .number(evidence.speed_mps)
            .number(evidence.t_y_m)
            .number(evidence.middle_t_y_m)
            .number(evidence.missing_share)
            .number(evidence.swing_m)
            .integer(u64::from(evidence.silent_heads.bits()))
            .integer(u64::from(evidence.causes.bits()));
        {
            digests.judgements.number(evidence.with_losses_mps);
        }
    }
    if section.contradicts() {
        let off_m = section.deviation.mean_m().unwrap_or(0.0);
        let x_m = sections.bounds_m(request.section).0;
        if alerts.note(AlertKind::ProfileContradicted, request.at, x_m, off_m) {
            notices.0.push(Notice::Alert(AlertKind::ProfileContradicted, None));
            digest_alert(digests, AlertKind::ProfileContradicted, None, request.at, (x_m, off_m));
        }
    }
}

/// Keeps runs that have changed for the list of alerts. Those that are cleared come last: what they have left belongs to the same
/// alert.
fn note_runs(notices: &[Notice], place: (usize, bool), sections: &Sections, runs: &mut RunInputs) {
    for cleared in [false, true] {
        for notice in notices {
            let Notice::Run { id, at, change } = *notice else { continue };
            if (change == RunChange::Cleared) == cleared && runs.0.len() < runs.0.capacity() {
                runs.0.extend(RunInput::of(place, at, (id, change), sections));
            }
        }
    }
}

/// Adds an alert to the digest, with its chainage and deviation, m, and the head where it names one.
pub(crate) fn digest_alert(
    digests: &mut Digests,
    kind: AlertKind,
    source: Option<SourceId>,
    at: MonoNs,
    at_off_m: (f64, f64),
) {
    let alert = digests.judgements.record(RecordKind::Alert).integer(at.0).integer(kind as u64);
    alert.number(at_off_m.0).number(at_off_m.1);
    if let Some(source) = source {
        alert.integer(u64::from(source.0));
    }
}
