//! `headrace run` and `headrace check` with wrong, missing or silent ports.
//!
//! Each faulty sensor must be reported together with the valid form of its address. The dive must go on with the other
//! sensors. Exit codes are checked too.

use headrace_tests::faulty::{End, Fault, Faulty, Healthy, Wire};
use headrace_tests::pty::Terminal;
use headrace_tests::rig::{COUNTER, HEAD, HEADING, emulated};
use headrace_tests::{Folder, raw_messages};
use mcap::MessageStream;
use serde_json::Value;
use std::io::Write as _;
use std::process::Stdio;
use std::time::Duration;

use crate::rehearsal::Running;

/// Sensors with invalid addresses. Each address is wrong in another way.
const WRONG: [(&str, &str, &str); 7] = [
    ("no_colon", HEAD, "192.168.0.5"),
    ("no_port", HEAD, "tcp:192.168.0.5"),
    ("baud", HEAD, "serial:/dev/ttyUSB0?baud=fast"),
    ("carrier", HEAD, "can:can0"),
    ("product", COUNTER, "hid:1209"),
    ("address", "plugin = \"bar100\"\n", "i2c:/dev/i2c-1:0x99"),
    ("empty", COUNTER, ""),
];

/// Sensors whose ports don't exist.
const ABSENT: [(&str, &str, &str); 4] = [
    ("adapter", HEAD, "serial:/dev/serial/by-id/usb-headrace-none"),
    ("usb", HEAD, "serial:usb:1209:fffe:none"),
    ("counter", COUNTER, "hid:1209:fffe:none"),
    ("imu", "plugin = \"imu_can\"\npreset = \"xsens_mti600\"\n", "can:none77"),
];

fn vehicle(sensors: &[(&str, &str, &str)]) -> String {
    let sensor = |(id, text, connect): &(&str, &str, &str)| {
        format!("\n[[sensors]]\nid = \"{id}\"\nconnect = \"{connect}\"\n{text}")
    };
    HEADING.to_owned() + &sensors.iter().map(sensor).collect::<String>()
}

fn report(folder: &Folder) -> Value {
    serde_json::from_slice(&folder.read("report.json")).unwrap()
}

/// Last status of each sensor, one per line.
fn statuses(report: &Value) -> String {
    let line = |source: &Value| {
        format!("{}: {}\n", source["id"].as_str().unwrap(), source["line"]["status"].as_str().unwrap())
    };
    report["sources"].as_array().unwrap().iter().map(line).collect()
}

const RUN: [&str; 7] = ["run", "vehicle.toml", "--no-record", "--report", "report.json", "--for", "3"];
/// Arguments of a run without a time limit.
const RUN_UNTIL: [&str; 2] = ["vehicle.toml", "--no-record"];

/// Whether the first sensor in the report has more than ten readings and the status "running".
fn first_runs(report: &Value) -> bool {
    let first = &report["sources"][0];
    let status = first["line"]["status"].as_str().unwrap_or_default();
    first["readings"].as_u64() > Some(10) && status.starts_with("running")
}

