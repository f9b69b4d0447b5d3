//! Verdicts of a dive's samples for other targets and section lengths.

use bevy_ecs::world::Mut;
use headrace_coverage::Verdict;
use serde::Serialize;

use super::resources::{Coverage, Finder};
use super::run::Loop;

/// Metres by verdict for another target, or in sections of another length.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct WhatIfReport {
    /// Target T, m.
    pub target_m: f64,
    /// Length of a section, m.
    pub section_m: f64,
    /// Metres of sections that would pass.
    pub pass_m: f64,
    /// Metres that would fail.
    pub fail_m: f64,
    /// Metres undecided within the error of the hole.
    pub cannot_say_m: f64,
    /// Metres that would still be open.
    pub open_m: f64,
}

impl Loop {
    /// Verdicts for another target as of now, by section, of those whose hole has been measured.
    pub fn verdicts_at(&self, target_m: f64) -> Vec<(i64, Verdict)> {
        self.coverage().sections.verdicts_at(target_m, &self.outlook()).collect()
    }

    /// Verdicts of its samples for every target and section length, once the dive has ended.
    pub fn what_if(&mut self, targets_m: &[f64], sections_m: &[f64]) -> Vec<WhatIfReport> {
        let outlook = self.outlook();
        let profile = self.mission().profile.clone();
        let mut all = Vec::new();
        self.world_mut().resource_scope(|world, mut finder: Mut<'_, Finder>| {
            let Coverage { store, sections, .. } = world.resource::<Coverage>();
            for section_m in sections_m {
                let searched = (store, &mut finder.0);
                let metres = sections.what_if(*section_m, targets_m, &outlook, searched, &profile);
                all.extend(targets_m.iter().zip(metres).map(|(target_m, metres)| WhatIfReport {
                    target_m: *target_m,
                    section_m: *section_m,
                    pass_m: metres.pass_m,
                    fail_m: metres.fail_m,
                    cannot_say_m: metres.cannot_say_m,
                    open_m: metres.open_m,
                }));
            }
        });
        all
    }
}
