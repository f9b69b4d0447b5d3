//! Devices on real ports with faulty lines: unplugged, garbled, stalled, or connected to the wrong device.
//!
//! Every frame that arrives complete is used. After the fault, the device is used again without help. The fault is
//! reported in words, and no other sensor is disturbed.

use std::os::unix::fs::PermissionsExt as _;

use headrace_ports::Phase;
use headrace_tests::Folder;
use headrace_tests::faulty::{End, Fault, Healthy, Wire};
use headrace_tests::garbling::{EachFrame, Garbled, flipped, of_head, of_ping, thinned};
use headrace_tests::random::Random;
use headrace_tests::rig::{COUNTER, DEPTH, HEAD, PING, Rig, Sensor};

/// A sensor on a line without faults. The faults of other sensors must not disturb it.
fn healthy() -> Sensor {
    Sensor { text: COUNTER, end: End::udp(), fault: Box::new(Healthy) }
}

fn sensor(text: &'static str, end: End, fault: impl Fault + 'static) -> Sensor {
    Sensor { text, end, fault: Box::new(fault) }
}

/// Starts of statuses that a sensor without faults may have if the machine is busy. The tests ignore such statuses.
const OF_A_BUSY_MACHINE: [&str; 3] = [
    "wrong: can't keep up with",
    "wrong: falls behind because replies are lost",
    "silent: the line is open, but no frame has arrived yet",
];

/// Distinct statuses of a sensor as text, except "running" and statuses due to a busy machine.
fn words(said: &[String]) -> String {
    let mut all: Vec<String> = Vec::new();
    for status in said {
        // An unplugged port gives different messages when it is read and when it is written, and either message may
        // come first.
        let status = status.replace("the port is gone", "Broken pipe");
        let is_news = status != "running" && !OF_A_BUSY_MACHINE.iter().any(|begin| status.starts_with(begin));
        if is_news && !all.contains(&status) {
            all.push(status);
        }
    }
    all.join("\n")
}

/// Unplugs a device when the next request arrives, waits until it is reported missing, plugs it in, and waits until it
/// is used again. Does all this twice, and returns the statuses.
fn unplugged_and_plugged_in(text: &'static str, end: End, name: &str) -> String {
    let folder = Folder::new();
    let log = folder.path(&format!("{name}.mcap"));
    let mut rig = Rig::recorded(vec![sensor(text, end, Healthy), healthy()], Some(&log));
    for _ in 0..2 {
        rig.until("it runs", |view| view.phases[0] == Some(Phase::Running));
        rig.more(0, 20);
        rig.control(0).unplug();
        rig.says(0, "opening <place>");
        rig.control(0).plug();
        rig.more(0, 20);
        rig.until("it runs", |view| view.phases[0] == Some(Phase::Running));
    }
    rig.more(1, 20);
    let ended = rig.end();
    ended.all_used();
    ended.untroubled(1);
    assert!(ended.lines[0].lost >= 2 && ended.lines[0].opened >= 3, "{:?}", ended.lines[0]);
    words(&ended.view.said[0])
}

