//! Judges the sections that are due: updates the verdict and flag of each section, and its missed stretch.

use bevy_ecs::prelude::{Res, ResMut};

use super::survey::{Cursor, OutputRefs, Outputs, Requests};
use crate::alert_list::RunInput;
use crate::messages::Notice;
use crate::observations::{ObservedKind, Occurrence};
use crate::resources::{Coverage, Digests, Finder, TunnelDesign};
use crate::result_stream::RecordKind;
use crate::section_judgement;
use headrace_coverage::{Judging, Request, RunChange, RunId, Sections};
use headrace_geometry::time::MonoNs;
use headrace_geometry::tunnel::Profile;
use headrace_sensor::reading::SourceId;

pub(super) fn judge_due(
    tunnel: Res<'_, TunnelDesign>,
    cursor: Res<'_, Cursor>,
    mut requests: ResMut<'_, Requests>,
    mut coverage: ResMut<'_, Coverage>,
    mut finder: ResMut<'_, Finder>,
    mut outputs: Outputs<'_>,
) {
    for request in requests.0.drain(..) {
        judge_one(&request, (&tunnel.profile, cursor.stop), &mut coverage, &mut finder, &mut outputs.refs());
    }
}

/// Judges one section and publishes the changes.
fn judge_one(
    request: &Request,
    (profile, stop): (&Profile, (usize, bool)),
    coverage: &mut Coverage,
    finder: &mut Finder,
    outputs: &mut OutputRefs<'_>,
) {
    let Coverage { store, sections, unsure, missing_samples, .. } = coverage;
    let OutputRefs { notices, runs, digests, observations } = outputs;
    let begun = notices.len();
    let mut tell = |id: RunId, change: RunChange| {
        notices.push(Notice::Run { id, at: request.at, change });
        digests.judgements.record(RecordKind::Run).integer(u64::from(id.0)).integer(change as u64);
    };
    let mut judging = Judging { store, missing_samples, finder: &mut finder.0, profile, tell: &mut tell };
    let change = sections.judge(request, &mut judging);
    note_runs(notices.get(begun..).unwrap_or_default(), stop, sections, runs);
    let Some(change) = change else { return };
    notices.push(Notice::Section { section: request.section, at: request.at, change });
    if let Some(here) = sections.unsure(request.section)
        && !unsure.as_mut().is_some_and(|last| last.join(&here, sections.section_m()))
    {
        *unsure = Some(here);
    }
    let Some(section) = sections.get(request.section) else {
        debug_assert!(false, "section {} has changed, but doesn't exist", request.section);
        return;
    };
    section_judgement::record(&mut digests.judgements, request.at, request.section, change, section);
    if section.is_of_another_wall() {
        let off_m = section.deviation.mean_m().unwrap_or(0.0);
        let occurrence = Occurrence { x_m: sections.bounds_m(request.section).0, off_m };
        let kind = ObservedKind::ProfileContradicted;
        if observations.note(kind, request.at, occurrence) {
            digest_observation(digests, kind, None, request.at, occurrence);
        }
    }
}

/// Records changed missed stretches for the list of alerts.
///
/// Cleared stretches come last. A remaining part of a cleared stretch takes over the stretch's alert, so the list
/// must get the part first.
fn note_runs(notices: &[Notice], stop: (usize, bool), sections: &Sections, runs: &mut Vec<RunInput>) {
    for cleared in [false, true] {
        for notice in notices {
            let Notice::Run { id, at, change } = *notice else { continue };
            if (change == RunChange::Cleared) == cleared && runs.len() < runs.capacity() {
                runs.extend(RunInput::of(stop, at, (id, change), sections));
            }
        }
    }
}

