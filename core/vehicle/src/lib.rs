//! `VEHICLE.toml`: the vehicle, its sensors, the tunnel, the target, and how the dive is judged and navigated.
//!
//! The kinds of device that a file may name are the caller's; `docs/vehicle-file.md` lists the keys.
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
//! assert_eq!(problem(text), "vehicle.toml:1: target_m = 50: must be a number from 0.01 to 20");
//! assert!(problem(&text.replace("50", "0.5")).starts_with("vehicle.toml:1: sensors: has no sensor"));
//! ```

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
