//! Discovery on file trees that imitate real machines, for users with and without access.

use std::fs;
use std::os::unix::fs::{MetadataExt as _, PermissionsExt as _, symlink};
use std::path::{Path, PathBuf};

use headrace_sensor::connect::Connect;

use super::*;
use crate::open_error::OpenErrorKind;

/// File tree of another machine in a temporary folder.
///
/// All files belong to the present user. The tree's `/etc/group` calls this user's group dialout.
struct Tree(PathBuf);

impl Drop for Tree {
    fn drop(&mut self) {
        fs::remove_dir_all(&self.0).unwrap();
    }
}

impl Tree {
    fn new(name: &str) -> Self {
        let root = std::env::temp_dir().join(format!("headrace-discover-{name}-{}", std::process::id()));
        let tree = Self(root);
        let gid = tree.file("/etc/hostname", "rov").metadata().unwrap().gid();
        tree.file("/etc/group", format!("dialout:x:{gid}:ann,pilot\n"));
        tree.file("/etc/passwd", "ann:x:4001:4001:Ann:/home/ann:/bin/sh\n");
        tree.file("/proc/modules", "can_raw 20480 0 - Live 0x0\n");
        tree
    }

    fn file(&self, path: &str, text: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, text).unwrap();
        path
    }

    fn path(&self, path: &str) -> PathBuf {
        self.0.join(path.trim_start_matches('/'))
    }

    fn link(&self, at: &str, to: &str) {
        let at = self.path(at);
        fs::create_dir_all(at.parent().unwrap()).unwrap();
        symlink(to, at).unwrap();
    }

    fn device(&self, path: &str, mode: u32) {
        fs::set_permissions(self.file(path, ""), fs::Permissions::from_mode(mode)).unwrap();
    }

    /// Adds a USB adapter with one serial port for each name in `ttys`.
    fn usb_serial(&self, place: &str, (vendor, product): (&str, &str), serial: Option<&str>, ttys: &[&str]) {
        let device = format!("/sys/devices/usb1/{place}");
        self.file(&format!("{device}/idVendor"), format!("{vendor}\n"));
        self.file(&format!("{device}/idProduct"), format!("{product}\n"));
        self.file(&format!("{device}/manufacturer"), "FTDI\n");
        self.file(&format!("{device}/product"), "FT232R USB UART\n");
        if let Some(serial) = serial {
            self.file(&format!("{device}/serial"), format!("{serial}\n"));
        }
        for (number, tty) in ttys.iter().enumerate() {
            let port = format!("{device}/{place}:1.{number}/{tty}");
            self.file(&format!("{port}/uevent"), "");
            self.link(
                &format!("/sys/class/tty/{tty}/device"),
                &format!("../../../{}", &port["/sys/".len()..]),
            );
            self.device(&format!("/dev/{tty}"), 0o660);
        }
    }

    fn hid(&self, name: &str, serial: &str, mode: u32) {
        let uevent = format!(
            "DRIVER=hid-generic\nHID_ID=0003:00001209:00000001\nHID_NAME=MacArtney counter\nHID_UNIQ={serial}\n"
        );
        self.file(&format!("/sys/class/hidraw/{name}/device/uevent"), uevent);
        self.file(&format!("/sys/class/hidraw/{name}/device/report_descriptor"), [0x06, 0x00, 0xFF, 0x09]);
        self.device(&format!("/dev/{name}"), mode);
    }

    fn net(&self, name: &str, kind: &str, flags: &str, operstate: &str) {
        for (file, text) in [("type", kind), ("flags", flags), ("operstate", operstate)] {
            self.file(&format!("/sys/class/net/{name}/{file}"), format!("{text}\n"));
        }
    }

    fn seen_by(&self, uid: u32, gids: &[u32]) -> Machine {
        Machine::below(&self.0, User::Other { uid, gids: gids.to_vec() })
    }

    fn gid(&self) -> u32 {
        self.path("/etc/group").metadata().unwrap().gid()
    }

    /// Returns the machine as seen by a user who is neither root nor the owner, and not in the group.
    fn seen_by_stranger(&self) -> Machine {
        self.seen_by(4009, &[4009])
    }

    fn seen_by_member(&self) -> Machine {
        self.seen_by(4009, &[4009, self.gid()])
    }
}

fn connects(machine: &Machine) -> Vec<String> {
    discover(machine).into_iter().filter_map(|found| found.connect).collect()
}

fn said(machine: &Machine, connect: &str) -> String {
    match presence(machine, &Connect::parse(connect).unwrap()) {
        Ok(presence) => format!("{presence:?}"),
        Err(trouble) => trouble.to_string(),
    }
}

