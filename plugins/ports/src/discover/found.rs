//! A device as described by the system's files.

use headrace_sensor::driver::Carrier;

use super::rights::Rights;
use crate::open_error::OpenError;

/// A port or interface that a sensor may be connected to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Found {
    /// Carrier of its bytes.
    pub carrier: Carrier,
    /// Current name of the device file or network interface.
    pub name: String,
    /// Self-description, such as the product name.
    pub says: Option<String>,
    /// Value of `connect` for the vehicle file; for a bus, with a placeholder for the device's address.
    pub connect: Option<String>,
    /// Further properties, as (name, value).
    pub details: Vec<(&'static str, String)>,
    /// Access rights; `None` for a network interface, which needs none.
    pub rights: Option<Rights>,
    /// Problems that keep it from being used, each with its fix.
    pub troubles: Vec<OpenError>,
}
