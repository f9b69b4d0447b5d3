//! The same dive held to another target, for a replay that was asked for two.

use std::collections::BTreeMap;

use headrace_coverage::Verdict;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::run::Loop;
use serde::Serialize;

/// Interval at which all sections are compared anew: also those change of which nothing is told, as what is to come passes them.
const EVERY: DurNs = DurNs(1_000_000_000);

/// Metres by verdict for the other target, of sections whose hole has been measured.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct ComparedJson {
    /// The other target, m.
    pub target_m: f64,
    /// Metres that pass.
    pub pass_m: f64,
    /// Metres that fail.
    pub fail_m: f64,
    /// Metres of which nothing can be said.
    pub cannot_say_m: f64,
    /// Metres still open.
    pub open_m: f64,
}

/// Verdicts for another target, as of the last comparison.
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

    /// Compares where it is due; calls `changed` with the sections whose verdict is another than before.
    pub(crate) fn refresh(&mut self, dive: &Loop, changed: impl FnMut(i64)) {
        let now = dive.now();
        if self.at.is_some_and(|at| (0..EVERY.0).contains(&now.since(at).0)) {
            return;
        }
        self.at = Some(now);
        let verdicts: BTreeMap<_, _> = dive.verdicts_at(self.target_m).into_iter().collect();
        let section_m = dive.coverage().sections.section_m();
        let metres = |of: Verdict| section_m * verdicts.values().filter(|one| **one == of).count() as f64;
        self.json = ComparedJson {
            target_m: self.target_m,
            pass_m: metres(Verdict::Pass),
            fail_m: metres(Verdict::Fail),
            cannot_say_m: metres(Verdict::CannotSay),
            open_m: metres(Verdict::Open),
        };
        let differs = |(index, verdict): &(&i64, &Verdict)| self.verdicts.get(index) != Some(*verdict);
        verdicts.iter().filter(differs).map(|(index, _)| *index).for_each(changed);
        self.verdicts = verdicts;
    }

    /// The loop's state may be another: the next is compared at once.
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