/// Adds an observation to the digest, with its source if it names one.
pub(super) fn digest_observation(
    digests: &mut Digests,
    kind: ObservedKind,
    source: Option<SourceId>,
    at: MonoNs,
    occurrence: Occurrence,
) {
    let record = digests.judgements.record(RecordKind::Alert).integer(at.0).integer(kind as u64);
    record.number(occurrence.x_m).number(occurrence.off_m);
    if let Some(source) = source {
        record.integer(u64::from(source.0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{coverage, pipe};
    use crate::observations::Observations;
    use headrace_coverage::{Judgement, Reach, Unsure};

    const AT: MonoNs = MonoNs(7_000_000_000);

    /// Judges a test section without samples that lies 20 m from the places where samples may still land.
    ///
    /// Up to chainage `not_passed_m`, m, some heads have not been in the tunnel.
    fn judged(coverage: &mut Coverage, section: i64, not_passed_m: f64) -> (Vec<Notice>, Vec<RunInput>) {
        let request = Request {
            section,
            at: AT,
            swept_by_all: None,
            none_alive: false,
            to_come: Some(Reach { from_m: 31.0, to_m: f64::INFINITY }),
            not_passed: Some(Reach { from_m: f64::NEG_INFINITY, to_m: not_passed_m }),
            ended: None,
            only_fails: false,
        };
        let (mut notices, mut runs) = (Vec::new(), Vec::with_capacity(8));
        let mut outputs = OutputRefs {
            notices: &mut notices,
            runs: &mut runs,
            digests: &mut Digests::default(),
            observations: &mut Observations::default(),
        };
        judge_one(&request, (&pipe(), (3, true)), coverage, &mut Finder::default(), &mut outputs);
        (notices, runs)
    }

    #[test]
    fn judgements_form_missed_stretches_and_stretches_without_verdict() {
        let mut coverage = coverage();
        let (notices, runs) = judged(&mut coverage, 40, -20.0);
        let run = Notice::Run { id: RunId(0), at: AT, change: RunChange::Raised };
        let section = Notice::Section { section: 40, at: AT, change: Judgement::Raised };
        assert_eq!((notices, coverage.unsure), (vec![run, section], None));
        let found = runs.iter().map(|run| (run.id, run.change, run.event, run.at_update, run.at));
        assert_eq!(found.collect::<Vec<_>>(), [(RunId(0), RunChange::Raised, 3, true, AT)]);
        // A section gets no verdict if some heads have not been in it. Neighbouring sections without a
        // verdict form one stretch, and a distant section forms another.
        for (section, from, to, sections) in [(20, 20, 21, 1), (21, 20, 22, 2), (60, 60, 61, 1)] {
            let (notices, runs) = judged(&mut coverage, section, 20.0);
            assert_eq!((notices.len(), runs.len()), (1, 0));
            let unsure = coverage.unsure.unwrap();
            let found = (unsure.why, unsure.from, unsure.to, unsure.sections());
            assert_eq!(found, (Unsure::NotInspected, from, to, sections));
        }
    }

    /// A remaining part of a cleared stretch takes over the stretch's alert, so the list must get the part first.
    #[test]
    fn cleared_stretches_are_listed_after_all_other_changed_stretches() {
        let mut coverage = coverage();
        for section in [20, 40, 60] {
            judged(&mut coverage, section, -20.0);
        }
        let run = |id: u32, change: RunChange| Notice::Run { id: RunId(id), at: AT, change };
        let section = Notice::Section { section: 9, at: AT, change: Judgement::Updated };
        let notices = [
            run(0, RunChange::Cleared),
            section,
            run(1, RunChange::Merged),
            run(9, RunChange::Raised),
            run(2, RunChange::Changed),
        ];
        for (room, expected) in [(8, vec![1, 2, 0]), (2, vec![1, 2])] {
            let mut runs = Vec::with_capacity(room);
            note_runs(&notices, (5, false), &coverage.sections, &mut runs);
            assert_eq!(runs.iter().map(|run| run.id.0).collect::<Vec<_>>(), expected);
            assert!(runs.iter().all(|run| (run.event, run.at_update, run.at) == (5, false, AT)));
        }
    }
}
