//! Raises alerts for the doubts that navigation reports.

use super::judge::digest_alert;
use super::survey::OutputRefs;
use crate::alerts::AlertKind;
use crate::messages::{Doubts, Notice};
use headrace_fusion::filter::cable::CableDoubt;
use headrace_geometry::time::MonoNs;
use headrace_sampling::passes::Situation;
use headrace_sensor::reading::SourceId;

/// Records the doubts reported at an update.
pub(super) fn note(at: MonoNs, situation: &Situation, doubts: &Doubts, outputs: &mut OutputRefs<'_>) {
    let OutputRefs { notices, digests, alerts, .. } = outputs;
    let mut tell = |source: Option<SourceId>, kind: AlertKind, x_m: f64, off_m: f64| {
        notices.push(Notice::Alert(kind, source));
        digest_alert(digests, kind, source, at, (x_m, off_m));
    };
    if let Some(CableDoubt { since, from_m, differs_m, log }) = doubts.cable {
        let kind = AlertKind::CableDoubted;
        if alerts.note_lasting(log, kind, since, from_m, differs_m) {
            tell(log, kind, from_m, differs_m);
        }
    }
    let x_m = situation.pose.map(|pose| pose.position.x());
    if let Some((doubt, x_m)) = doubts.setting.zip(x_m)
        && alerts.note_setting(at, x_m, &doubt)
    {
        tell(None, AlertKind::SettingDoubted, x_m, doubt.setting.figure());
    }
}
