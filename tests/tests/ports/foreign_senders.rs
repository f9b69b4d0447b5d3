//! `headrace run` with foreign senders of data: ports that anybody can send to, other MAVLink systems, two sensors on
//! one device, and a serial port that another program has locked.

use std::net::UdpSocket;
use std::os::unix::fs::symlink;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use headrace_mavlink::MavHeader;
use headrace_mavlink::dialect::{HEARTBEAT_DATA, MavAutopilot, MavType};
use headrace_mavlink::frame::encode;
use headrace_mavlink::message::{Message, Pressure, PressureMessage};
use headrace_sensor::connect::{Connect, SerialPort};
use headrace_tests::faulty::{End, Faulty, Healthy};
use headrace_tests::rig::{HEAD, HEADING, emulated};
use headrace_tests::{Folder, raw_messages};
use serde_json::Value;

const TRUE_HPA: f32 = 1100.0;
const FALSE_HPA: f32 = 900.0;
const EACH: Duration = Duration::from_millis(2);

fn header(system_id: u32) -> MavHeader {
    MavHeader { system_id, component_id: 1, sequence: 0 }
}

fn pressure(system_id: u32, absolute_hpa: f32) -> Vec<u8> {
    let message = PressureMessage::Second;
    let pressure =
        Message::Pressure(Pressure { message, time_boot_ms: 1, absolute_hpa, temperature_cdegc: 0 });
    pressure.to_frame(header(system_id)).raw_bytes().to_vec()
}

fn heartbeat(system_id: u32) -> Vec<u8> {
    let (mavtype, autopilot) = (MavType::MAV_TYPE_SUBMARINE, MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA);
    let heartbeat = HEARTBEAT_DATA { mavtype, autopilot, ..HEARTBEAT_DATA::DEFAULT };
    encode(header(system_id), &heartbeat).raw_bytes().to_vec()
}

fn report(folder: &Folder) -> Value {
    serde_json::from_slice(&folder.read("report.json")).unwrap()
}

/// Runs a dive on a local port with a device and a foreign sender.
///
/// The first frames come from a foreign system. The right device sends only after the host has sent something to it.
/// Returns the report and the number of recorded pressures.
fn dive_among_strangers(option: &str, keys: &str) -> (Value, usize, usize) {
    let folder = Folder::new();
    let place = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let [device, stranger] = [(); 2].map(|()| UdpSocket::bind("127.0.0.1:0").unwrap());
    let option = option.replace("<device>", &device.local_addr().unwrap().to_string());
    let sensor = format!(
        "\n[[sensors]]\nid = \"depth\"\nplugin = \"mavlink\"\npart = \"pressure\"\n{keys}connect = \"udp-listen:{place}{option}\"\n"
    );
    folder.write("vehicle.toml", format!("{HEADING}{sensor}"));
    let (ended, known) = (AtomicBool::new(false), AtomicBool::new(false));
    let until_end = |turn: &dyn Fn()| {
        while !ended.load(Ordering::Relaxed) {
            turn();
            thread::sleep(EACH);
        }
    };
    device.set_nonblocking(true).unwrap();
    stranger.set_nonblocking(true).unwrap();
    let (answer, report) = thread::scope(|scope| {
        scope.spawn(|| {
            until_end(&|| {
                // The device's datagrams fail until `headrace run` has opened the port.
                device.send_to(&[heartbeat(1), pressure(1, TRUE_HPA)].concat(), place).unwrap_or_default();
                let heard = device.recv(&mut [0; 300]).is_ok_and(|count| count > 0);
                known.fetch_or(heard, Ordering::Relaxed);
            });
        });
        scope.spawn(|| {
            until_end(&|| {
                let bytes = if known.load(Ordering::Relaxed) {
                    [heartbeat(1), pressure(1, FALSE_HPA)].concat()
                } else {
                    pressure(9, FALSE_HPA)
                };
                stranger.send_to(&bytes, place).unwrap_or_default();
                stranger.send_to(b"x", place).unwrap_or_default();
                assert!(stranger.recv(&mut [0; 300]).is_err(), "the host has sent to the foreign sender");
            });
        });
        let arguments = ["vehicle.toml", "--record", "dive.mcap", "--require", "all"];
        let dived = folder.dive_until(&arguments, |report| {
            let source = &report["sources"][0];
            source["readings"].as_u64() > Some(20) && source["line"]["ignored"].as_u64() > Some(20)
        });
        ended.store(true, Ordering::Relaxed);
        dived
    });
    // A dive with only a depth sensor has no position, so it exits with 1.
    assert_eq!(answer.code, Some(1), "{}{}", answer.stdout, answer.stderr);
    assert!(answer.stdout.contains("on the line of depth came from other devices"), "{}", answer.stdout);
    let log = folder.read("dive.mcap");
    let has = |value: f32| {
        let wanted = value.to_le_bytes();
        let holds = |data: &[u8]| data.windows(4).any(|four| four == wanted);
        raw_messages(&log).iter().filter(|message| holds(&message.data)).count()
    };
    (report, has(TRUE_HPA), has(FALSE_HPA))
}

