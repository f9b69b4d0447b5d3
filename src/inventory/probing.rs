//! Probes of the device kinds, and the ports and addresses that receive them.

use headrace_devices::KINDS;
use headrace_ports::{Found, probe};
use headrace_sensor::connect::Connect;
use headrace_sensor::driver::{Carrier, Probe};

use super::state::Probed;

/// All probes, in the order in which they are used.
fn all() -> Vec<Box<dyn Probe>> {
    KINDS.iter().filter_map(|kind| kind.probe()).collect()
}

/// Probe of a device kind by its name in vehicle files; `None` if the kind has no probe.
pub(super) fn kind(name: &str) -> Option<Box<dyn Probe>> {
    KINDS.iter().find(|kind| kind.name() == name)?.probe()
}

/// Probes a serial port that may be opened; `None` for other ports.
pub(super) fn port(found: &Found) -> Option<Probed> {
    if found.carrier != Carrier::Serial || !found.troubles.is_empty() {
        return None;
    }
    let connect = Connect::parse(found.connect.as_ref()?).ok()?;
    Some(address(&connect))
}

/// Probes an address.
pub(super) fn address(connect: &Connect) -> Probed {
    probe(connect, &mut all())
}
