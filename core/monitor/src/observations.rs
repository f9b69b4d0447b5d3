//! Observations about the dive as a whole: recorded at their first occurrence, then counted.
//!
//! The list of alerts has an alert for each observation.

use bevy_ecs::prelude::Resource;
use serde::{Deserialize, Serialize};

use headrace_coverage::Distrust;
use headrace_fusion::filter::setting_check::SettingDoubt;
use headrace_geometry::time::MonoNs;
use headrace_sampling::head::MAX_HEADS;
use headrace_sensor::reading::SourceId;

/// Kind of observation about the dive as a whole. The numbers are recorded in logs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum ObservedKind {
    /// Samples fall beyond either end of the tunnel.
    OutsideTunnel,
    /// A section can't pass, because its samples or its area contradict the design profile.
    ProfileContradicted,
    /// Successive returns of a head disagree, so they are noise.
    HeadScattered,
    /// A head's range stays constant although it must change at the vehicle's place.
    HeadConstant,
    /// A head contradicts the design where other heads agree with it.
    HeadOutvoted,
    /// The cable counter differs from the inertial unit or from a velocity log, so one of them is wrong.
    CableDoubted,
    /// Ranges contradict a setting of the vehicle file.
    SettingDoubted,
}

/// Number of kinds that name a head.
const HEAD_KINDS: usize = 3;
/// Maximum number of observations: one per kind, or per kind and head. The cable counter may also differ from
/// a velocity log.
pub(crate) const MOST_OBSERVATIONS: usize = ObservedKind::ALL.len() + 1 - HEAD_KINDS + HEAD_KINDS * MAX_HEADS;

impl ObservedKind {
    /// All kinds of observations.
    pub(crate) const ALL: [Self; 7] = [
        Self::OutsideTunnel,
        Self::ProfileContradicted,
        Self::HeadScattered,
        Self::HeadConstant,
        Self::HeadOutvoted,
        Self::CableDoubted,
        Self::SettingDoubted,
    ];

    /// Observation about a distrusted head, and the figure that led to the distrust, m.
    pub(crate) fn of_distrust(why: Distrust) -> (Self, f64) {
        match why {
            Distrust::Scattered(jump_m) => (Self::HeadScattered, jump_m),
            Distrust::Constant(range_m) => (Self::HeadConstant, range_m),
            Distrust::Outvoted(off_m) => (Self::HeadOutvoted, off_m),
        }
    }
}

/// An occurrence of an observation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Occurrence {
    /// Chainage, m.
    pub x_m: f64,
    /// Deviation, m; see [`Occurrences::worst_m`].
    pub off_m: f64,
}

/// Occurrences of an observation over the whole dive.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Occurrences {
    /// Number of occurrences.
    ///
    /// An occurrence is a sample outside the tunnel, a judgement of a contradicting section, the beginning of
    /// distrust in a head or the cable counter, or a change of the doubtful setting.
    pub count: u64,
    /// Chainage of the first occurrence, m.
    pub first_m: f64,
    /// Largest deviation, m.
    ///
    /// Outside the tunnel: distance from its end. Contradicted profile: mean deviation of a section from the
    /// design. Head: mean difference between successive returns, constant range, or mean deviation from the
    /// design. Cable counter: difference from the other source. Setting: 0.
    pub worst_m: f64,
}

/// An observation with its occurrences so far.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Observation {
    pub(crate) kind: ObservedKind,
    /// The distrusted head, or the velocity log that the cable counter differs from.
    pub(crate) source: Option<SourceId>,
    /// Time at which the latest occurrence of the observation began.
    pub(crate) latest: MonoNs,
    pub(crate) occurrences: Occurrences,
    /// Doubtful setting, as judged most recently.
    setting: Option<SettingDoubt>,
}

/// All observations of a dive, by kind and head.
#[derive(Debug, Clone, Copy, PartialEq, Default, Resource, Serialize, Deserialize)]
pub(crate) struct Observations([Option<Observation>; MOST_OBSERVATIONS]);

impl Observations {
    /// Records an occurrence of an observation. Returns true for the first occurrence.
    pub(crate) fn note(&mut self, kind: ObservedKind, at: MonoNs, occurrence: Occurrence) -> bool {
        self.note_of(None, kind, at, occurrence)
    }

    /// Records an occurrence that concerns a head, or the velocity log that the cable counter differs from.
    ///
    /// Returns true for the first one.
    pub(crate) fn note_of(
        &mut self,
        source: Option<SourceId>,
        kind: ObservedKind,
        at: MonoNs,
        Occurrence { x_m, off_m }: Occurrence,
    ) -> bool {
        let is_it = |known: &Observation| known.kind == kind && known.source == source;
        let Some(slot) = self.0.iter_mut().find(|slot| slot.as_ref().is_none_or(is_it)) else { return false };
        let is_first = slot.is_none();
        let occurrences = Occurrences { count: 0, first_m: x_m, worst_m: off_m };
        let known = slot.get_or_insert(Observation { kind, source, latest: at, occurrences, setting: None });
        known.latest = at;
        known.occurrences.count += 1;
        if off_m.abs() > known.occurrences.worst_m.abs() {
            known.occurrences.worst_m = off_m;
        }
        is_first
    }

    /// Records a lasting occurrence that began at `since`. Later calls for the same occurrence don't count
    /// again.
    ///
    /// Returns true only when the first occurrence is recorded.
    pub(crate) fn note_lasting(
        &mut self,
        source: Option<SourceId>,
        kind: ObservedKind,
        since: MonoNs,
        occurrence: Occurrence,
    ) -> bool {
        match self.get_mut(kind, source) {
            Some(known) if known.latest == since => {
                known.occurrences.worst_m = known.occurrences.worst_m.max(occurrence.off_m);
                false
            }
            _ => self.note_of(source, kind, since, occurrence),
        }
    }

    /// Records a doubtful setting, found at a chainage, m.
    ///
    /// Counts an occurrence and returns true if a different setting is now the one that is most likely wrong.
    pub(crate) fn note_setting(&mut self, at: MonoNs, x_m: f64, doubt: &SettingDoubt) -> bool {
        let kind = ObservedKind::SettingDoubted;
        let known = self.get_mut(kind, None).and_then(|known| known.setting);
        let is_new = known.is_none_or(|known| !known.is_of_same(doubt));
        if is_new {
            self.note(kind, at, Occurrence { x_m, off_m: 0.0 });
        }
        if let Some(known) = self.get_mut(kind, None) {
            known.setting = Some(*doubt);
        }
        is_new
    }

    fn get_mut(&mut self, kind: ObservedKind, source: Option<SourceId>) -> Option<&mut Observation> {
        self.0.iter_mut().flatten().find(|known| known.kind == kind && known.source == source)
    }

    /// All observations made so far.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &Observation> {
        self.0.iter().flatten()
    }
}
