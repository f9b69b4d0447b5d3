//! Navigation: the vehicle's position and attitude from its sensors' readings.
//!
//! [`Navigation`] is the interface that the loop uses. [`filter`] is the error-state Kalman filter over all sensors.
//! [`direct`] is a plain reference method without uncertainty. [`smooth`] is the smoother, which runs after the dive.
//!
//! ```
//! use headrace_fusion::direct::DirectNavigation;
//! use headrace_fusion::{Navigation as _, NoFix, Times};
//! use headrace_geometry::{frames::Rot, site::Site, time::MonoNs, tunnel::shapes};
//! use headrace_sensor::device::{SensorInfo, SensorKind};
//! use headrace_sensor::reading::Reading;
//!
//! let mut navigation = DirectNavigation::new(shapes::circle(3.0)?, Site::default());
//! let now = MonoNs(1_000_000_000);
//! assert_eq!(navigation.fix(now).unwrap_err(), NoFix::Heading);
//! let times = Times { received: now, valid: now };
//! let imu = SensorInfo { kind: SensorKind::Imu, ..SensorInfo::other() };
//! navigation.update(0, &imu, times, &Reading::Attitude(Rot::identity()));
//! // The attitude is known now. The next missing part is the chainage.
//! assert_eq!(navigation.fix(now).unwrap_err(), NoFix::Chainage);
//! # Ok::<(), headrace_geometry::tunnel::ProfileError>(())
//! ```

#![cfg_attr(not(test), warn(clippy::cast_possible_truncation))]
#![cfg_attr(test, allow(clippy::cast_possible_truncation))]

pub mod constant_range;
pub mod direct;
pub mod filter;
pub mod fix;
pub mod relative;
pub mod section;
pub mod smooth;
pub mod stuck_sensor;

use self::filter::cable::CableDoubt;
use self::filter::pose_sd::PoseSd;
use self::filter::setting_check::SettingDoubt;
use self::filter::sources::Consistency;
use headrace_geometry::snapshot::Stateful;
use headrace_geometry::time::MonoNs;
use headrace_sensor::device::SensorInfo;
use headrace_sensor::reading::Reading;

pub use self::fix::{Fix, NoFix, Times};

/// A navigation method that turns readings into fixes.
///
/// Readings arrive in order of receive time, and a fix uses all readings so far. The saved state contains
/// everything that a fix depends on, so that navigation can resume from a snapshot.
pub trait Navigation: Stateful + Send + Sync {
    /// Processes a reading. All readings of one sensor have the same `source`.
    ///
    /// Allocates: never.
    fn update(&mut self, source: usize, sensor: &SensorInfo, times: Times, reading: &Reading);

    /// Finishes navigation after the last reading.
    fn end(&mut self) {}

    /// Returns the innovation statistics of a source; `None` if the method or the source has none.
    fn consistency(&self, _source: usize) -> Option<Consistency> {
        None
    }

    /// Returns the standard deviations of the estimate; `None` if they are unknown.
    fn pose_sd(&self) -> Option<PoseSd> {
        None
    }

    /// Returns the doubt about the cable counter once the doubt has lasted for a second.
    ///
    /// `None` while the counter is trusted, and for methods that do not check the counter.
    fn cable_doubt(&self) -> Option<CableDoubt> {
        None
    }

    /// Returns how much longer the vehicle should stand still for the gyro bias to become known, s.
    ///
    /// 0 once the bias is known, and for methods that learn nothing from a stationary vehicle.
    fn stand_s(&self) -> u32 {
        0
    }

    /// Returns the setting that the ranges contradict with certainty.
    ///
    /// `None` if there is no such setting, and for methods that do not check settings.
    fn setting_doubt(&self) -> Option<SettingDoubt> {
        None
    }

    /// Returns the fix at `at`, which may be shortly before or after the last reading.
    ///
    /// Errors: the part of the fix that is missing.
    fn fix(&self, at: MonoNs) -> Result<Fix, NoFix>;
}
