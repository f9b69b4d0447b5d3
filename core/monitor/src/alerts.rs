//! What is wrong with the dive as a whole: said once, then counted.

use bevy_ecs::prelude::Resource;
use serde::{Deserialize, Serialize};

use headrace_geometry::time::MonoNs;

/// What is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum AlertKind {
    /// Samples fall before the portal or behind the end of the tunnel.
    OutsideTunnel,
    /// Most samples of a section are farther from the design profile than the wall can be.
    ProfileContradicted,
}

impl AlertKind {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::OutsideTunnel, Self::ProfileContradicted];

    /// The word used in reports and logs.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::OutsideTunnel => "outside_tunnel",
            Self::ProfileContradicted => "profile_contradicted",
        }
    }
}

/// Something wrong, since when, and how often.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Alert {
    /// What.
    pub kind: AlertKind,
    /// When it was first seen.
    pub since: MonoNs,
    /// How often: samples outside, or sections judged that contradict the profile.
    pub count: u64,
    /// Chainage at which it was first seen, m.
    pub x_m: f64,
    /// How far off at worst, m: beyond the end, or from the design profile in the mean of a section.
    pub worst_m: f64,
}

/// All that is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Default, Resource, Serialize, Deserialize)]
pub struct Alerts([Option<Alert>; AlertKind::ALL.len()]);

impl Alerts {
    /// Notes that something is wrong at a chainage, by so much; whether it is the first time.
    pub fn note(&mut self, kind: AlertKind, at: MonoNs, x_m: f64, off_m: f64) -> bool {
        let Some(slot) = self.0.get_mut(kind as usize) else { return false };
        let is_first = slot.is_none();
        let alert = slot.get_or_insert(Alert { kind, since: at, count: 0, x_m, worst_m: off_m });
        alert.count += 1;
        if off_m.abs() > alert.worst_m.abs() {
            alert.worst_m = off_m;
        }
        is_first
    }

    /// What is wrong of a kind.
    pub fn get(&self, kind: AlertKind) -> Option<&Alert> {
        self.0.get(kind as usize)?.as_ref()
    }

    /// All that is wrong.
    pub fn iter(&self) -> impl Iterator<Item = &Alert> {
        self.0.iter().flatten()
    }
}
