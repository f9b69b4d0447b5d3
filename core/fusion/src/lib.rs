//! Navigation: the vehicle's position and attitude from its sensors' readings.
//!
//! [`Navigation`] is the interface that the loop uses. [`filter`] is the error-state Kalman filter over all sensors.
//! [`direct`] is a simple method without uncertainties, for comparison. [`smooth`] is the smoother for use after the
//! dive.
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
mod navigation;
pub mod relative;
pub mod section;
pub mod smooth;
pub mod stuck_sensor;

pub use self::fix::{Fix, NoFix, Times};
pub use self::navigation::Navigation;
