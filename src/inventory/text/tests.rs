//! Checks text and JSON for a machine that is simulated by files.

use std::fs;
use std::os::unix::fs::{MetadataExt as _, PermissionsExt as _, symlink};
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};

use headrace_ports::{Machine, Presence, User, discover, presence};
use headrace_sensor::connect::Connect;
use insta::assert_snapshot;
use serde_json::json;

use super::*;

/// Files of a simulated machine in a temporary folder, which is removed on drop.
///
/// On that machine all files belong to the user root and the group dialout.
struct Tree(PathBuf);

impl Drop for Tree {
    fn drop(&mut self) {
        fs::remove_dir_all(&self.0).unwrap();
    }
}

impl Tree {
    fn new(name: &str) -> Self {
        // Two tests may build a machine of the same name at the same time, so each call gets its own folder.
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let (process, count) = (std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
        let tree = Self(std::env::temp_dir().join(format!("headrace-devices-{name}-{process}-{count}")));
        let ids = tree.file("/etc/hostname", "rov").metadata().unwrap();
        tree.file("/etc/group", &format!("dialout:x:{}:\n", ids.gid()));
        tree.file("/etc/passwd", &format!("root:x:{}:0:root:/root:/bin/sh\n", ids.uid()));
        tree.file("/proc/modules", "can_raw 20480 0 - Live 0x0\n");
        tree
    }

    fn file(&self, path: &str, text: &str) -> PathBuf {
        let path = self.0.join(path.trim_start_matches('/'));
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, text).unwrap();
        path
    }

    fn device(&self, path: &str, mode: u32) {
        fs::set_permissions(self.file(path, ""), fs::Permissions::from_mode(mode)).unwrap();
    }

    fn link(&self, at: &str, to: &str) {
        let at = self.0.join(at.trim_start_matches('/'));
        fs::create_dir_all(at.parent().unwrap()).unwrap();
        symlink(to, at).unwrap();
    }

    /// A machine with four devices: an adapter that has an echosounder, a counter that only root may open, an
    /// adapter that is down, and a bus without files.
    fn vehicle() -> Self {
        let tree = Self::new("vehicle");
        let usb = "/sys/devices/usb1/1-1";
        for (file, text) in [
            ("idVendor", "0403"),
            ("idProduct", "6015"),
            ("serial", "DM00QXYZ"),
            ("product", "FT230X Basic UART"),
        ] {
            tree.file(&format!("{usb}/{file}"), text);
        }
        tree.file(&format!("{usb}/1-1:1.0/ttyUSB0/uevent"), "");
        tree.link("/sys/class/tty/ttyUSB0/device", "../../../devices/usb1/1-1/1-1:1.0/ttyUSB0");
        tree.device("/dev/ttyUSB0", 0o660);
        tree.link("/dev/serial/by-id/usb-FTDI_FT230X_DM00QXYZ-if00-port0", "../../ttyUSB0");
        tree.file(
            "/sys/class/hidraw/hidraw0/device/uevent",
            "HID_ID=0003:00001209:00000001\nHID_NAME=tether counter\nHID_UNIQ=HR-0001",
        );
        tree.file("/sys/class/hidraw/hidraw0/device/report_descriptor", "\x06\0\x7F\t");
        tree.device("/dev/hidraw0", 0o600);
        for (file, text) in
            [("type", "280"), ("flags", "0x40080"), ("operstate", "down"), ("device/uevent", "")]
        {
            tree.file(&format!("/sys/class/net/can0/{file}"), text);
        }
        tree.file("/sys/bus/i2c/devices/i2c-1/name", "bcm2835 (i2c@7e804000)");
        tree
    }

    fn machine(&self) -> Machine {
        let gid = self.0.join("etc/group").metadata().unwrap().gid();
        Machine::below(&self.0, User::Other { uid: 4009, gids: vec![gid] })
    }
}

fn sensor(machine: &Machine, id: &str, connect: &str) -> Sensor {
    let state = presence(machine, &Connect::parse(connect).unwrap()).map(|presence| match presence {
        Presence::There(name) => State::Present(name),
        Presence::Elsewhere => State::NotProbed,
    });
    Sensor { id: id.to_owned(), connect: connect.to_owned(), state }
}

