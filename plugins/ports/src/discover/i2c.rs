//! Lists I2C buses from `/sys/bus/i2c`.

use headrace_sensor::driver::Carrier;

use super::found::Found;
use super::machine::Machine;
use super::rights::Rights;
use crate::fix_hint;
use crate::open_error::{OpenError, OpenErrorKind};

const DEVICES: &str = "/sys/bus/i2c/devices";

/// Returns the buses. The folder also lists the devices on them, whose names don't begin with `i2c-`.
pub(super) fn found(machine: &Machine) -> Vec<Found> {
    let names = machine.names(DEVICES).into_iter();
    let buses = names.filter(|name| name.strip_prefix("i2c-").is_some_and(|n| n.parse::<u32>().is_ok()));
    buses.map(|name| describe(machine, &name)).collect()
}

fn describe(machine: &Machine, name: &str) -> Found {
    let path = format!("/dev/{name}");
    let rights = Rights::of(machine, &path);
    Found {
        carrier: Carrier::I2c,
        says: machine.text(&format!("{DEVICES}/{name}/name")),
        connect: Some(format!("i2c:{path}:ADDRESS")),
        details: Vec::new(),
        troubles: trouble(machine, &path).into_iter().collect(),
        rights,
        name: path,
    }
}

/// Returns the problem that prevents use of a bus.
pub(super) fn trouble(machine: &Machine, path: &str) -> Option<OpenError> {
    if let Some(rights) = Rights::of(machine, path) {
        return rights.trouble(path);
    }
    let bus = path.strip_prefix("/dev/").unwrap_or(path);
    let why = |words: &str| format!("opening {path}: {words}");
    Some(if machine.exists(&format!("{DEVICES}/{bus}")) {
        OpenError::new(OpenErrorKind::Absent, why("the bus has no device file"), Some(fix_hint::I2C_DEV))
    } else {
        OpenError::new(
            OpenErrorKind::Absent,
            why("there is no such bus"),
            Some("headrace devices shows what there is"),
        )
    })
}
