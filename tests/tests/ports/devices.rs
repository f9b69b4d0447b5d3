//! `headrace devices` identifies emulated devices on real ports. It reports missing devices with a remedy.

use std::net::{IpAddr, Ipv4Addr};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

use headrace_config::Document;
use headrace_devices::KINDS;
use headrace_geometry::site::Site;
use headrace_geometry::time::DurNs;
use headrace_ports::{Answer, EmulatedPort, probe, wait_for_any};
use headrace_sensor::connect::Connect;
use headrace_sensor::device::{Direction, Emulated, EmulatorSetup};
use headrace_sensor::driver::{Carrier, Probe};
use headrace_vehicle::VehicleConfig;
use serde_json::Value;

const LOCAL: IpAddr = IpAddr::V4(Ipv4Addr::LOCALHOST);
/// Number of unanswered probe requests after which the test treats a device as silent.
const TRIES: u32 = 30;
const HEAD: &str = "plugin = \"imagenex881\"\nmode = \"slow\"\nrange_m = 10\nhead_id = 0x12";
const PING: &str = "plugin = \"ping1d\"\ndevice_id = 7";

/// Returns a vehicle file with these sensors. Each sensor is given by the keys of its table and its address.
fn vehicle_text(sensors: &[(&str, String)]) -> String {
    let mut text =
        include_str!("../../../deploy/vehicles/pipe.toml").split("[[sensors]]").next().unwrap().to_owned();
    for (number, (keys, connect)) in sensors.iter().enumerate() {
        let table = format!("[[sensors]]\nid = \"sensor_{number}\"\n{keys}\nconnect = \"{connect}\"\n");
        text.push_str(&table);
        text.push_str("position_m = [0.1, 0.0, 0.0]\nangles_deg = [0, 0, 0]\n");
    }
    text
}

fn emulator(keys: &str) -> Emulated {
    let text = vehicle_text(&[(keys, String::new())]);
    let vehicle =
        VehicleConfig::parse(Document::new("vehicle.toml", &text), &KINDS, &|_| unreachable!()).unwrap();
    let start = headrace_ports::now();
    vehicle.sensors[0].emulator(&EmulatorSetup { start, head: None, site: Site::default(), polled: false })
}

