//! Lists serial ports from `/sys/class/tty`.

use std::fs;
use std::path::{Path, PathBuf};

use headrace_sensor::connect::{Connect, SerialPort, UsbIdentity};
use headrace_sensor::driver::Carrier;

use super::found::Found;
use super::machine::{Machine, text};
use super::rights::Rights;

const CLASS: &str = "/sys/class/tty";
const BY_ID: &str = "/dev/serial/by-id";
/// Port type of a UART that firmware announces but the kernel hasn't detected. Source: Linux, `PORT_UNKNOWN`.
const NOBODY_THERE: &str = "0";
/// Largest number of folders in sysfs that are searched for the USB device: the tty's own, then port, interface and
/// device above it.
const MOST_UP: usize = 4;

/// USB descriptors of a serial adapter.
struct Usb {
    identity: UsbIdentity,
    says: Option<String>,
}

pub(super) fn found(machine: &Machine) -> Vec<Found> {
    let names = machine.names(CLASS).into_iter().filter(|name| is_port(machine, name));
    let ports: Vec<(String, Option<Usb>)> = names
        .map(|name| {
            let usb = usb(machine, &name);
            (name, usb)
        })
        .collect();
    let shared = |usb: &Usb| {
        let same = ports.iter().filter_map(|(_, other)| other.as_ref());
        same.filter(|other| fits(&other.identity, &usb.identity)).count() > 1
    };
    let described = ports.iter().map(|(name, usb)| {
        let unique = usb.as_ref().filter(|usb| !shared(usb)).map(|usb| usb.identity.clone());
        describe(machine, name, usb.as_ref(), unique)
    });
    described.collect()
}

/// Whether an adapter's identity `got` matches the identity `wanted` in a `connect`.
pub(super) fn fits(got: &UsbIdentity, wanted: &UsbIdentity) -> bool {
    (got.vendor, got.product) == (wanted.vendor, wanted.product)
        && (wanted.serial.is_none() || wanted.serial == got.serial)
}

/// Returns the port names and identities of all USB serial adapters.
pub(super) fn adapters(machine: &Machine) -> Vec<(String, UsbIdentity)> {
    let names = machine.names(CLASS).into_iter().filter(|name| is_port(machine, name));
    names.filter_map(|name| Some((format!("/dev/{name}"), usb(machine, &name)?.identity))).collect()
}

/// Whether a tty has hardware. Consoles and pseudoterminals have none.
fn is_port(machine: &Machine, name: &str) -> bool {
    machine.exists(&format!("{CLASS}/{name}/device"))
        && machine.exists(&format!("/dev/{name}"))
        && machine.text(&format!("{CLASS}/{name}/type")).as_deref() != Some(NOBODY_THERE)
}

fn usb(machine: &Machine, name: &str) -> Option<Usb> {
    let device = fs::canonicalize(machine.path(&format!("{CLASS}/{name}/device"))).ok()?;
    let folder: PathBuf =
        device.ancestors().take(MOST_UP).find(|folder| folder.join("idVendor").exists())?.to_owned();
    let identity = UsbIdentity {
        vendor: number(&folder.join("idVendor"))?,
        product: number(&folder.join("idProduct"))?,
        serial: text(&folder.join("serial")),
    };
    let words: Vec<String> =
        ["manufacturer", "product"].iter().filter_map(|what| text(&folder.join(what))).collect();
    Some(Usb { identity, says: (!words.is_empty()).then(|| words.join(" ")) })
}

fn number(path: &Path) -> Option<u16> {
    u16::from_str_radix(&text(path)?, 16).ok()
}

fn describe(machine: &Machine, name: &str, usb: Option<&Usb>, unique: Option<UsbIdentity>) -> Found {
    let path = format!("/dev/{name}");
    let by_id = by_id(machine, name);
    let baud = 115_200;
    let by_path = |path: &String| Connect::Serial { port: SerialPort::Path(path.clone()), baud };
    let by_usb = unique.map(|identity| Connect::Serial { port: SerialPort::Usb(identity), baud });
    // Identities whose serial number has characters that `connect` can't express are left out.
    let by_usb = by_usb.filter(|connect| Connect::parse(&connect.to_string()).as_ref() == Ok(connect));
    let connect = by_usb.unwrap_or_else(|| by_path(by_id.as_ref().unwrap_or(&path)));
    let mut details = Vec::new();
    details.extend(usb.map(|usb| ("USB", usb.identity.to_string())));
    details.extend(by_id.map(|by_id| ("also", by_id)));
    let rights = Rights::of(machine, &path);
    Found {
        carrier: Carrier::Serial,
        says: usb.and_then(|usb| usb.says.clone()),
        connect: Some(connect.to_string()),
        details,
        troubles: rights.iter().filter_map(|rights| rights.trouble(&path)).collect(),
        rights,
        name: path,
    }
}

/// Returns the port's name below `/dev/serial/by-id`, which doesn't depend on the USB socket in use.
fn by_id(machine: &Machine, name: &str) -> Option<String> {
    let links = machine.names(BY_ID).into_iter().map(|link| format!("{BY_ID}/{link}"));
    let mut links = links.filter(|link| {
        let to = fs::read_link(machine.path(link)).ok();
        to.is_some_and(|to| to.file_name().is_some_and(|file| file == name))
    });
    links.next()
}