#[test]
fn replugged_serial_device_is_used_again_under_its_stable_name() {
    let folder = Folder::new();
    let end = End::serial(&folder.path(""), "usb-head-port0");
    insta::assert_snapshot!(unplugged_and_plugged_in(HEAD, end, "serial"), @r#"
    running: Imagenex 881 family, head 0x10
    closed: lost <line>: Broken pipe; retrying
    closed: opening <place>: there is no such port; plug it in, or run headrace devices
    "#);
}

#[test]
fn connection_closed_by_the_device_is_reopened() {
    insta::assert_snapshot!(unplugged_and_plugged_in(HEAD, End::tcp(), "tcp"), @r#"
    running: Imagenex 881 family, head 0x10
    closed: lost <line>: the device has closed the connection; retrying
    closed: opening <place>: no device listens there; check that the device is switched on and the port number is right
    "#);
}

#[test]
fn replugged_echosounder_gets_its_settings_again() {
    let folder = Folder::new();
    let end = End::serial(&folder.path(""), "usb-ping-port0");
    insta::assert_snapshot!(unplugged_and_plugged_in(PING, end, "ping"), @r#"
    running: Ping echosounder, revision 1, firmware 3.29.0
    closed: lost <line>: Broken pipe; retrying
    closed: opening <place>: there is no such port; plug it in, or run headrace devices
    "#);
}

#[test]
fn network_device_that_returns_is_used_again() {
    let mut rig = Rig::new(vec![sensor(PING, End::udp(), Healthy), healthy()]);
    rig.more(0, 40);
    rig.control(0).unplug();
    rig.says(0, "lost <line>");
    rig.control(0).plug();
    rig.more(0, 40);
    rig.until("it runs", |view| view.phases[0] == Some(Phase::Running));
    let ended = rig.end();
    ended.all_used();
    ended.untroubled(1);
    insta::assert_snapshot!(words(&ended.view.said[0]), @r#"
    running: Ping echosounder, revision 1, firmware 3.29.0
    closed: lost <line>: no device listens there; retrying
    "#);
}

#[test]
fn device_plugged_in_during_the_dive_is_used() {
    let folder = Folder::new();
    let serial = End::serial(&folder.path(""), "usb-head-port0").absent();
    let sensors = vec![sensor(HEAD, serial, Healthy), sensor(PING, End::tcp().absent(), Healthy), healthy()];
    let mut rig = Rig::new(sensors);
    rig.says(0, "closed");
    rig.says(1, "closed");
    rig.more(2, 20);
    rig.control(0).plug();
    rig.control(1).plug();
    rig.more(0, 20);
    rig.more(1, 20);
    rig.until("they run", |view| view.phases[..2] == [Some(Phase::Running); 2]);
    let ended = rig.end();
    ended.all_used();
    ended.untroubled(2);
    insta::assert_snapshot!(words(&ended.view.said[0]), @r#"
    closed: opening <place>: there is no such port; plug it in, or run headrace devices
    running: Imagenex 881 family, head 0x10
    "#);
    insta::assert_snapshot!(words(&ended.view.said[1]), @r#"
    closed: opening <place>: no device listens there; check that the device is switched on and the port number is right
    running: Ping echosounder, revision 1, firmware 3.29.0
    "#);
}

/// Runs an echosounder and a head on lines that are garbled at first and have no faults later. A third sensor must not
/// be disturbed.
fn garbled(change: fn(&mut Random, &[u8]) -> Vec<u8>) {
    let folder = Folder::new();
    let end = End::serial(&folder.path(""), "usb-ping-port0");
    let sensors = vec![
        sensor(PING, end, Garbled::new(1, of_ping, change)),
        sensor(HEAD, End::tcp(), Garbled::new(2, of_head, change)),
        healthy(),
    ];
    let mut rig = Rig::recorded(sensors, Some(&folder.path("garbled.mcap")));
    rig.more(0, 60);
    rig.more(1, 60);
    rig.control(0).heal();
    rig.control(1).heal();
    rig.more(0, 20);
    rig.more(1, 20);
    rig.until("all run", |view| view.phases == [Some(Phase::Running); 3]);
    let ended = rig.end();
    ended.all_used();
    ended.untroubled(2);
    let bad: Vec<u64> = ended.report.sources.iter().map(|source| source.skipped_bytes).collect();
    assert!(bad[0] > 0 && bad[1] > 0, "nothing was garbled: {bad:?}");
    assert!(ended.lines.iter().all(|line| line.lost == 0), "{:?}", ended.lines);
}

#[test]
fn flipped_bits_lose_only_their_own_frames() {
    garbled(flipped);
}

#[test]
fn lost_bytes_lose_only_their_own_frames() {
    garbled(thinned);
}

/// A line that inserts garbage between frames. The garbage ends with the header of a longer frame, but the rest of that
/// frame never comes.
fn with_bursts(seed: u64, lure: &'static [u8]) -> impl Fault {
    let mut random = Random(seed);
    EachFrame(move |_, frame: &[u8], line: &mut Wire| {
        if random.one_in(3) {
            let count = random.bits() % 300;
            let mut garbage: Vec<u8> = (0..count).map(|_| random.byte()).collect();
            garbage.extend_from_slice(lure);
            line.part(&garbage);
        }
        line.whole(frame);
    })
}

#[test]
fn bursts_of_garbage_lose_no_frame() {
    let folder = Folder::new();
    // The garbage contains headers of long frames: an echosounder profile of 1200 strengths, and a head's return of 500
    // points.
    let end = End::serial(&folder.path(""), "usb-ping-port0");
    let sensors = vec![
        sensor(PING, end, with_bursts(3, b"BR\xCA\x04\x14\x05\x01\x00")),
        sensor(HEAD, End::tcp(), with_bursts(4, b"IGX\x10\x40\x00")),
        healthy(),
    ];
    let mut rig = Rig::recorded(sensors, Some(&folder.path("bursts.mcap")));
    rig.more(0, 60);
    rig.more(1, 60);
    rig.control(0).heal();
    rig.control(1).heal();
    rig.more(0, 10);
    rig.more(1, 10);
    let ended = rig.end();
    ended.all_used();
    ended.untroubled(2);
}

/// A device that stalls in the middle of every third frame. Some stalls are shorter than the usual pause between
/// frames, some are longer, and some last for ever.
fn stalling() -> impl Fault {
    EachFrame(|number, frame: &[u8], line: &mut Wire| {
        let (first, second) = frame.split_at(frame.len() / 2);
        match number % 9 {
            2 => {
                line.part(first);
                Wire::pause(5);
                line.part(second);
                line.count(1);
            }
            5 => {
                line.part(first);
                Wire::pause(300);
                line.part(second);
                line.count(1);
            }
            8 => line.part(first),
            _ => line.whole(frame),
        }
    })
}

#[test]
fn frame_that_stalls_is_lost_only_if_its_rest_never_arrives() {
    let folder = Folder::new();
    let end = End::serial(&folder.path(""), "usb-ping-port0");
    let sensors = vec![sensor(PING, end, stalling()), sensor(HEAD, End::tcp(), stalling()), healthy()];
    let mut rig = Rig::recorded(sensors, Some(&folder.path("stalls.mcap")));
    rig.more(0, 40);
    rig.more(1, 40);
    rig.control(0).heal();
    rig.control(1).heal();
    rig.more(0, 10);
    rig.more(1, 10);
    let ended = rig.end();
    ended.all_used();
    ended.untroubled(2);
}

fn twice() -> impl Fault {
    EachFrame(|_, frame: &[u8], line: &mut Wire| {
        line.whole(frame);
        line.whole(frame);
    })
}

#[test]
fn two_answers_to_one_request_are_two_readings() {
    let sensors = vec![
        sensor(PING, End::tcp(), twice()),
        sensor(HEAD, End::tcp(), twice()),
        sensor(DEPTH, End::udp(), twice()),
        healthy(),
    ];
    let mut rig = Rig::new(sensors);
    for number in 0..3 {
        rig.more(number, 60);
    }
    rig.until("all run", |view| view.phases == [Some(Phase::Running); 4]);
    let ended = rig.end();
    ended.all_used();
    ended.untroubled(3);
    let depth = &ended.report.sources[2];
    assert!(depth.readings > 0, "{depth:?}");
    assert_eq!(depth.withheld, 0, "the calibration is whole before the first measurement: {depth:?}");
}

/// A device that claims to be another device until its fault ends.
struct Disguised(fn(&mut Vec<u8>));

impl Fault for Disguised {
    fn to_host(&mut self, _: u64, frame: &[u8], line: &mut Wire) {
        let mut frame = frame.to_vec();
        (self.0)(&mut frame);
        line.whole(&frame);
    }
}

/// Changes the identity of an echosounder to that of a Ping360.
fn as_ping360(frame: &mut Vec<u8>) {
    use headrace_ping1d::codec::{Addressed, Frame, Message};
    let parsed = Frame::parse(frame).unwrap();
    if let Ok(Message::DeviceInformation(device)) = Message::decode(&parsed) {
        let device = headrace_ping1d::codec::DeviceInformation { device_type: 2, ..device };
        let message = Message::DeviceInformation(device);
        let said = Addressed { source: 1, destination: 0, message };
        *frame = said.encode().unwrap().as_slice().to_vec();
    }
}

#[expect(clippy::ptr_arg, reason = "the replacement must have the same length")]
fn as_head_0x11(frame: &mut Vec<u8>) {
    frame[3] = 0x11;
}

#[test]
fn wrong_device_is_reported_and_the_right_one_used_later() {
    let sensors = vec![
        sensor(PING, End::tcp(), Disguised(as_ping360)),
        sensor(HEAD, End::tcp(), Disguised(as_head_0x11)),
        healthy(),
    ];
    let mut rig = Rig::new(sensors);
    rig.says(0, "wrong");
    rig.says(1, "wrong");
    for number in 0..2 {
        rig.control(number).unplug();
        rig.says(number, "closed");
        rig.control(number).heal();
        rig.control(number).plug();
    }
    rig.until("all run", |view| view.phases == [Some(Phase::Running); 3]);
    rig.more(0, 20);
    rig.more(1, 20);
    let ended = rig.end();
    ended.all_used();
    ended.untroubled(2);
    insta::assert_snapshot!(words(&ended.view.said[0]), @r#"
    wrong: is a Ping360 and not an echosounder; check connect
    closed: lost <line>: the device has closed the connection; retrying
    running: Ping echosounder, revision 1, firmware 3.29.0
    "#);
    insta::assert_snapshot!(words(&ended.view.said[1]), @r#"
    wrong: answers as head 0x11; head_id says 0x10
    closed: lost <line>: the device has closed the connection; retrying
    running: Imagenex 881 family, head 0x10
    "#);
}

/// A device that sends garbage as fast as the line accepts it.
struct Babbling(Random);

impl Fault for Babbling {
    fn to_host(&mut self, _: u64, _: &[u8], _: &mut Wire) {}

    fn meanwhile(&mut self, line: &mut Wire) {
        let block: Vec<u8> = (0..8192).map(|_| self.0.byte()).collect();
        for _ in 0..16 {
            line.part(&block);
        }
    }
}

#[test]
fn babbling_device_does_not_disturb_other_devices() {
    let folder = Folder::new();
    let sensors = vec![sensor(HEAD, End::tcp(), Babbling(Random(5))), healthy()];
    let mut rig = Rig::recorded(sensors, Some(&folder.path("babble.mcap")));
    rig.says(0, "babbling");
    rig.control(0).heal();
    rig.more(0, 40);
    rig.until("all run", |view| view.phases == [Some(Phase::Running); 2]);
    let ended = rig.end_but(Some(0));
    ended.untroubled(1);
    insta::assert_snapshot!(words(&ended.view.said[0]), @r#"
    babbling: bytes arrive, but no frame for 5 s; another device, or another baud rate?
    running: Imagenex 881 family, head 0x10
    "#);
}

#[test]
fn silent_device_is_reported_and_used_when_it_returns() {
    let mut rig = Rig::new(vec![sensor(PING, End::tcp(), Healthy), healthy()]);
    rig.more(0, 20);
    rig.until("it runs", |view| view.phases[0] == Some(Phase::Running));
    rig.control(0).fall_silent();
    rig.says(0, "is it switched on?");
    // The line has been reopened, but the device is still silent.
    rig.until("enough", |view| view.good[1] >= 600);
    assert_ne!(rig.view().phases[0], Some(Phase::Running), "{:?}", rig.view().said[0]);
    rig.control(0).speak();
    rig.more(0, 20);
    rig.until("it runs", |view| view.phases[0] == Some(Phase::Running));
    let ended = rig.end();
    ended.all_used();
    ended.untroubled(1);
    insta::assert_snapshot!(words(&ended.view.said[0]), @r#"
    running: Ping echosounder, revision 1, firmware 3.29.0
    silent: no data for 5 s; is it switched on?
    "#);
}

/// A line that loses the host's first requests.
struct DeafAtFirst(usize);

impl Fault for DeafAtFirst {
    fn to_device(&mut self, bytes: Vec<u8>) -> Vec<u8> {
        if self.0 == 0 {
            return bytes;
        }
        self.0 -= 1;
        Vec::new()
    }
}

/// The drivers of both devices share the line. While one driver waits for an answer that is lost, the other driver
/// sends nothing.
#[test]
fn two_devices_on_one_line_start_although_first_answers_are_lost() {
    let end = End::tcp();
    let beside = End::beside(&end);
    let second = "plugin = \"ping1d\"\ninterval_ms = 50\ndevice_id = 2\n";
    let sensors = vec![sensor(PING, end, DeafAtFirst(3)), sensor(second, beside, Healthy), healthy()];
    let mut rig = Rig::new(sensors);
    rig.more(0, 60);
    rig.until("all run", |view| view.phases == [Some(Phase::Running); 3]);
    let ended = rig.end();
    ended.all_used();
    ended.untroubled(2);
    assert!(ended.lines.iter().all(|line| (line.opened, line.lost) == (1, 0)), "{:?}", ended.lines);
}

#[test]
fn port_without_permission_is_reported_and_used_once_permitted() {
    let folder = Folder::new();
    let end = End::serial(&folder.path(""), "usb-head-port0");
    let port = folder.path("usb-head-port0");
    let allow = |mode| std::fs::set_permissions(&port, std::fs::Permissions::from_mode(mode)).unwrap();
    allow(0o000);
    if std::fs::File::open(&port).is_ok() {
        headrace_tests::skipped("this user may open everything, and so no port is forbidden");
        return;
    }
    let mut rig = Rig::new(vec![sensor(HEAD, end, Healthy), healthy()]);
    rig.says(0, "closed");
    rig.more(1, 20);
    allow(0o600);
    rig.more(0, 20);
    rig.until("it runs", |view| view.phases[0] == Some(Phase::Running));
    let ended = rig.end();
    ended.all_used();
    ended.untroubled(1);
    insta::assert_snapshot!(words(&ended.view.said[0]), @r#"
    closed: opening <place>: this user may not open it; see headrace devices, or allow it to this user: sudo usermod -aG dialout $USER, and log in again
    running: Imagenex 881 family, head 0x10
    "#);
}