fn inventory() -> Inventory {
    let tree = Tree::vehicle();
    let machine = tree.machine();
    let is = |words: &str| Some(Ok(Answer::Is(words.to_owned())));
    let found = discover(&machine).into_iter().map(|found| {
        let asked = if found.name == "/dev/ttyUSB0" { is("Ping echosounder, device_id = 1") } else { None };
        (found, asked)
    });
    let address = |text: &str, answer| (Connect::parse(text).unwrap(), Ok(answer));
    Inventory {
        found: found.collect(),
        addresses: vec![
            address("tcp:192.168.0.5:4040", Answer::Is("Imagenex 881 family, head_id = 0x10".to_owned())),
            address("udp:192.168.2.2:9090", Answer::Silence),
            address("udp:192.168.2.2:9091", Answer::Unknown(812)),
        ],
        sensors: Some(vec![
            sensor(&machine, "ping_left", "serial:usb:0403:6015:DM00QXYZ"),
            sensor(&machine, "imu", "can:can0"),
            sensor(&machine, "tether", "hid:1209:0001"),
            sensor(&machine, "front", "tcp:192.168.0.5:4040"),
        ]),
    }
}

#[test]
fn each_device_is_listed_with_its_errors_and_their_fixes() {
    assert_snapshot!(text(&inventory()), @r#"
    Serial ports
      /dev/ttyUSB0  FT230X Basic UART
        connect = "serial:usb:0403:6015:DM00QXYZ?baud=115200"
        USB         0403:6015:DM00QXYZ
        also        /dev/serial/by-id/usb-FTDI_FT230X_DM00QXYZ-if00-port0
        rights      root:dialout 660, this user may open it
        answers     Ping echosounder, device_id = 1
    HID devices
      /dev/hidraw0  tether counter
        connect = "hid:1209:0001:HR-0001"
        USB         1209:0001:HR-0001
        usage page  0x7f00
        rights      root:dialout 600, this user may not open it
        PROBLEM     opening /dev/hidraw0: this user may not open it
        fix         install deploy/udev/70-headrace.rules, with the ids of this device in it, and sudo udevadm trigger
    CAN interfaces
      can0  an adapter
        connect = "can:can0"
        state       down
        PROBLEM     opening can0: the interface is down
        fix         sudo ip link set can0 up type can bitrate 250000, with the rate of the bus
    I2C buses
      /dev/i2c-1  bcm2835 (i2c@7e804000)
        connect = "i2c:/dev/i2c-1:ADDRESS"
        PROBLEM     opening /dev/i2c-1: the bus has no device file
        fix         sudo modprobe i2c-dev; to load it at each boot: echo i2c-dev | sudo tee /etc/modules-load.d/i2c.conf
    Addresses
      tcp:192.168.0.5:4040
        answers     Imagenex 881 family, head_id = 0x10
      udp:192.168.2.2:9090
        answers     no answer; is it powered?
      udp:192.168.2.2:9091
        answers     812 bytes of an unknown protocol
    Sensors
      ping_left  serial:usb:0403:6015:DM00QXYZ: present, /dev/ttyUSB0
      imu        can:can0
        PROBLEM     opening can0: the interface is down
        fix         sudo ip link set can0 up type can bitrate 250000, with the rate of the bus
      tether     hid:1209:0001
        PROBLEM     opening /dev/hidraw0: this user may not open it
        fix         install deploy/udev/70-headrace.rules, with the ids of this device in it, and sudo udevadm trigger
      front      tcp:192.168.0.5:4040: network address, not probed (--probe)
    "#);
}

#[test]
fn empty_machine_is_reported_as_empty() {
    assert_snapshot!(text(&Inventory::default()), @r"
    Serial ports: none
    HID devices: none
    CAN interfaces: none
    I2C buses: none
    ");
}

#[test]
fn exit_code_is_1_while_a_sensor_has_no_ready_port() {
    let mut inventory = inventory();
    assert_eq!(inventory.exit_code(), 1);
    let shown = inventory.json();
    assert_eq!(
        shown["sensors"][0],
        json!({
            "id": "ping_left", "connect": "serial:usb:0403:6015:DM00QXYZ", "ok": true, "name": "/dev/ttyUSB0",
        })
    );
    assert_eq!(shown["sensors"][1]["ok"], json!(false));
    assert_eq!(shown["found"][1]["rights"]["mode"], json!("600"));
    assert_eq!(shown["found"][0]["answer"], json!({"is": "Ping echosounder, device_id = 1"}));
    assert_eq!(shown["found"][2]["troubles"][0]["why"], json!("opening can0: the interface is down"));
    let sensors = inventory.sensors.as_mut().unwrap();
    sensors.retain(|sensor| sensor.state.is_ok());
    assert_eq!((sensors.len(), inventory.exit_code()), (2, 0));
    inventory.sensors = None;
    assert_eq!(inventory.exit_code(), 0, "nothing can be missing without a vehicle file");
    assert_eq!(inventory.json()["sensors"], json!(null));
}
