//! Alerts about the dive as a whole: raised once, then counted.

use bevy_ecs::prelude::Resource;
use serde::{Deserialize, Serialize};

use headrace_coverage::Distrust;
use headrace_geometry::time::MonoNs;
use headrace_sampling::head::MAX_HEADS;
use headrace_sensor::reading::SourceId;

/// Kind of alert.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum AlertKind {
    /// Samples fall beyond either end of the tunnel.
    OutsideTunnel,
    /// Most samples of a section deviate from the design profile by more than the contradiction limit.
    ProfileContradicted,
    /// Successive returns of a head disagree: noise.
    HeadScattered,
    /// A head's range doesn't change while the vehicle's place says it must.
    HeadConstant,
    /// A head contradicts the design where other heads agree with it.
    HeadOutvoted,
}

/// Kinds of alerts that name a head.
const HEAD_KINDS: usize = 3;
/// Room for alerts: one of each kind, or of each kind and head.
const ROOM: usize = AlertKind::ALL.len() - HEAD_KINDS + HEAD_KINDS * MAX_HEADS;

impl AlertKind {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::OutsideTunnel,
        Self::ProfileContradicted,
        Self::HeadScattered,
        Self::HeadConstant,
        Self::HeadOutvoted,
    ];

    /// The alert that a head isn't believed, and its figure, m.
    pub(super) fn of_distrust(why: Distrust) -> (Self, f64) {
        match why {
            Distrust::Scattered(jump_m) => (Self::HeadScattered, jump_m),
            Distrust::Constant(range_m) => (Self::HeadConstant, range_m),
            Distrust::Outvoted(off_m) => (Self::HeadOutvoted, off_m),
        }
    }

    /// The word used in reports and logs.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::OutsideTunnel => "outside_tunnel",
            Self::ProfileContradicted => "profile_contradicted",
            Self::HeadScattered => "head_scattered",
            Self::HeadConstant => "head_constant",
            Self::HeadOutvoted => "head_outvoted",
        }
    }
}

/// An alert with its first occurrence and count.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Alert {
    /// Kind.
    pub kind: AlertKind,
    /// Time of its first occurrence.
    pub since: MonoNs,
    /// Occurrences: samples outside, judgements of sections that contradict the profile, or times a head was distrusted.
    pub count: u64,
    /// Chainage of its first occurrence, m.
    pub x_m: f64,
    /// Largest deviation, m: beyond the end, or a section's mean from the design profile. Of a head, the mean between
    /// successive returns, its constant range, or its mean deviation from the design.
    pub worst_m: f64,
    /// The head that isn't believed.
    pub source: Option<SourceId>,
}

/// All alerts.
#[derive(Debug, Clone, Copy, PartialEq, Default, Resource, Serialize, Deserialize)]
pub struct Alerts([Option<Alert>; ROOM]);

impl Alerts {
    /// Records an alert at a chainage with its deviation, m; true on its first occurrence.
    pub fn note(&mut self, kind: AlertKind, at: MonoNs, x_m: f64, off_m: f64) -> bool {
        self.note_of(None, kind, at, x_m, off_m)
    }

    /// The same of a head.
    pub fn note_of(
        &mut self,
        source: Option<SourceId>,
        kind: AlertKind,
        at: MonoNs,
        x_m: f64,
        off_m: f64,
    ) -> bool {
        let is_it = |alert: &Alert| alert.kind == kind && alert.source == source;
        let Some(slot) = self.0.iter_mut().find(|slot| slot.as_ref().is_none_or(is_it)) else { return false };
        let is_first = slot.is_none();
        let alert = slot.get_or_insert(Alert { kind, since: at, count: 0, x_m, worst_m: off_m, source });
        alert.count += 1;
        if off_m.abs() > alert.worst_m.abs() {
            alert.worst_m = off_m;
        }
        is_first
    }

    /// The alert of a kind, of a head where it names one.
    pub fn get(&self, kind: AlertKind, source: Option<SourceId>) -> Option<&Alert> {
        self.iter().find(|alert| alert.kind == kind && alert.source == source)
    }

    /// All alerts.
    pub fn iter(&self) -> impl Iterator<Item = &Alert> {
        self.0.iter().flatten()
    }
}
