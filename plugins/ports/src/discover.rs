//! Lists attached serial ports, HID devices, CAN interfaces and I2C buses from the system's files, without opening
//! any.

pub(crate) mod can;
mod found;
mod hid;
mod i2c;
mod machine;
mod presence;
mod rights;
mod serial;

pub use found::Found;
pub use machine::{Machine, User};
pub use presence::{Presence, presence};
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

#[cfg(test)]
mod tests;
