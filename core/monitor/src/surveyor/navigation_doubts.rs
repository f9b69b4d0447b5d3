//! Records the doubts that navigation reports.

use super::judge::digest_observation;
use super::survey::OutputRefs;
use crate::messages::Doubts;
use crate::observations::{ObservedKind, Occurrence};
use headrace_fusion::filter::cable::CableDoubt;
use headrace_geometry::time::MonoNs;
use headrace_sampling::passes::Situation;

/// Records the doubts reported at an advice update.
pub(super) fn note(at: MonoNs, situation: &Situation, doubts: &Doubts, outputs: &mut OutputRefs<'_>) {
    let OutputRefs { digests, observations, .. } = outputs;
    if let Some(CableDoubt { since, from_m, differs_m, log }) = doubts.cable {
        let (kind, occurrence) = (ObservedKind::CableDoubted, Occurrence { x_m: from_m, off_m: differs_m });
        if observations.note_lasting(log, kind, since, occurrence) {
            digest_observation(digests, kind, log, at, occurrence);
        }
    }
    let x_m = situation.pose.map(|pose| pose.position.x());
    if let Some((doubt, x_m)) = doubts.setting.zip(x_m)
        && observations.note_setting(at, x_m, &doubt)
    {
        let occurrence = Occurrence { x_m, off_m: doubt.setting.figure() };
        digest_observation(digests, ObservedKind::SettingDoubted, None, at, occurrence);
    }
}
