//! A device as the system's files describe it.

use headrace_sensor::driver::Carrier;

use super::rights::Rights;
use crate::open_error::OpenError;

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
    pub troubles: Vec<OpenError>,
}
