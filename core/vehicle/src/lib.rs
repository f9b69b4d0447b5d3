//! `VEHICLE.toml`: vehicle, sensors, tunnel, target, and parameters of verdicts and navigation.
//!
//! One pass finds all errors of a file. The caller supplies the kinds of device that a file may name.
//! `docs/reference/vehicle-file.md` lists the keys.
//!
//! ```
//! use headrace_config::Document;
//! use headrace_vehicle::VehicleConfig;
//!
//! let no_files = |_: &str| Err("is not here".to_owned());
//! let problem = |text: &str| {
//!     let parsed = VehicleConfig::parse(Document::new("vehicle.toml", text), &[], &no_files);
//!     parsed.err().map(|error| error.to_string()).unwrap_or_default()
//! };
//! let text = "target_m = 50\n[tunnel]\nprofile = \"circle\"\nradius_m = 3\nlength_m = 100\n";
//! let both = "vehicle.toml:1: target_m = 50: must be a number from 0.01 to 20\nvehicle.toml:1: sensors: has no sensor";
//! assert!(problem(text).starts_with(both));
//! ```

#![cfg_attr(not(test), warn(clippy::cast_possible_truncation))]
#![cfg_attr(test, allow(clippy::cast_possible_truncation))]

mod advice;
mod alerts;
mod coverage;
mod findings;
mod mission;
mod navigation;
mod sensors;
mod tunnel;
mod vehicle;

pub use alerts::{AlertClass, AlertTiming, ClassTiming, LimitsConfig};
pub use coverage::CoverageConfig;
pub use findings::{Finding, Grade};
pub use mission::Mission;
pub use navigation::NavigationConfig;
pub use sensors::CONSOLE_ID;
pub use tunnel::TunnelConfig;
pub use vehicle::{VehicleConfig, WaterConfig};
