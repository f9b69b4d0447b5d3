//! What is plugged in: serial ports, HID devices, CAN interfaces and I2C buses, as the system's files tell, without opening
//! any of them.

pub(crate) mod can;
mod hid;
mod i2c;
mod machine;
mod presence;
mod rights;
mod serial;

use headrace_sensor::driver::Carrier;

pub use machine::{Machine, User};
pub use presence::{Presence, presence};
pub use rights::Rights;

pub(crate) use rights::remedy_for;

use crate::trouble::Trouble;

/// Something that a sensor may be connected to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Found {
    /// How bytes get to it.
    pub carrier: Carrier,
    /// The device file or the network interface, as the system calls it now.
    pub name: String,
    /// What it says it is.
    pub says: Option<String>,
    /// The value of `connect` by which a vehicle file names it; of a bus, with a word in place of the device's address.
    pub connect: Option<String>,
    /// More about it: what, and its value.
    pub details: Vec<(&'static str, String)>,
    /// Who may open it; an interface of the network needs no rights.
    pub rights: Option<Rights>,
    /// What keeps us from using it, each with what mends it.
    pub troubles: Vec<Trouble>,
}

/// All that is plugged in, by carrier and then by name.
pub fn discover(machine: &Machine) -> Vec<Found> {
    let mut all = serial::found(machine);
    all.extend(hid::found(machine));
    all.extend(can::found(machine));
    all.extend(i2c::found(machine));
    all
}

#[cfg(test)]
mod tests;
