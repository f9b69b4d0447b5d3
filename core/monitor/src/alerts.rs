//! Alerts about the dive as a whole: raised once, then counted.

use bevy_ecs::prelude::Resource;
use serde::{Deserialize, Serialize};

use headrace_fusion::filter::suspicion::SettingDoubt;
use headrace_geometry::time::MonoNs;

/// Kind of alert.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum AlertKind {
    /// Samples fall beyond either end of the tunnel.
    OutsideTunnel,
    /// Most samples of a section deviate from the design profile by more than the contradiction limit.
    ProfileContradicted,
    /// The cable's counter sticks, slips or runs free: its readings aren't used.
    CableDoubted,
    /// Ranges contradict a setting of the vehicle file.
    SettingDoubted,
}

impl AlertKind {
    /// All of them.
    pub const ALL: [Self; 4] =
        [Self::OutsideTunnel, Self::ProfileContradicted, Self::CableDoubted, Self::SettingDoubted];

    /// The word used in reports and logs.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::OutsideTunnel => "outside_tunnel",
            Self::ProfileContradicted => "profile_contradicted",
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
    /// Time of its first occurrence.
    pub since: MonoNs,
    /// Time at which its latest occurrence began.
    pub latest: MonoNs,
    /// Occurrences: samples outside, judgements of sections that contradict the profile, or times that the cable's counter
    /// wasn't believed.
    pub count: u64,
    /// Chainage of its first occurrence, m.
    pub x_m: f64,
    /// Largest deviation, m: beyond the end, or a section's mean from the design profile. Of the cable's counter, the longest
    /// way on which it wasn't believed.
    pub worst_m: f64,
    /// The setting in doubt, as last judged.
    pub setting: Option<SettingDoubt>,
}

/// All alerts.
#[derive(Debug, Clone, Copy, PartialEq, Default, Resource, Serialize, Deserialize)]
pub struct Alerts([Option<Alert>; AlertKind::ALL.len()]);

impl Alerts {
    /// Records an alert at a chainage with its deviation, m; true on its first occurrence.
    pub fn note(&mut self, kind: AlertKind, at: MonoNs, x_m: f64, off_m: f64) -> bool {
        let Some(slot) = self.0.get_mut(kind as usize) else { return false };
        let is_first = slot.is_none();
        let alert = slot.get_or_insert(Alert {
            kind,
            since: at,
            latest: at,
            count: 0,
            x_m,
            worst_m: off_m,
            setting: None,
        });
        alert.count += 1;
        alert.latest = at;
        if off_m.abs() > alert.worst_m.abs() {
            alert.worst_m = off_m;
        }
        is_first
    }

    /// Records an occurrence that lasts and began at `since`, and is counted once; true when the first one is recorded first.
    pub fn note_lasting(&mut self, kind: AlertKind, since: MonoNs, x_m: f64, off_m: f64) -> bool {
        match self.0.get_mut(kind as usize) {
            Some(Some(alert)) if alert.latest == since => {
                alert.worst_m = alert.worst_m.max(off_m);
                false
            }
            _ => self.note(kind, since, x_m, off_m),
        }
    }

    /// Records a setting in doubt, found at a chainage, m; counted where another one becomes the likeliest, and true then.
    pub fn note_setting(&mut self, at: MonoNs, x_m: f64, doubt: &SettingDoubt) -> bool {
        let kind = AlertKind::SettingDoubted;
        let is_new =
            self.get(kind).is_none_or(|alert| alert.setting.is_none_or(|known| !known.is_of_same(doubt)));
        if is_new {
            self.note(kind, at, x_m, 0.0);
        }
        if let Some(Some(alert)) = self.0.get_mut(kind as usize) {
            alert.setting = Some(*doubt);
        }
        is_new
    }

    /// The alert of a kind.
    pub fn get(&self, kind: AlertKind) -> Option<&Alert> {
        self.0.get(kind as usize)?.as_ref()
    }

    /// All alerts.
    pub fn iter(&self) -> impl Iterator<Item = &Alert> {
        self.0.iter().flatten()
    }
}
