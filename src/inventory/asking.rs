//! What is asked on the lines: each kind of device that can be.

use headrace_ports::{Found, probe};
use headrace_sensor::connect::Connect;
use headrace_sensor::driver::{Carrier, Probe};

use super::Asked;
use crate::devices::KINDS;

/// What can be asked by kind, in the order in which it is.
fn all() -> Vec<Box<dyn Probe>> {
    KINDS.iter().filter_map(|kind| kind.probe()).collect()
}

/// What asks for a kind that a vehicle file names, if anything does.
pub(super) fn kind(name: &str) -> Option<Box<dyn Probe>> {
    KINDS.iter().find(|kind| kind.name() == name)?.probe()
}

/// Asks on a serial port that may be opened; on others nothing can be.
pub(super) fn port(found: &Found) -> Option<Asked> {
    if found.carrier != Carrier::Serial || !found.troubles.is_empty() {
        return None;
    }
    let connect = Connect::parse(found.connect.as_ref()?).ok()?;
    Some(address(&connect))
}

/// Asks at an address.
pub(super) fn address(connect: &Connect) -> Asked {
    probe(connect, &mut all())
}
