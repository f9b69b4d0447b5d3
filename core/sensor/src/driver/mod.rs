//! Host side of a device's line, without I/O.
//!
//! A driver decides which bytes are sent to the device and when, which received bytes go to the loop, and whether the
//! device is healthy. It is a state machine that a port's thread runs. Every call passes the time, so that tests can
//! run a driver against an emulated device without a port, a thread or a clock.

mod cutter;
mod interface;
mod listener;
mod strangers;

pub use cutter::{Cutter, Piece};
pub use interface::{Carrier, DeviceHealth, Driver, DriverSetup, Probe, Wire};
pub use listener::{Judge, Listener, MessageListener};
pub use strangers::IgnoredSenders;
