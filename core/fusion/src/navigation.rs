//! The interface that the loop uses for navigation.

use crate::filter::cable::CableDoubt;
use crate::filter::pose_sd::PoseSd;
use crate::filter::setting_check::SettingDoubt;
use crate::filter::sources::Consistency;
use crate::fix::{Fix, NoFix, Times};
use headrace_geometry::snapshot::Stateful;
use headrace_geometry::time::MonoNs;
use headrace_sensor::device::SensorInfo;
use headrace_sensor::reading::Reading;

/// A navigation method that turns readings into fixes.
///
/// Readings arrive in order of receive time, and a fix uses all readings so far. The saved state contains everything
/// that a fix depends on, so navigation can resume from a snapshot.
pub trait Navigation: Stateful + Send + Sync {
    /// Processes a reading. All readings of one sensor have the same `source`.
    ///
    /// Allocates: never.
    fn update(&mut self, source: usize, sensor: &SensorInfo, times: Times, reading: &Reading);

    /// Finishes navigation after the last reading.
    fn end(&mut self) {}

    /// Returns the innovation statistics of a source. `None` for an unknown source, and for methods without such
    /// statistics.
    fn consistency(&self, _source: usize) -> Option<Consistency> {
        None
    }

    /// Returns the standard deviations of the estimate; `None` if they are unknown.
    fn pose_sd(&self) -> Option<PoseSd> {
        None
    }

    /// Returns the doubt about the cable counter once it has lasted for at least a second.
    ///
    /// `None` while the counter is trusted, and for methods that do not check the counter.
    fn cable_doubt(&self) -> Option<CableDoubt> {
        None
    }

    /// Returns how many more seconds the vehicle should stand still until the gyro bias is known.
    ///
    /// 0 once the bias is known, and for methods that learn nothing from a stationary vehicle.
    fn stand_s(&self) -> u32 {
        0
    }

    /// Returns the setting that the ranges certainly contradict.
    ///
    /// `None` if they contradict no setting, and for methods that do not check settings.
    fn setting_doubt(&self) -> Option<SettingDoubt> {
        None
    }

    /// Whether there are several heads, and the pitch or yaw of a head on its mount is not yet verified.
    ///
    /// False for methods that do not check mounts.
    fn has_unverified_mounts(&self) -> bool {
        false
    }

    /// Returns the fix at `at`, which may be shortly before or after the last reading.
    ///
    /// Errors: the part of the fix that is missing.
    fn fix(&self, at: MonoNs) -> Result<Fix, NoFix>;
}
