//! Interface between the device crates and the rest of the program.
//!
//! A device is three separate things: a codec and decoder (bytes to [`reading::Reading`]s, pure), a driver (the host's side
//! of its line, sans-I/O) and an emulator (the device's side, for simulations). A device's crate depends on this crate
//! alone; the lower ones are re-exported.

#![cfg_attr(not(test), warn(clippy::cast_possible_truncation))]
#![cfg_attr(test, allow(clippy::cast_possible_truncation))]

pub mod codec;
pub mod connect;
pub mod device;
pub mod device_clock;
pub mod driver;
pub mod measurement;
pub mod reading;

pub use device::SensorConfig;
pub use headrace_config as config;
pub use headrace_geometry as geometry;
pub use headrace_sampling as sampling;
pub use headrace_snapshot as snapshot;
pub use headrace_snapshot::stateful;
