//! Lists HID devices from `/sys/class/hidraw`.

use std::fs;

use headrace_sensor::connect::{Connect, UsbIdentity};
use headrace_sensor::driver::Carrier;

use super::found::Found;
use super::machine::Machine;
use super::rights::Rights;

const CLASS: &str = "/sys/class/hidraw";
/// First item of a report descriptor: the usage page, with one or two bytes of data. Source: HID 1.11, 6.2.2.7.
const PAGE_1: u8 = 0x05;
const PAGE_2: u8 = 0x06;

pub(super) fn found(machine: &Machine) -> Vec<Found> {
    machine.names(CLASS).into_iter().filter_map(|name| describe(machine, &name)).collect()
}

/// Returns the paths and identities of all HID devices.
pub(super) fn identities(machine: &Machine) -> Vec<(String, UsbIdentity)> {
    let names = machine.names(CLASS).into_iter();
    names.filter_map(|name| Some((format!("/dev/{name}"), identity(machine, &name)?.0))).collect()
}

/// Returns the identity and product name of a device.
fn identity(machine: &Machine, name: &str) -> Option<(UsbIdentity, Option<String>)> {
    let event = machine.text(&format!("{CLASS}/{name}/device/uevent"))?;
    let value = |key: &str| {
        let line = event.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix('='));
        line.map(str::to_owned).filter(|value| !value.is_empty())
    };
    let id = value("HID_ID")?;
    let mut parts = id.split(':').skip(1).map(|part| u32::from_str_radix(part, 16).ok());
    let mut part = || u16::try_from(parts.next()??).ok();
    let (vendor, product) = (part()?, part()?);
    Some((UsbIdentity { vendor, product, serial: value("HID_UNIQ") }, value("HID_NAME")))
}

fn describe(machine: &Machine, name: &str) -> Option<Found> {
    let (identity, says) = identity(machine, name)?;
    let path = format!("/dev/{name}");
    let descriptor = fs::read(machine.path(&format!("{CLASS}/{name}/device/report_descriptor")));
    let page = usage_page(&descriptor.unwrap_or_default());
    let mut details = vec![("USB", identity.to_string())];
    details.extend(page.map(|page| {
        let whose = if page >= 0xFF00 { " (the maker's own)" } else { "" };
        ("usage page", format!("{page:#06x}{whose}"))
    }));
    let rights = Rights::of(machine, &path);
    Some(Found {
        carrier: Carrier::Hid,
        says,
        connect: Some(Connect::Hid(identity).to_string()),
        details,
        troubles: rights.iter().filter_map(|rights| rights.trouble(&path)).collect(),
        rights,
        name: path,
    })
}

fn usage_page(descriptor: &[u8]) -> Option<u16> {
    match *descriptor {
        [PAGE_1, page, ..] => Some(u16::from(page)),
        [PAGE_2, low, high, ..] => Some(u16::from_le_bytes([low, high])),
        _ => None,
    }
}
