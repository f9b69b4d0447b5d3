//! The driver with an emulated device on a lossy line. No port and no clock are used.

use headrace_sensor::device::{Emulator as _, EmulatorSetup};
use headrace_sensor::geometry::site::Site;
use headrace_sensor::measurement::Sounding;

use super::*;
use crate::emulator::PingEmulator;
use crate::settings::tests::settings;

const LATENCY: DurNs = DurNs::from_millis(20);

/// A driver, an emulated echosounder and the simulated line between them.
struct Rig {
    driver: PingDriver,
    device: PingEmulator,
    now: MonoNs,
    line: Vec<(MonoNs, Vec<u8>)>,
    sent: Vec<Message>,
    heard: Vec<(MonoNs, Message)>,
    /// n, if every n-th message from the host is lost; 0 if none is lost.
    loses: usize,
    /// Index of one message from the host that is lost in addition.
    loses_only: Option<usize>,
}

#[derive(Default)]
struct Ends {
    sent: Vec<Vec<u8>>,
    heard: Vec<(MonoNs, Vec<u8>)>,
}

impl Wire for Ends {
    fn send(&mut self, bytes: &[u8]) {
        self.sent.push(bytes.to_vec());
    }

    fn exchange(&mut self, _: &[u8], _: DurNs, _: usize) {
        panic!("an echosounder is on no bus");
    }

    fn deliver(&mut self, received: MonoNs, bytes: &[u8]) {
        self.heard.push((received, bytes.to_vec()));
    }
}

fn message(bytes: &[u8]) -> Message {
    Message::decode(&Frame::parse(bytes).unwrap()).unwrap()
}

impl Rig {
    fn new(text: &str, loses: usize) -> Self {
        let settings = settings(text).unwrap();
        let now = MonoNs(1_000_000_000);
        let setup = EmulatorSetup { start: now, head: None, site: Site::default(), polled: false };
        let device = PingEmulator::new(settings, LATENCY, &setup);
        let (line, sent, heard) = (Vec::new(), Vec::new(), Vec::new());
        Self { driver: PingDriver::new(settings), device, now, line, sent, heard, loses, loses_only: None }
    }

    fn drive(&mut self, call: impl FnOnce(&mut PingDriver, MonoNs, &mut dyn Wire)) {
        let mut ends = Ends::default();
        call(&mut self.driver, self.now, &mut ends);
        self.heard.extend(ends.heard.iter().map(|(at, bytes)| (*at, message(bytes))));
        for bytes in ends.sent {
            self.sent.push(message(&bytes));
            let lost = self.loses_only == Some(self.sent.len());
            if !lost && (self.loses == 0 || !self.sent.len().is_multiple_of(self.loses)) {
                let line = &mut self.line;
                self.device.hear(self.now, &bytes, &mut |_, at, bytes| line.push((at, bytes.to_vec())));
            }
        }
    }

    /// Executes the pings that are due, with the wall at 4 m.
    fn ping(&mut self) {
        let mut due = Vec::new();
        self.device.begin(self.now + DurNs(1), &mut due);
        for sounding in due {
            let heard = Sounding { range_m: Some(4.0), ..sounding };
            let line = &mut self.line;
            self.device.tell(&heard, &mut |_, at, bytes| line.push((at, bytes.to_vec())));
        }
        self.line.sort_by_key(|(at, _)| *at);
    }

    fn run(&mut self, seconds: f64) {
        let until = self.now + DurNs::from_secs_f64(seconds);
        if self.sent.is_empty() {
            self.drive(|driver, now, wire| driver.opened(now, wire));
        }
        while self.now < until {
            self.ping();
            if self.line.first().is_some_and(|(at, _)| *at <= self.now) {
                let (_, bytes) = self.line.remove(0);
                self.drive(|driver, now, wire| driver.heard(now, &bytes, wire));
            } else if self.driver.due().is_some_and(|due| due <= self.now) {
                self.drive(|driver, now, wire| driver.wake(now, wire));
            } else {
                self.now = self.now + DurNs::from_millis(1);
            }
        }
    }

    fn distances(&self) -> usize {
        let tells = |m: &Message| matches!(m, Message::Distance(_) | Message::Profile(_));
        self.heard.iter().filter(|(_, message)| tells(message)).count()
    }
}

