//! Lists attached serial ports, HID devices, CAN interfaces and I2C buses from the system's files, without
//! opening any. Also checks whether the port that a `connect` names exists.

pub(crate) mod can;
mod found;
mod hid;
mod i2c;
mod machine;
mod rights;
mod serial;

use headrace_sensor::connect::{Connect, SerialPort, UsbIdentity};

use crate::open_error::OpenError;

pub use found::Found;
pub use machine::{Machine, User};
pub use rights::Rights;

pub(crate) use rights::remedy_for;

/// Returns all attached devices, ordered by carrier and then by name.
pub fn discover(machine: &Machine) -> Vec<Found> {
    let mut all = serial::found(machine);
    all.extend(hid::found(machine));
    all.extend(can::found(machine));
    all.extend(i2c::found(machine));
    all
}

/// Result of a check of the port or address that a `connect` names.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Presence {
    /// The port exists under this name and can be opened.
    There(String),
    /// The `connect` names a network address, which can only be checked by connecting.
    Elsewhere,
}

/// Checks whether the port that `connect` names exists and can be opened, without opening it.
///
/// Errors: the port is absent, ambiguous or not accessible; the error states the fix.
pub fn presence(machine: &Machine, connect: &Connect) -> Result<Presence, OpenError> {
    match connect {
        Connect::Serial { port: SerialPort::Path(path), .. } => file(machine, path),
        Connect::Serial { port: SerialPort::Usb(identity), .. } => {
            let what = format!("serial:usb:{identity}");
            file(machine, &one(&what, serial::adapters(machine), identity)?)
        }
        Connect::Hid(identity) => {
            let what = format!("hid:{identity}");
            file(machine, &one(&what, hid::identities(machine), identity)?)
        }
        Connect::Can { interface } => match can::troubles(machine, interface).into_iter().next() {
            Some(trouble) => Err(trouble),
            None => Ok(Presence::There(interface.clone())),
        },
        Connect::I2c { bus, .. } => match i2c::trouble(machine, bus) {
            Some(trouble) => Err(trouble),
            None => Ok(Presence::There(bus.clone())),
        },
        Connect::Tcp { .. } | Connect::Udp { .. } | Connect::UdpListen { .. } => Ok(Presence::Elsewhere),
    }
}

/// Returns the path of the only matching device file.
fn one(what: &str, all: Vec<(String, UsbIdentity)>, wanted: &UsbIdentity) -> Result<String, OpenError> {
    let fitting = all.into_iter().filter(|(_, got)| serial::fits(got, wanted));
    let mut paths: Vec<String> = fitting.map(|(path, _)| path).collect();
    match paths.len() {
        0 => Err(OpenError::not_plugged_in(what)),
        1 => Ok(paths.remove(0)),
        _ => Err(OpenError::ambiguous(what, &paths)),
    }
}

fn file(machine: &Machine, path: &str) -> Result<Presence, OpenError> {
    let rights = Rights::of(machine, path).ok_or_else(|| OpenError::not_there(path))?;
    rights.trouble(path).map_or_else(|| Ok(Presence::There(path.to_owned())), Err)
}

#[cfg(test)]
mod tests;
