//! Alerts about the dive as a whole: raised once, then counted.

use bevy_ecs::prelude::Resource;
use serde::{Deserialize, Serialize};

use headrace_coverage::Distrust;
use headrace_fusion::filter::setting_check::SettingDoubt;
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
    /// Successive returns of a head disagree: they are noise.
    HeadScattered,
    /// A head's range stays constant although it must change at the vehicle's place.
    HeadConstant,
    /// A head contradicts the design where other heads agree with it.
    HeadOutvoted,
    /// The cable counter differs from the inertial unit or from a velocity log: one of them is wrong.
    CableDoubted,
    /// Ranges contradict a setting of the vehicle file.
    SettingDoubted,
}

/// Number of kinds that name a head.
const HEAD_KINDS: usize = 3;
/// Maximum number of alerts: one per kind, or per kind and head. The cable counter may also differ from a
/// velocity log.
pub const MOST_ALERTS: usize = AlertKind::ALL.len() + 1 - HEAD_KINDS + HEAD_KINDS * MAX_HEADS;

impl AlertKind {
    /// All kinds.
    pub const ALL: [Self; 7] = [
        Self::OutsideTunnel,
        Self::ProfileContradicted,
        Self::HeadScattered,
        Self::HeadConstant,
        Self::HeadOutvoted,
        Self::CableDoubted,
        Self::SettingDoubted,
    ];

    /// Alert for a distrusted head, and the alert's figure, m.
    pub(super) fn of_distrust(why: Distrust) -> (Self, f64) {
        match why {
            Distrust::Scattered(jump_m) => (Self::HeadScattered, jump_m),
            Distrust::Constant(range_m) => (Self::HeadConstant, range_m),
            Distrust::Outvoted(off_m) => (Self::HeadOutvoted, off_m),
        }
    }

    /// Word used in reports and logs.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::OutsideTunnel => "outside_tunnel",
            Self::ProfileContradicted => "profile_contradicted",
            Self::HeadScattered => "head_scattered",
            Self::HeadConstant => "head_constant",
            Self::HeadOutvoted => "head_outvoted",
            Self::CableDoubted => "cable_doubted",
            Self::SettingDoubted => "setting_doubted",
        }
    }
}

/// An alert with its first occurrence and count.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Alert {
    /// Kind.
    pub kind: AlertKind,
    /// Time of the alert's first occurrence.
    pub since: MonoNs,
    /// Time at which the alert's latest occurrence began.
    pub latest: MonoNs,
    /// Number of occurrences.
    ///
    /// An occurrence is a sample outside the tunnel, a judgement of a contradicting section, or the beginning
    /// of distrust in a head or the cable counter.
    pub count: u64,
    /// Chainage of the alert's first occurrence, m.
    pub x_m: f64,
    /// Largest deviation, m.
    ///
    /// Outside the tunnel: distance from its end. Contradicted profile: mean deviation of a section from the
    /// design. Head: mean difference between successive returns, constant range, or mean deviation from the
    /// design. Cable counter: difference from the other source.
    pub worst_m: f64,
    /// The distrusted head, or the velocity log that the cable counter differs from.
    pub source: Option<SourceId>,
    /// Doubtful setting, as last judged.
    pub setting: Option<SettingDoubt>,
}

/// All alerts about a dive.
#[derive(Debug, Clone, Copy, PartialEq, Default, Resource, Serialize, Deserialize)]
pub struct Alerts([Option<Alert>; MOST_ALERTS]);

impl Alerts {
    /// Records an alert at a chainage with its deviation, m. Returns true on the first occurrence.
    pub fn note(&mut self, kind: AlertKind, at: MonoNs, x_m: f64, off_m: f64) -> bool {
        self.note_of(None, kind, at, x_m, off_m)
    }

    /// Records an alert about a head, or about the velocity log that the cable counter differs from.
    ///
    /// Returns true on the first occurrence.
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
        let alert = slot.get_or_insert(Alert {
            kind,
            since: at,
            latest: at,
            count: 0,
            x_m,
            worst_m: off_m,
            source,
            setting: None,
        });
        alert.count += 1;
        alert.latest = at;
        if off_m.abs() > alert.worst_m.abs() {
            alert.worst_m = off_m;
        }
        is_first
    }

    /// Records a lasting occurrence that began at `since`. Later calls for the same occurrence don't count
    /// again.
    ///
    /// Returns true when the first occurrence is first recorded.
    pub fn note_lasting(
        &mut self,
        source: Option<SourceId>,
        kind: AlertKind,
        since: MonoNs,
        x_m: f64,
        off_m: f64,
    ) -> bool {
        match self.get_mut(kind, source) {
            Some(alert) if alert.latest == since => {
                alert.worst_m = alert.worst_m.max(off_m);
                false
            }
            _ => self.note_of(source, kind, since, x_m, off_m),
        }
    }

    /// Records a doubtful setting, found at a chainage, m.
    ///
    /// If another setting becomes the likeliest, counts an occurrence and returns true.
    pub fn note_setting(&mut self, at: MonoNs, x_m: f64, doubt: &SettingDoubt) -> bool {
        let kind = AlertKind::SettingDoubted;
        let is_new = self
            .get(kind, None)
            .is_none_or(|alert| alert.setting.is_none_or(|known| !known.is_of_same(doubt)));
        if is_new {
            self.note(kind, at, x_m, 0.0);
        }
        if let Some(alert) = self.get_mut(kind, None) {
            alert.setting = Some(*doubt);
        }
        is_new
    }

    /// Alert of a kind, and of a head if the kind names one.
    pub fn get(&self, kind: AlertKind, source: Option<SourceId>) -> Option<&Alert> {
        self.iter().find(|alert| alert.kind == kind && alert.source == source)
    }

    fn get_mut(&mut self, kind: AlertKind, source: Option<SourceId>) -> Option<&mut Alert> {
        self.0.iter_mut().flatten().find(|alert| alert.kind == kind && alert.source == source)
    }

    /// All alerts.
    pub fn iter(&self) -> impl Iterator<Item = &Alert> {
        self.0.iter().flatten()
    }
}
