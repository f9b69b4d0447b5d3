//! Navigation: the vehicle's position and attitude from its sensors' readings.
//!
//! [`Navigation`] is the interface that the loop knows. [`filter`] is the error-state Kalman filter over all sensors,
//! [`direct`] a plain reference without uncertainty, [`smooth`] the smoother after the dive.
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
//! // Attitude is known now; the next thing missing is the chainage.
//! assert_eq!(navigation.fix(now).unwrap_err(), NoFix::Chainage);
//! # Ok::<(), headrace_geometry::tunnel::ProfileError>(())
//! ```

#![cfg_attr(not(test), warn(clippy::cast_possible_truncation))]
#![cfg_attr(test, allow(clippy::cast_possible_truncation))]

pub mod direct;
pub mod filter;
pub mod fix;
pub mod one_range;
pub mod relative;
pub mod section;
pub mod smooth;
pub mod stuck_sensor;

use self::filter::cable::CableDoubt;
use self::filter::pose_sd::PoseSd;
use self::filter::sources::Consistency;
use self::filter::suspicion::SettingDoubt;
use headrace_geometry::snapshot::Stateful;
use headrace_geometry::time::MonoNs;
use headrace_sensor::device::SensorInfo;
use headrace_sensor::reading::Reading;

pub use self::fix::{Fix, NoFix, Times};

/// A navigation method. Readings arrive in order of receive time; a fix uses the readings so far. Its state is all that
/// a fix depends on, so that it can be resumed from a snapshot.
pub trait Navigation: Stateful + Send + Sync {
    /// Takes a reading. `source` is the same for all readings of one sensor.
    ///
    /// Allocates: never.
    fn update(&mut self, source: usize, sensor: &SensorInfo, times: Times, reading: &Reading);

    /// Called after the last reading.
    fn end(&mut self) {}

    /// Innovation statistics of a source; `None` where there are none.
    fn consistency(&self, _source: usize) -> Option<Consistency> {
        None
    }

    /// Standard deviations of the estimate; `None` where they aren't known.
    fn pose_sd(&self) -> Option<PoseSd> {
        None
    }

    /// Whether the cable's counter isn't believed, once that has lasted for a second; `None` while it is, and where it isn't
    /// judged.
    fn cable_doubt(&self) -> Option<CableDoubt> {
        None
    }

    /// How much longer the vehicle should stand still for its gyros' bias to be known, s; 0 once it is known, and where standing
    /// shows nothing.
    fn stand_s(&self) -> u32 {
        0
    }

    /// The setting that ranges contradict, if one certainly is wrong; `None`, too, where settings aren't judged.
    fn setting_doubt(&self) -> Option<SettingDoubt> {
        None
    }

    /// Fix at `at`, which may be a little before or after the last reading.
    ///
    /// Errors: the missing part.
    fn fix(&self, at: MonoNs) -> Result<Fix, NoFix>;
}
