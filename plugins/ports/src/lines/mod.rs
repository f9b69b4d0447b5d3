//! Open lines to devices, with one file per carrier.

#[cfg(target_os = "linux")]
pub(crate) mod can;
#[cfg(target_os = "linux")]
pub(crate) mod hid;
#[cfg(target_os = "linux")]
mod i2c;
mod line;
mod same_device;
pub(crate) mod serial;
mod socket_drops;
mod tcp;
mod udp;
mod udp_listen;

use headrace_sensor::connect::Connect;

use crate::open_error::OpenError;
pub use line::{IsValid, Line, READ_BYTES, Senders};
pub use same_device::same_device;

/// Opens the port or connection that a `connect` names.
///
/// Errors: the cause, with its fix.
pub(crate) fn open(connect: &Connect) -> Result<Box<dyn Line>, OpenError> {
    match connect {
        Connect::Serial { port, baud } => serial::open(port, *baud),
        Connect::Tcp { address } => tcp::open(address),
        Connect::Udp { address } => udp::open(address),
        Connect::UdpListen { address, from } => udp_listen::open(address, from.as_deref()),
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
