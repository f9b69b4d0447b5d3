//! Open lines to devices: one file per carrier.

#[cfg(target_os = "linux")]
pub(crate) mod can;
#[cfg(target_os = "linux")]
pub(crate) mod hid;
#[cfg(target_os = "linux")]
mod i2c;
mod line;
pub(crate) mod serial;
mod tcp;
mod udp;

use headrace_sensor::connect::Connect;

use crate::open_error::OpenError;
pub use line::{Line, READ_BYTES};

/// Opens the target of a `connect`.
///
/// Errors: the cause, with its fix.
pub(crate) fn open(connect: &Connect) -> Result<Box<dyn Line>, OpenError> {
    match connect {
        Connect::Serial { port, baud } => serial::open(port, *baud),
        Connect::Tcp { address } => tcp::open(address),
        Connect::Udp { address } => udp::open(address),
        Connect::UdpListen { address } => udp::listen(address),
        #[cfg(target_os = "linux")]
        Connect::Can { interface } => can::open(interface),
        #[cfg(target_os = "linux")]
        Connect::Hid(identity) => hid::open(identity),
        #[cfg(target_os = "linux")]
        Connect::I2c { bus, address } => i2c::open(bus, *address),
        #[cfg(not(target_os = "linux"))]
        other => Err(OpenError::unsupported(&other.to_string())),
    }
}