#[test]
fn usb_ports_have_stable_names() {
    let tree = Tree::new("usb");
    tree.usb_serial("1-1", ("0403", "6001"), Some("A10K"), &["ttyUSB10"]);
    tree.usb_serial("1-2", ("10c4", "ea60"), None, &["ttyUSB2"]);
    tree.usb_serial("1-3", ("0403", "6011"), Some("FOUR"), &["ttyUSB3", "ttyUSB4"]);
    tree.link("/dev/serial/by-id/usb-FTDI_Quad-if00-port0", "../../ttyUSB3");
    let machine = tree.seen_by_member();
    assert_eq!(
        connects(&machine),
        [
            "serial:usb:10c4:ea60?baud=115200",
            "serial:/dev/serial/by-id/usb-FTDI_Quad-if00-port0?baud=115200",
            "serial:/dev/ttyUSB4?baud=115200",
            "serial:usb:0403:6001:A10K?baud=115200",
        ]
    );
    for (connect, path) in connects(&machine).iter().zip(["ttyUSB2", "serial/by-id", "ttyUSB4", "ttyUSB10"]) {
        assert!(said(&machine, connect).starts_with(&format!("There(\"/dev/{path}")), "{connect}");
    }
    let found = discover(&machine);
    assert_eq!(found[3].says.as_deref(), Some("FTDI FT232R USB UART"));
    assert!(found.iter().all(|found| found.troubles.is_empty()));
    let several = said(&machine, "serial:usb:0403:6011:FOUR");
    assert!(several.contains("several, /dev/ttyUSB3 and /dev/ttyUSB4"), "{several}");
    let absent = said(&machine, "serial:usb:0403:6001:OTHER");
    assert!(absent.contains("no such device is plugged in"), "{absent}");
}

#[test]
fn ttys_without_hardware_are_not_listed() {
    let tree = Tree::new("phantoms");
    // A console without hardware, a detected UART (type 4), and a UART that only firmware announces (type 0).
    tree.file("/sys/class/tty/tty1/uevent", "");
    for (name, kind) in [("ttyS0", "4\n"), ("ttyS1", "0\n")] {
        tree.file(&format!("/sys/class/tty/{name}/type"), kind);
        tree.file(&format!("/sys/class/tty/{name}/device/uevent"), "");
        tree.device(&format!("/dev/{name}"), 0o660);
    }
    assert_eq!(connects(&tree.seen_by_member()), ["serial:/dev/ttyS0?baud=115200"]);
    assert_eq!(discover(&Machine::below(Path::new("/nowhere"), User::Ourselves)), []);
}

#[test]
fn denied_user_gets_the_command_that_grants_access() {
    let tree = Tree::new("rights");
    tree.usb_serial("1-1", ("0403", "6001"), Some("A10K"), &["ttyUSB0"]);
    let connect = "serial:/dev/ttyUSB0";
    let join = "sudo usermod -aG dialout $USER, and log in again";
    for (mode, machine, right) in [
        (0o660, tree.seen_by_stranger(), join),
        // The user Ann has joined the group, but her session began earlier.
        (
            0o660,
            tree.seen_by(4001, &[4001]),
            "log in again: this user joined the group dialout after the login",
        ),
        (0o600, tree.seen_by_member(), "sudo chgrp dialout /dev/ttyUSB0 && sudo chmod 660 /dev/ttyUSB0"),
        (0o640, tree.seen_by_member(), "sudo chgrp dialout /dev/ttyUSB0"),
    ] {
        tree.device("/dev/ttyUSB0", mode);
        let trouble = presence(&machine, &Connect::parse(connect).unwrap()).unwrap_err();
        assert_eq!(trouble.kind, OpenErrorKind::Denied);
        assert!(trouble.remedy.as_ref().unwrap().starts_with(right), "{mode:o}: {trouble}");
        let found = discover(&machine).remove(0);
        assert_eq!(found.troubles, [trouble]);
        let rights = found.rights.unwrap();
        assert_eq!((rights.group.as_str(), rights.mode, rights.may_open), ("dialout", mode, false));
    }
    tree.device("/dev/ttyUSB0", 0o660);
    assert_eq!(said(&tree.seen_by_member(), connect), "There(\"/dev/ttyUSB0\")");
    assert_eq!(said(&tree.seen_by(0, &[0]), connect), "There(\"/dev/ttyUSB0\")", "root may open it");
    tree.device("/dev/ttyUSB0", 0o666);
    assert_eq!(said(&tree.seen_by_stranger(), connect), "There(\"/dev/ttyUSB0\")");
    assert!(said(&tree.seen_by_stranger(), "serial:/dev/ttyUSB7").contains("there is no such port"));
}

