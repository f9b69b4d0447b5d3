//! Verdicts of the same dive for a second target, in a replay with two targets.

use std::collections::BTreeMap;

use headrace_coverage::Verdict;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::run::Loop;
use serde::Serialize;

/// Interval at which all sections are judged for the second target. The judging is periodic, because sections change
/// without a notice while the vehicle passes them.
const EVERY: DurNs = DurNs(1_000_000_000);

/// Length of the sections with each verdict for the second target. Only sections with a measured hole count.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct ComparedJson {
    /// Second target, m.
    pub target_m: f64,
    /// Length of the sections with the verdict "pass", m.
    pub pass_m: f64,
    /// Length of the sections with the verdict "fail", m.
    pub fail_m: f64,
    /// Length of the sections with the verdict "can't say", m.
    pub cannot_say_m: f64,
    /// Length of the sections with the verdict "open", except sections that are not inspected, m.
    pub open_m: f64,
    /// Length of the sections with the verdict "open" that are not inspected, m.
    pub not_inspected_m: f64,
}

/// Verdicts for a second target, as most recently judged.
#[derive(Debug)]
pub(crate) struct Compared {
    target_m: f64,
    verdicts: BTreeMap<i64, Verdict>,
    at: Option<MonoNs>,
    json: ComparedJson,
}

impl Compared {
    pub(crate) fn with(target_m: f64) -> Self {
        let json = ComparedJson { target_m, ..ComparedJson::default() };
        Self { target_m, verdicts: BTreeMap::new(), at: None, json }
    }

    /// Judges all sections for the second target if this is due. Calls `changed` with each section whose verdict has
    /// changed.
    pub(crate) fn refresh(&mut self, dive: &Loop, changed: impl FnMut(i64)) {
        let now = dive.now();
        if self.at.is_some_and(|at| (0..EVERY.0).contains(&now.since(at).0)) {
            return;
        }
        self.at = Some(now);
        let verdicts: BTreeMap<_, _> = dive.verdicts_at(self.target_m).into_iter().collect();
        let sections = &dive.view().coverage().sections;
        let is_not_inspected = |index: i64| sections.get(index).is_some_and(|section| section.not_inspected);
        let metres =
            |of: Verdict| sections.section_m() * verdicts.values().filter(|one| **one == of).count() as f64;
        let not_inspected =
            verdicts.iter().filter(|(index, one)| **one == Verdict::Open && is_not_inspected(**index));
        let not_inspected_m = sections.section_m() * not_inspected.count() as f64;
        self.json = ComparedJson {
            target_m: self.target_m,
            pass_m: metres(Verdict::Pass),
            fail_m: metres(Verdict::Fail),
            cannot_say_m: metres(Verdict::CannotSay),
            open_m: metres(Verdict::Open) - not_inspected_m,
            not_inspected_m,
        };
        let differs = |(index, verdict): &(&i64, &Verdict)| self.verdicts.get(index) != Some(*verdict);
        verdicts.iter().filter(differs).map(|(index, _)| *index).for_each(changed);
        self.verdicts = verdicts;
    }

    /// Makes the next call of `refresh` judge all sections, because the loop's state may have changed.
    pub(crate) fn forget(&mut self) {
        self.at = None;
        self.verdicts.clear();
    }

    pub(crate) fn verdict(&self, index: i64) -> Option<Verdict> {
        self.verdicts.get(&index).copied()
    }

    pub(crate) fn json(&self) -> ComparedJson {
        self.json
    }
}