/// An emulated device on a port. The device runs until this value is dropped.
struct Device {
    connect: Connect,
    stopping: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Device {
    /// Starts an emulated device. `answer` gets the bytes that the host sent, and returns the device's reply.
    fn new(carrier: Carrier, mut answer: impl FnMut(&[u8]) -> Vec<Vec<u8>> + Send + 'static) -> Self {
        let mut stand = EmulatedPort::new(carrier, LOCAL).unwrap();
        let (connect, stopping) = (stand.connect().clone(), Arc::new(AtomicBool::new(false)));
        let stops = Arc::clone(&stopping);
        let thread = thread::spawn(move || {
            while !stops.load(Ordering::Relaxed) {
                wait_for_any(std::slice::from_ref(&stand), 1_000_000);
                while let Some(bytes) = stand.read().unwrap() {
                    for message in answer(&bytes) {
                        stand.write(&message).unwrap();
                    }
                }
                thread::yield_now();
            }
        });
        Self { connect, stopping, thread: Some(thread) }
    }

    fn emulated(carrier: Carrier, keys: &'static str) -> Self {
        let (Emulated::Head(mut device) | Emulated::Echosounder(mut device)) = emulator(keys) else {
            panic!()
        };
        Self::new(carrier, move |bytes| {
            let (mut answers, mut due) = (Vec::new(), Vec::new());
            let at = headrace_ports::now();
            let mut line = |direction, _, bytes: &[u8]| {
                assert_eq!(direction, Direction::Received);
                answers.push(bytes.to_vec());
            };
            device.hear(at, bytes, &mut line);
            device.begin(at + DurNs(1), &mut due);
            for sounding in &due {
                device.tell(sounding, &mut line);
            }
            answers
        })
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        self.stopping.store(true, Ordering::Relaxed);
        self.thread.take().unwrap().join().unwrap();
    }
}

fn probes() -> Vec<Box<dyn Probe>> {
    KINDS.iter().flat_map(|kind| kind.probes()).collect()
}

fn asked(device: &Device) -> Answer {
    probe(&device.connect, &mut probes()).unwrap()
}

/// Identity that a device states when probed. If the machine is too busy to answer in time, the probe is repeated.
fn identity(device: &Device) -> Option<String> {
    (0..TRIES).find_map(|_| match asked(device) {
        Answer::Is(identity) => Some(identity),
        _ => None,
    })
}

/// Runs the program; returns exit code, standard output and standard error.
fn headrace(arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = headrace_tests::program().arg("devices").args(arguments).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    (output.status.code(), text(&output.stdout), text(&output.stderr))
}

#[test]
fn devices_on_real_ports_are_identified() {
    for carrier in [Carrier::Serial, Carrier::Tcp, Carrier::Udp] {
        for (keys, words) in [
            (HEAD, "Imagenex 881 family or 852 sounder, head_id = 0x12"),
            (
                PING,
                "Ping echosounder (Ping1D, Ping2), device_id = 7, revision 1, firmware 3.29.0, protocol 1.0.0",
            ),
        ] {
            let device = Device::emulated(carrier, keys);
            // The device is probed twice, because after a probe the line must be in a state in which the next probe
            // succeeds.
            for _ in 0..2 {
                let identity = identity(&device).unwrap_or_else(|| panic!("{carrier:?}: {words}: no answer"));
                assert!(identity.starts_with(words), "{carrier:?}: {identity}");
            }
        }
    }
}

#[test]
fn silence_and_unknown_bytes_are_distinguished() {
    let silent = Device::new(Carrier::Serial, |_| Vec::new());
    assert_eq!(asked(&silent), Answer::Silence);
    let modem =
        Device::new(
            Carrier::Tcp,
            |bytes| if bytes.is_empty() { vec![] } else { vec![b"ERROR\r\n".to_vec()] },
        );
    let Answer::Unknown(bytes) = asked(&modem) else { panic!("the modem answers") };
    assert!(bytes > 0 && bytes % 7 == 0, "{bytes}");
    let nobody = Connect::parse("tcp:127.0.0.1:1").unwrap();
    let trouble = probe(&nobody, &mut probes()).unwrap_err().to_string();
    assert!(trouble.contains("no device listens there"), "{trouble}");
}

#[test]
fn devices_command_lists_ports_and_probes_addresses() {
    let (code, plain, _) = headrace(&[]);
    assert_eq!(code, Some(0));
    for title in ["Serial ports", "HID devices", "CAN interfaces", "I2C buses"] {
        assert!(plain.contains(title), "{plain}");
    }
    let (head, ping) = (Device::emulated(Carrier::Tcp, HEAD), Device::emulated(Carrier::Udp, PING));
    let addresses = [head.connect.to_string(), ping.connect.to_string()];
    let (code, printed, _) = headrace(&["--address", &addresses[0], "--address", &addresses[1]]);
    assert_eq!(code, Some(0));
    assert!(
        printed.contains(&format!("  {}\n    answers     Imagenex 881 family", addresses[0])),
        "{printed}"
    );
    assert!(printed.contains(&format!("  {}\n    answers     Ping echosounder", addresses[1])), "{printed}");
    let (code, json, _) = headrace(&["--json", "--address", &addresses[0]]);
    let shown: Value = serde_json::from_str(&json).unwrap();
    assert_eq!((code, &shown["addresses"][0]["connect"]), (Some(0), &Value::from(addresses[0].as_str())));
    assert!(shown["found"].is_array() && shown["sensors"].is_null());
    let (code, _, refused) = headrace(&["--address", "can:can0"]);
    assert_eq!(code, Some(2));
    assert!(refused.contains("expected tcp:HOST:PORT or udp:HOST:PORT"), "{refused}");
}

#[test]
fn vehicle_file_is_compared_with_the_devices_found() {
    let folder = std::env::temp_dir().join(format!("headrace-devices-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let file = folder.join("vehicle.toml");
    let (port, head) = (Device::emulated(Carrier::Serial, PING), Device::emulated(Carrier::Tcp, HEAD));
    let there = vec![(PING, port.connect.to_string()), (HEAD, head.connect.to_string())];
    let path = file.to_str().unwrap();

    std::fs::write(&file, vehicle_text(&there)).unwrap();
    let (code, printed, _) = headrace(&["--vehicle", path]);
    assert_eq!(code, Some(0), "{printed}");
    assert!(
        printed.contains(": present, /dev/pts/") && printed.contains("not probed (--probe)"),
        "{printed}"
    );
    let (code, printed, _) = headrace(&["--vehicle", path, "--probe"]);
    assert_eq!(code, Some(0), "{printed}");
    assert!(printed.contains("Imagenex 881 family or 852 sounder, head_id = 0x12"), "{printed}");

    let missing = (PING, "serial:usb:0403:6015:NOT-HERE".to_owned());
    let wrong = (HEAD, "can:can0".to_owned());
    std::fs::write(&file, vehicle_text(&[there[0].clone(), missing, wrong])).unwrap();
    let (code, printed, _) = headrace(&["--vehicle", path]);
    std::fs::remove_dir_all(&folder).unwrap();
    assert_eq!(code, Some(1), "{printed}");
    assert!(
        printed.contains("no such device is plugged in")
            && printed.contains("a device of this kind cannot use can:"),
        "{printed}"
    );
}