#[test]
fn check_reports_every_wrong_connect_with_the_valid_form() {
    let folder = Folder::new();
    folder.write("vehicle.toml", vehicle(&WRONG));
    let answer = folder.headrace(&["check", "vehicle.toml"]);
    assert_eq!(answer.code, Some(2), "{}", answer.stdout);
    assert!(!answer.stdout.contains("no errors"), "{}", answer.stdout);
    insta::assert_snapshot!(answer.stderr, @r#"
    headrace: vehicle.toml:11: sensors[0].connect: there is no colon; allowed are serial:/dev/serial/by-id/NAME?baud=115200, serial:usb:VID:PID[:SERIAL]?baud=115200, tcp:HOST:PORT, udp:HOST:PORT, udp-listen:ADDRESS:PORT, can:INTERFACE, hid:VID:PID[:SERIAL], i2c:/dev/i2c-1:0x40
    headrace: vehicle.toml:18: sensors[1].connect: there is no port; allowed is tcp:192.168.0.5:4040
    headrace: vehicle.toml:25: sensors[2].connect: baud="fast" must be a whole number from 1 to 12000000; allowed is serial:/dev/serial/by-id/NAME?baud=115200 or serial:usb:0403:6001:A10K
    headrace: vehicle.toml:32: sensors[3].connect: a device of this kind cannot use can:; it can use tcp:, serial: or udp:
    headrace: vehicle.toml:39: sensors[4].connect: there is no product id; allowed is hid:VID:PID[:SERIAL] with four hexadecimal digits each, hid:1209:0001
    headrace: vehicle.toml:46: sensors[5].connect: address "0x99" must be 0x08 to 0x77; allowed is i2c:/dev/i2c-1:0x40
    headrace: warning: vehicle.toml:9: sensors: have no connect, so `run` can't reach them: empty
    "#);
}

#[test]
fn wrong_or_missing_ports_are_reported_while_the_dive_goes_on() {
    let folder = Folder::new();
    let end = End::tcp();
    let place = end.connect().to_string();
    let device = Faulty::start(vec![emulated(HEAD)], end, Box::new(Healthy));
    let sensors: Vec<_> = [("head", HEAD, place.as_str())].into_iter().chain(WRONG).chain(ABSENT).collect();
    folder.write("vehicle.toml", vehicle(&sensors[..=WRONG.len()]));
    let (answer, wrong) = folder.dive_until(&RUN_UNTIL, first_runs);
    // A dive with only a head has no position, so it exits with 1.
    assert_eq!(answer.code, Some(1), "{}{}", answer.stdout, answer.stderr);
    let few: Vec<_> = sensors[..1].iter().chain(&ABSENT).copied().collect();
    folder.write("vehicle.toml", vehicle(&few));
    let (second, absent) = folder.dive_until(&RUN_UNTIL, first_runs);
    assert_eq!(second.code, Some(1), "{}{}", second.stdout, second.stderr);
    drop(device);
    for report in [&wrong, &absent] {
        let head = &report["sources"][0];
        assert!(head["readings"].as_u64().unwrap() > 0 && head["line"]["opened"] == 1, "{head}");
        for source in &report["sources"].as_array().unwrap()[1..] {
            assert_eq!((&source["packets"], &source["line"]["opened"]), (&0.into(), &0.into()), "{source}");
        }
        for status in statuses(report).lines() {
            let said = status.split_once(": ").unwrap().1;
            assert!(answer.stdout.contains(said) || report == &absent, "{said:?} isn't in {}", answer.stdout);
        }
    }
    insta::assert_snapshot!(statuses(&wrong), @r#"
    head: running: Imagenex 881 family, head 0x10
    no_colon: closed: connect = "192.168.0.5": there is no colon; allowed are serial:/dev/serial/by-id/NAME?baud=115200, serial:usb:VID:PID[:SERIAL]?baud=115200, tcp:HOST:PORT, udp:HOST:PORT, udp-listen:ADDRESS:PORT, can:INTERFACE, hid:VID:PID[:SERIAL], i2c:/dev/i2c-1:0x40
    no_port: closed: connect = "tcp:192.168.0.5": there is no port; allowed is tcp:192.168.0.5:4040
    baud: closed: connect = "serial:/dev/ttyUSB0?baud=fast": baud="fast" must be a whole number from 1 to 12000000; allowed is serial:/dev/serial/by-id/NAME?baud=115200 or serial:usb:0403:6001:A10K
    carrier: closed: connect = "can:can0": a device of this kind cannot use can:; it can use tcp:, serial: or udp:
    product: closed: connect = "hid:1209": there is no product id; allowed is hid:VID:PID[:SERIAL] with four hexadecimal digits each, hid:1209:0001
    address: closed: connect = "i2c:/dev/i2c-1:0x99": address "0x99" must be 0x08 to 0x77; allowed is i2c:/dev/i2c-1:0x40
    empty: closed: connect = "": it is empty; allowed are serial:/dev/serial/by-id/NAME?baud=115200, serial:usb:VID:PID[:SERIAL]?baud=115200, tcp:HOST:PORT, udp:HOST:PORT, udp-listen:ADDRESS:PORT, can:INTERFACE, hid:VID:PID[:SERIAL], i2c:/dev/i2c-1:0x40
    "#);
    // A kernel without CAN gives another message, which is replaced here by the message of a kernel with CAN.
    let absent = statuses(&absent).replace(
        "this kernel has no CAN; sudo modprobe can-raw",
        "there is no such interface; plug the adapter in; ip link lists the interfaces",
    );
    insta::assert_snapshot!(absent, @r#"
    head: running: Imagenex 881 family, head 0x10
    adapter: closed: opening /dev/serial/by-id/usb-headrace-none: there is no such port; plug it in, or run headrace devices
    usb: closed: looking for serial:usb:1209:fffe:none: no such device is plugged in; headrace devices lists those that are
    counter: closed: looking for hid:1209:fffe:none: no such device is plugged in; headrace devices lists those that are
    imu: closed: opening none77: there is no such CAN interface; plug the adapter in; ip link lists the interfaces
    "#);
}

#[test]
fn dive_without_any_sensor_fails_with_each_reason() {
    let folder = Folder::new();
    folder.write("vehicle.toml", vehicle(&ABSENT));
    let answer = folder.headrace(&RUN);
    assert_eq!(answer.code, Some(1), "{}{}", answer.stdout, answer.stderr);
    for (id, ..) in ABSENT {
        assert!(answer.stdout.contains(&format!("SENSOR     {id} closed: ")), "{}", answer.stdout);
    }
}

/// Waits for the end of a dive with a blocked terminal. The time limit is ten times as long as the program itself waits
/// for the terminal.
fn ends_and_reports(mut run: Running, folder: &Folder) {
    let code = (0..300).find_map(|_| {
        std::thread::sleep(Duration::from_millis(100));
        run.0.try_wait().unwrap()
    });
    assert_eq!(code.map(|status| status.code()), Some(Some(1)), "it ends by itself");
    assert_eq!(report(folder)["sources"].as_array().unwrap().len(), ABSENT.len());
}

#[test]
fn dive_ends_even_if_the_terminal_is_blocked_from_the_start() {
    let folder = Folder::new();
    folder.write("vehicle.toml", vehicle(&ABSENT));
    let full = Terminal::open(100);
    full.fill();
    let mut run = headrace_tests::program();
    run.args(RUN).arg("--page=127.0.0.1:0").current_dir(folder.path("")).env("TERM", "xterm");
    let run = run.stdin(full.end()).stdout(full.end()).stderr(full.end()).spawn().unwrap();
    ends_and_reports(Running(run), &folder);
}

#[test]
fn dive_ends_even_if_the_terminal_blocks_in_the_middle_of_a_screen() {
    let folder = Folder::new();
    folder.write("vehicle.toml", vehicle(&ABSENT));
    let mut terminal = Terminal::open(100);
    let mut run = headrace_tests::program();
    run.args(RUN).arg("--tui").current_dir(folder.path("")).env("TERM", "xterm");
    let run = run.stdin(terminal.end()).stdout(terminal.end()).stderr(terminal.end()).spawn().unwrap();
    terminal.read_until("ALERTS");
    terminal.fill();
    ends_and_reports(Running(run), &folder);
}

/// Size of a pipe, bytes. Source: pipe(7), "Pipe capacity".
const PIPE: usize = 1 << 16;

#[test]
fn dive_ends_even_if_its_output_pipe_blocks_at_any_byte() {
    let folder = Folder::new();
    folder.write("vehicle.toml", vehicle(&ABSENT));
    let whole = folder.headrace(&RUN).stdout.len();
    assert!((200..PIPE).contains(&whole), "{whole} bytes");
    // The numbers are the free bytes in the pipe. With no free bytes, the pipe is full from the start. In the other
    // cases, it becomes full in the middle of the output, and in the last case during the summary.
    let lines = [0, whole - 150, whole - 100, whole - 50, whole - 10].map(|room| ("", room));
    let json = ["--json", "--json-lines"].map(|how| (how, 0));
    let runs = lines.into_iter().chain(json).map(|(how, room)| {
        let folder = Folder::new();
        folder.write("vehicle.toml", vehicle(&ABSENT));
        let (unread, mut pipe) = std::io::pipe().unwrap();
        pipe.write_all(&vec![b'x'; PIPE - room]).unwrap();
        let mut run = headrace_tests::program();
        run.args(RUN).args([how].iter().filter(|how| !how.is_empty())).current_dir(folder.path(""));
        let run = Running(run.stdin(Stdio::null()).stdout(pipe).stderr(Stdio::null()).spawn().unwrap());
        (run, unread, folder)
    });
    for (run, _unread, folder) in runs.collect::<Vec<_>>() {
        ends_and_reports(run, &folder);
    }
}

#[test]
fn unavailable_required_sensor_ends_the_dive() {
    let folder = Folder::new();
    let sensors: Vec<_> = WRONG[..1].iter().chain(&ABSENT).copied().collect();
    folder.write("vehicle.toml", vehicle(&sensors));
    let refused = |required: &str, code: i32| {
        let within = ["--require", required, "--require-within", "1", "--report", "report.json"];
        let answer = folder.headrace(&[&["run", "vehicle.toml", "--no-record"], &within[..]].concat());
        assert_eq!(answer.code, Some(code), "{required}: {}{}", answer.stdout, answer.stderr);
        answer.stderr
    };
    let mut said = refused("sonar", 2) + &refused("no_colon", 2) + &refused("all", 2);
    assert!(!folder.path("report.json").exists(), "no dive has begun");
    said += &refused("adapter", 1);
    assert!(folder.path("report.json").exists(), "a dive that ends must leave a report");
    insta::assert_snapshot!(said, @r#"
    headrace: --require sonar: no such sensor; expected all, or ids of no_colon, adapter, usb, counter, imu
    headrace: sensor "no_colon" is required: connect = "192.168.0.5": there is no colon; allowed are serial:/dev/serial/by-id/NAME?baud=115200, serial:usb:VID:PID[:SERIAL]?baud=115200, tcp:HOST:PORT, udp:HOST:PORT, udp-listen:ADDRESS:PORT, can:INTERFACE, hid:VID:PID[:SERIAL], i2c:/dev/i2c-1:0x40
    headrace: sensor "no_colon" is required: connect = "192.168.0.5": there is no colon; allowed are serial:/dev/serial/by-id/NAME?baud=115200, serial:usb:VID:PID[:SERIAL]?baud=115200, tcp:HOST:PORT, udp:HOST:PORT, udp-listen:ADDRESS:PORT, can:INTERFACE, hid:VID:PID[:SERIAL], i2c:/dev/i2c-1:0x40
    headrace: required sensor "adapter" wasn't running within 1 s: opening /dev/serial/by-id/usb-headrace-none: there is no such port; plug it in, or run headrace devices
    "#);
}

/// A device that sends too short HID reports, as a counter of another maker may do.
struct Short;

impl Fault for Short {
    fn to_host(&mut self, _: u64, frame: &[u8], line: &mut Wire) {
        line.part(&frame[..5]);
    }
}

#[test]
fn hid_reports_shorter_than_configured_are_flagged_as_wrong() {
    let folder = Folder::new();
    let end = End::udp();
    folder.write("vehicle.toml", vehicle(&[("counter", COUNTER, &end.connect().to_string())]));
    let device = Faulty::start(vec![emulated(COUNTER)], end, Box::new(Short));
    let says_wrong = |report: &Value| statuses(report).contains(": wrong");
    let (answer, report) = folder.dive_until(&RUN_UNTIL, says_wrong);
    drop(device);
    assert_eq!(answer.code, Some(1), "{}", answer.stderr);
    assert_eq!(report["sources"][0]["readings"], 0);
    insta::assert_snapshot!(statuses(&report), @r#"
    counter: wrong: sends reports of 5 bytes; report_bytes says 11
    "#);
}

#[test]
fn live_log_contains_sent_bytes_and_replays_to_the_same_digest() {
    let folder = Folder::new();
    let (head, counter) = (End::tcp(), End::udp());
    let places = [head.connect().to_string(), counter.connect().to_string()];
    folder.write("vehicle.toml", vehicle(&[("head", HEAD, &places[0]), ("counter", COUNTER, &places[1])]));
    let devices = [
        Faulty::start(vec![emulated(HEAD)], head, Box::new(Healthy)),
        Faulty::start(vec![emulated(COUNTER)], counter, Box::new(Healthy)),
    ];
    let recorded = ["vehicle.toml", "--record", "dive.mcap", "--require", "all"];
    let (answer, live) = folder.dive_until(&recorded, first_runs);
    drop(devices);
    // A dive without an inertial unit has no position, so it exits with 1.
    assert_eq!(answer.code, Some(1), "{}{}", answer.stdout, answer.stderr);
    let (code, replayed) = folder.replay("dive.mcap", &[]);
    assert_eq!((code, &replayed["digest"]), (Some(1), &live["digest"]));
    let log = folder.read("dive.mcap");
    let all = MessageStream::new(&log).unwrap().map(Result::unwrap);
    let sent: Vec<_> = all.filter(|message| message.channel.topic.starts_with("/sent/")).collect();
    assert!(sent.iter().all(|message| message.channel.topic == "/sent/head" && message.data.len() == 27));
    let answers = raw_messages(&log).iter().filter(|message| message.channel.topic == "/raw/head").count();
    assert!(answers > 10 && sent.len() >= answers, "{} sent, {answers} answers", sent.len());
}
