//! Lists CAN interfaces from `/sys/class/net`, with the problems that prevent their use.

use headrace_sensor::connect::Connect;
use headrace_sensor::driver::Carrier;

use super::found::Found;
use super::machine::Machine;
use crate::fix_hint;
use crate::open_error::{OpenError, OpenErrorKind};

const CLASS: &str = "/sys/class/net";
/// Hardware type of CAN interfaces. Source: Linux, `ARPHRD_CAN`.
const CAN: &str = "280";
/// Interface flag "up". Source: Linux, `IFF_UP`.
const UP: u32 = 1;

pub(super) fn found(machine: &Machine) -> Vec<Found> {
    let names = machine.names(CLASS).into_iter();
    names.filter(|name| is_can(machine, name)).map(|name| describe(machine, name)).collect()
}

fn is_can(machine: &Machine, name: &str) -> bool {
    machine.text(&format!("{CLASS}/{name}/type")).as_deref() == Some(CAN)
}

/// Whether this machine has a network interface of this name that is up.
pub fn is_interface_up(name: &str) -> bool {
    is_up(&Machine::ours(), name) == Some(true)
}

/// Whether the interface is up; `None` if its flags can't be read.
fn is_up(machine: &Machine, name: &str) -> Option<bool> {
    let flags = machine.text(&format!("{CLASS}/{name}/flags"))?;
    let flags = u32::from_str_radix(flags.trim_start_matches("0x"), 16).ok()?;
    Some(flags & UP != 0)
}

/// Whether the interface is a hardware adapter, which needs a bit rate. Virtual interfaces have none.
fn has_hardware(machine: &Machine, name: &str) -> bool {
    machine.exists(&format!("{CLASS}/{name}/device"))
}

/// Returns the error for an interface that is down; `None` if it is up or its flags can't be read.
pub(crate) fn down(machine: &Machine, name: &str) -> Option<OpenError> {
    if is_up(machine, name)? {
        return None;
    }
    let why = format!("opening {name}: the interface is down");
    let mends = fix_hint::set_up(name, has_hardware(machine, name));
    Some(OpenError::new(OpenErrorKind::Other, why, Some(&mends)))
}

/// Returns the problems that prevent use of the interface.
pub(super) fn troubles(machine: &Machine, name: &str) -> Vec<OpenError> {
    if !is_can(machine, name) {
        return vec![OpenError::no_interface(name)];
    }
    let state = machine.text(&format!("{CLASS}/{name}/operstate"));
    let silenced = state.as_deref() == Some("down") && is_up(machine, name) == Some(true);
    let silenced = silenced.then(|| {
        let why = format!("opening {name}: the interface is up, but off the bus");
        OpenError::new(OpenErrorKind::Other, why, Some(&fix_hint::back_on_bus(name)))
    });
    let has_sockets = machine.has_protocol("CAN_RAW") || machine.has_module("can_raw");
    let no_sockets = (!has_sockets).then(|| OpenError::no_can(name));
    down(machine, name).into_iter().chain(silenced).chain(no_sockets).collect()
}

fn describe(machine: &Machine, name: String) -> Found {
    let kind = if has_hardware(machine, &name) { "an adapter" } else { "without hardware" };
    let state = match is_up(machine, &name) {
        Some(true) => "up",
        Some(false) => "down",
        None => "unknown",
    };
    Found {
        carrier: Carrier::Can,
        says: Some(kind.to_owned()),
        connect: Some(Connect::Can { interface: name.clone() }.to_string()),
        details: vec![("state", state.to_owned())],
        rights: None,
        troubles: troubles(machine, &name),
        name,
    }
}
