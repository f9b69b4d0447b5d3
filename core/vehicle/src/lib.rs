//! `VEHICLE.toml`: the vehicle, its sensors, the tunnel, the target, judging and navigation.

#![cfg_attr(not(test), warn(clippy::cast_possible_truncation))]
#![cfg_attr(test, allow(clippy::cast_possible_truncation))]

mod coverage;
mod mission;
mod navigation;
mod tunnel;
mod vehicle;

pub use coverage::CoverageConfig;
pub use mission::Mission;
pub use navigation::NavigationConfig;
pub use tunnel::TunnelConfig;
pub use vehicle::{VehicleConfig, WaterConfig};