#[test]
fn driver_sends_settings_once_and_requests_a_distance_each_interval() {
    let mut rig = Rig::new("interval_ms = 50\nsound_speed_mps = 1447\nscan_m = 8\ngain = 2", 0);
    rig.run(10.0);
    assert!((190..=200).contains(&rig.distances()), "{}", rig.distances());
    let said = |wanted: &Message| rig.sent.iter().filter(|sent| *sent == wanted).count();
    assert_eq!(said(&Message::SetSpeedOfSound(1_447_000)), 1);
    assert_eq!(said(&Message::SetPingInterval(50)), 1);
    assert_eq!(said(&Message::SetModeAuto(false)), 1);
    assert_eq!(said(&Message::SetRange(crate::codec::ScanRange { start_mm: 0, length_mm: 8000 })), 1);
    assert_eq!(said(&Message::SetGain(2)), 1);
    assert_eq!(said(&Message::SetPingEnable(true)), 1);
    assert!(rig.heard.iter().all(|(_, message)| !matches!(message, Message::Nack { .. })));
    let standing = rig.driver.health();
    assert_eq!(standing.identity.as_deref(), Some("Ping echosounder, revision 1, firmware 3.29.0"));
    assert_eq!(standing.complaint, None);
}

#[test]
fn continuous_device_is_started_once_and_not_polled() {
    let mut rig = Rig::new("polling = \"continuous\"\ninterval_ms = 50", 0);
    rig.run(10.0);
    assert!((190..=200).contains(&rig.distances()), "{}", rig.distances());
    assert!(!rig.sent.contains(&Message::GeneralRequest(id::DISTANCE)));
}

#[test]
fn lossy_line_still_gives_180_distances_in_20_s() {
    let mut rig = Rig::new("interval_ms = 50", 7);
    rig.run(20.0);
    assert!(rig.distances() > 180, "{}", rig.distances());
}

#[test]
fn lost_setting_is_sent_again() {
    for lost in 2..12 {
        let mut rig = Rig::new("interval_ms = 50\nsound_speed_mps = 1447\nscan_m = 8\ngain = 2", 0);
        rig.loses_only = Some(lost);
        rig.run(3.0);
        let twice: Vec<_> = rig.sent.windows(2).filter(|two| two[0] == two[1]).collect();
        let is_setting = |message: &Message| *message != Message::GeneralRequest(id::DISTANCE);
        let again = twice.iter().filter(|two| is_setting(&two[0])).count();
        assert_eq!(again, usize::from(is_setting(&rig.sent[lost - 1])), "of the message of number {lost}");
    }
}

#[test]
fn silent_device_still_gets_settings_and_distance_requests() {
    let mut rig = Rig::new("interval_ms = 50", 1);
    rig.run(10.0);
    let said = |wanted: Message| rig.sent.iter().filter(|sent| **sent == wanted).count();
    assert_eq!(said(Message::SetPingEnable(true)), 4);
    assert!(said(Message::GeneralRequest(id::DISTANCE)) > 3);
}

#[test]
fn speed_of_sound_set_by_another_client_is_restored() {
    let mut rig = Rig::new("", 0);
    rig.run(5.0);
    let other = Addressed { source: 0, destination: 1, message: Message::SetSpeedOfSound(1_480_000) };
    rig.device.hear(rig.now, other.encode().unwrap().as_slice(), &mut |_, _, _| ());
    rig.run(12.0);
    assert_eq!(rig.sent.iter().filter(|sent| **sent == Message::SetSpeedOfSound(1_500_000)).count(), 2);
}

#[test]
fn wrong_device_on_the_line_is_reported() {
    let mut rig = Rig::new("", 0);
    rig.drive(|driver, now, wire| driver.opened(now, wire));
    let device = DeviceInformation {
        device_type: 2,
        revision: 1,
        firmware_major: 3,
        firmware_minor: 3,
        firmware_patch: 0,
        reserved: 0,
    };
    let says = Addressed { source: 2, destination: 0, message: Message::DeviceInformation(device) };
    let bytes = says.encode().unwrap();
    rig.drive(|driver, now, wire| driver.heard(now, bytes.as_slice(), wire));
    assert!(rig.driver.health().complaint.unwrap().contains("Ping360"));
}