#[test]
fn open_port_accepts_only_the_autopilot_received_first() {
    for (option, keys) in [("", ""), ("?from=<device>", ""), ("?from=<device>", "system_id = 1\n")] {
        let (report, of_device, of_strangers) = dive_among_strangers(option, keys);
        let source = &report["sources"][0];
        assert!(of_device > 20, "{option}: {of_device}: {source}");
        assert_eq!(of_strangers, 0, "{option}: {source}");
        assert_eq!(source["readings"], of_device, "{option}");
        assert!(source["line"]["ignored"].as_u64().unwrap() > 20, "{source}");
        let status = source["line"]["status"].as_str().unwrap();
        assert!(status.starts_with("running: MAVLink system 1; from 127.0.0.1:"), "{status}");
        assert!(status.contains("ignored: 127.0.0.1:"), "{status}");
    }
}

/// Last statuses of two heads with these addresses (values of `connect`).
fn two(folder: &Folder, connects: [&str; 2]) -> Vec<Value> {
    let sensor = |(id, connect): (&str, &str)| {
        format!("\n[[sensors]]\nid = \"{id}\"\nconnect = \"{connect}\"\n{HEAD}")
    };
    let sensors: String = ["first", "second"].into_iter().zip(connects).map(sensor).collect();
    folder.write("vehicle.toml", format!("{HEADING}{sensors}"));
    let run = ["vehicle.toml", "--no-record", "--require", "first"];
    let is_read = |report: &Value| report["sources"][0]["readings"].as_u64() > Some(0);
    let (answer, report) = folder.dive_until(&run, is_read);
    assert_eq!(answer.code, Some(1), "{}{}", answer.stdout, answer.stderr);
    report["sources"].as_array().unwrap().clone()
}

#[test]
fn second_sensor_on_a_device_is_refused() {
    let folder = Folder::new();
    let end = End::serial(&folder.path(""), "usb-head-port0");
    let place = end.connect().to_string();
    let Connect::Serial { port: SerialPort::Path(path), .. } = end.connect().clone() else {
        panic!("a serial port")
    };
    symlink(&path, folder.path("by-id")).unwrap();
    let other = format!("serial:{}", folder.path("by-id").display());
    let device = Faulty::start(vec![emulated(HEAD)], end, Box::new(Healthy));
    for (connects, why) in [
        ([place.as_str(), other.as_str()], "leads to the same device as"),
        ([place.as_str(), place.as_str()], "the bytes of two"),
    ] {
        let sources = two(&folder, connects);
        let status = |number: usize| sources[number]["line"]["status"].as_str().unwrap();
        assert!(sources[0]["readings"].as_u64().unwrap() > 0, "{}", sources[0]);
        assert_eq!(sources[1]["packets"], 0, "{}", sources[1]);
        assert!(status(1).starts_with("closed: ") && status(1).contains(why), "{}", status(1));
    }
    drop(device);
}

#[test]
fn serial_port_locked_by_another_program_is_not_read() {
    let folder = Folder::new();
    let end = End::serial(&folder.path(""), "usb-head-port0");
    let file = std::fs::File::open(folder.path("usb-head-port0")).unwrap();
    rustix::fs::flock(&file, rustix::fs::FlockOperation::LockExclusive).unwrap();
    let sensor = format!("\n[[sensors]]\nid = \"head\"\nconnect = \"{}\"\n{HEAD}", end.connect());
    folder.write("vehicle.toml", format!("{HEADING}{sensor}"));
    let device = Faulty::start(vec![emulated(HEAD)], end, Box::new(Healthy));
    let answer =
        folder.headrace(&["run", "vehicle.toml", "--no-record", "--report", "report.json", "--for", "1"]);
    drop(device);
    assert_eq!(answer.code, Some(1), "{}{}", answer.stdout, answer.stderr);
    let status = report(&folder)["sources"][0]["line"]["status"].as_str().unwrap().to_owned();
    assert!(status.starts_with("closed: ") && status.contains("another program uses it"), "{status}");
}