#[test]
fn connect_of_a_tether_counter_has_ids_and_serial_number() {
    let tree = Tree::new("hid");
    tree.hid("hidraw0", "COUNTER-7", 0o600);
    tree.hid("hidraw1", "COUNTER-8", 0o660);
    let machine = tree.seen_by_member();
    let found = discover(&machine);
    assert_eq!(connects(&machine), ["hid:1209:0001:COUNTER-7", "hid:1209:0001:COUNTER-8"]);
    assert_eq!(found[0].details[1], ("usage page", "0xff00 (the maker's own)".to_owned()));
    assert!(found[0].troubles[0].to_string().contains("install deploy/udev/70-headrace.rules"));
    assert_eq!(found[1].troubles, []);
    assert!(said(&machine, "hid:1209:0001").contains("several, /dev/hidraw0 and /dev/hidraw1"));
    assert_eq!(said(&machine, "hid:1209:0001:COUNTER-8"), "There(\"/dev/hidraw1\")");
}

#[test]
fn unusable_can_interfaces_report_problem_and_fix() {
    let tree = Tree::new("can");
    tree.net("eth0", "1", "0x1003", "up");
    tree.net("can0", "280", "0x40080", "down");
    tree.file("/sys/class/net/can0/device/uevent", "");
    tree.net("can1", "280", "0x40081", "up");
    tree.net("can2", "280", "0x400c1", "down");
    tree.net("vcan0", "280", "0xc1", "unknown");
    tree.net("vcan1", "280", "0x80", "down");
    let machine = tree.seen_by_stranger();
    assert_eq!(connects(&machine), ["can:can0", "can:can1", "can:can2", "can:vcan0", "can:vcan1"]);
    for (connect, words) in [
        ("can:can0", "the interface is down; sudo ip link set can0 up type can bitrate 250000"),
        ("can:can1", "There(\"can1\")"),
        ("can:can2", "off the bus; check bit rate, wiring and termination: ip -details link show can2"),
        ("can:vcan0", "There(\"vcan0\")"),
        ("can:vcan1", "the interface is down; sudo ip link set vcan1 up"),
        ("can:can7", "there is no such CAN interface; plug the adapter in"),
        ("can:eth0", "there is no such CAN interface"),
        ("can:vcan7", "sudo modprobe vcan; sudo ip link add vcan7 type vcan; sudo ip link set vcan7 up"),
    ] {
        assert!(said(&machine, connect).contains(words), "{connect}: {}", said(&machine, connect));
    }
    tree.file("/proc/modules", "");
    assert!(said(&machine, "can:vcan0").contains("no CAN sockets; sudo modprobe can-raw"));
    // The protocol may also be built in, or its module is loaded on first use.
    tree.file("/proc/net/protocols", "protocol  size sockets\nCAN_RAW   1024  0\n");
    assert_eq!(said(&machine, "can:vcan0"), "There(\"vcan0\")");
    tree.file("/proc/net/protocols", "protocol  size sockets\n");
    tree.file("/proc/sys/kernel/osrelease", "6.1.0\n");
    tree.file("/lib/modules/6.1.0/modules.dep", "kernel/net/can/can-raw.ko.xz: kernel/net/can/can.ko.xz\n");
    assert_eq!(said(&machine, "can:vcan0"), "There(\"vcan0\")");
}

#[test]
fn i2c_bus_without_device_file_needs_a_module() {
    let tree = Tree::new("i2c");
    for (name, says) in [("i2c-1", "bcm2835 (i2c@7e804000)"), ("i2c-0", "SMBus I801"), ("1-0040", "ms5837")] {
        tree.file(&format!("/sys/bus/i2c/devices/{name}/name"), says);
    }
    tree.device("/dev/i2c-0", 0o660);
    let machine = tree.seen_by_stranger();
    let found = discover(&machine);
    assert_eq!(connects(&machine), ["i2c:/dev/i2c-0:ADDRESS", "i2c:/dev/i2c-1:ADDRESS"]);
    assert_eq!(found[0].says.as_deref(), Some("SMBus I801"));
    assert!(found[0].troubles[0].to_string().ends_with("sudo usermod -aG dialout $USER, and log in again"));
    assert!(found[1].troubles[0].to_string().contains("no device file; sudo modprobe i2c-dev"));
    assert!(said(&machine, "i2c:/dev/i2c-3:0x40").contains("there is no such bus"));
}

#[test]
fn discovery_finds_all_usb_serial_ports_of_this_machine() {
    let found = discover(&Machine::ours());
    for found in &found {
        assert!(!found.name.is_empty() && found.connect.is_some(), "{found:?}");
    }
    // Device files that the user may open must exist.
    for path in found.iter().filter(|found| found.rights.as_ref().is_some_and(|rights| rights.may_open)) {
        assert!(Path::new(&path.name).exists());
    }
    let names: Vec<&str> = found.iter().map(|found| found.name.as_str()).collect();
    let Ok(ports) = serialport::available_ports() else {
        headrace_support::skipped("this system lists no serial ports");
        return;
    };
    for port in ports {
        let serialport::SerialPortType::UsbPort(_) = port.port_type else { continue };
        assert!(names.contains(&port.port_name.as_str()), "{} is missing in {names:?}", port.port_name);
    }
    println!("found here: {names:?}");
}
