//! Files that people write, from text to checked values. Reading the file itself is the caller's.

mod changes;
mod connect;
mod coverage;
mod reader;
pub mod vehicle;

pub use changes::changed;
pub use connect::{Connect, ConnectError, SerialPort, UsbIdentity};
pub use coverage::CoverageConfig;
pub use reader::{ConfigError, Document, NamedFile, Section};
pub use vehicle::{SensorConfig, TunnelConfig, VehicleConfig, WaterConfig};
