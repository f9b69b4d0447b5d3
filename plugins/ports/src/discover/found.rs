//! Description of a device, from the system's files.

use headrace_sensor::driver::Carrier;

use super::rights::Rights;
use crate::open_error::OpenError;

/// A port or interface that a sensor may be connected to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Found {
    /// Carrier of the port or interface.
    pub carrier: Carrier,
    /// Current name of the device file or network interface.
    pub name: String,
    /// Description that the device gives of itself, such as the product name.
    pub says: Option<String>,
    /// Value of `connect` for the vehicle file. For a bus it has a placeholder for the device's address.
    pub connect: Option<String>,
    /// Further properties, each with name and value.
    pub details: Vec<(&'static str, String)>,
    /// Access rights of the device file; `None` for a network interface, which needs none.
    pub rights: Option<Rights>,
    /// Problems that prevent use of the device, each with its fix.
    pub troubles: Vec<OpenError>,
}
