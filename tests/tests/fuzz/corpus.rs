//! Intact files of each kind: small headrace logs, and files in foreign formats.

use std::collections::BTreeMap;
use std::io::Cursor;

use headrace_a50::report::{Against, Velocity};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_mavlink::MavHeader;
use headrace_mavlink::dialect::ATTITUDE_DATA;
use headrace_mavlink::message::Message;
use headrace_replay::log::{LogHeader, LogWriter, SourceInfo};
use headrace_sensor::device::Direction;
use headrace_simulator::Simulation;
use headrace_tests::random::Random;
use mcap::{Compression, WriteOptions};

use crate::messages::{Said, said};
use crate::mutate::broken;

/// Start time of the logs.
const BEGIN: MonoNs = MonoNs(1_000_000_000);

/// Lowest sensor number of the second vehicle (see `Surroundings::vehicles`).
pub(crate) const OTHERS: u8 = 128;

/// Kind of a file. It determines which reader gets the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Kind {
    Log,
    Tlog,
    Candump,
    Imagenex,
    Ping,
    A50,
    Csv,
    Bag,
    Mcap,
    Vehicle,
    Scene,
    /// Data of a device: the number of its sensor, a random seed for splitting the data into pieces, and the device's
    /// bytes.
    Line,
    /// A packet with an operator's command.
    Console,
    /// A message that a viewer of the operator's page sends to the server.
    Viewer,
}

const KINDS: [(Kind, &str); 14] = [
    (Kind::Log, "log"),
    (Kind::Tlog, "tlog"),
    (Kind::Candump, "candump"),
    (Kind::Imagenex, "imagenex"),
    (Kind::Ping, "ping"),
    (Kind::A50, "a50"),
    (Kind::Csv, "csv"),
    (Kind::Bag, "bag"),
    (Kind::Mcap, "mcap"),
    (Kind::Vehicle, "vehicle"),
    (Kind::Scene, "scene"),
    (Kind::Line, "line"),
    (Kind::Console, "console"),
    (Kind::Viewer, "viewer"),
];

impl Kind {
    pub(crate) fn name(self) -> &'static str {
        KINDS.iter().find(|(kind, _)| *kind == self).map_or("", |(_, name)| name)
    }

    pub(crate) fn named(name: &str) -> Option<Self> {
        KINDS.iter().find(|(_, known)| *known == name).map(|(kind, _)| *kind)
    }
}

pub(crate) struct File {
    pub(crate) kind: Kind,
    pub(crate) bytes: Vec<u8>,
}

pub(crate) struct Corpus {
    pub(crate) files: Vec<File>,
    /// Messages of each intact log. If a reader reports no loss in a damaged log, it must still have read all messages
    /// of one of these logs.
    pub(crate) said: Vec<Said>,
}

impl Corpus {
    pub(crate) fn new() -> Self {
        let mut files = Vec::new();
        let mut add = |kind, bytes| files.push(File { kind, bytes });
        // Headrace logs are three times as frequent as foreign files, because headrace logs must never lose data
        // silently.
        for messages in [12, 60] {
            add(Kind::Log, ours(messages));
            add(
                Kind::Log,
                foreign(messages, |options| {
                    options.compression(Some(Compression::Lz4)).chunk_size(Some(300))
                }),
            );
            add(Kind::Log, foreign(messages, |options| options.compression(None).chunk_size(Some(500))));
            add(Kind::Log, foreign(messages, |options| options.use_chunks(false)));
        }
        let telemetry = (0..40).flat_map(|n: u8| {
            [(1_600_000_000_000_000 + u64::from(n) * 1000).to_be_bytes().to_vec(), frame(n)].concat()
        });
        add(Kind::Tlog, telemetry.collect());
        let line =
            |n: u32| format!("(1436509052.{:06}) can0 {:03X}#2A366C2B{:02X}\n", n * 1000, 0x21 + n % 4, n);
        add(Kind::Candump, (0..60).map(line).collect::<String>().into_bytes());
        add(Kind::Imagenex, (10..30).flat_map(shot).collect());
        add(Kind::Ping, ping_log(20));
        add(Kind::A50, (0..10).flat_map(velocity).collect());
        add(Kind::Csv, fixture("values.csv")[..3000].to_vec());
        add(Kind::Csv, fixture("heads.csv"));
        for name in ["none.bag", "lz4.bag", "bz2.bag"] {
            add(Kind::Bag, fixture(name));
        }
        for name in ["humble.mcap", "jazzy.mcap"] {
            add(Kind::Mcap, fixture(name));
        }
        add(Kind::Vehicle, headrace_tests::VEHICLE.into());
        add(Kind::Vehicle, headrace_tests::other_vehicle().into_bytes());
        let demo = include_str!("../../../deploy/scenes/rehearsal.toml");
        add(Kind::Scene, demo.replace("../vehicles/vita2-4.toml", "vehicle.toml").into_bytes());
        add(Kind::Scene, headrace_tests::SCENE.into());
        for line in lines() {
            add(Kind::Line, line);
        }
        for command in COMMANDS {
            add(Kind::Console, command.into());
            add(Kind::Viewer, command.into());
        }
        for request in REQUESTS {
            add(Kind::Viewer, request.into());
        }
        let said = files
            .iter()
            .filter(|file| file.kind == Kind::Log)
            .map(|file| said(&file.bytes).unwrap().0)
            .collect();
        Self { files, said }
    }

    /// Returns a randomly damaged version of one of the intact files.
    pub(crate) fn mutant(&self, random: &mut Random) -> (Kind, Vec<u8>) {
        let file = &self.files[random.below(self.files.len())];
        let others: Vec<&File> =
            self.files.iter().filter(|other| other.kind == file.kind || random.below(20) == 0).collect();
        let other = others[random.below(others.len())];
        (file.kind, broken(random, &file.bytes, &other.bytes))
    }
}

const COMMANDS: [&str; 4] = [
    r#"{"do":"acknowledge","alert":12,"by":"AB"}"#,
    r#"{"do":"silence","by":"AB"}"#,
    r#"{"do":"note","text":"a leak \u00fc at 9:30 \\ \"there\"","by":"AB"}"#,
    r#"{"do":"mark","by":"AB"}"#,
];

const REQUESTS: [&str; 3] = [
    r#"{"do":"play","command":"seek","speed":null,"to_s":4.5}"#,
    r#"{"do":"play","command":"speed","speed":12.5}"#,
    r#"{"do":"rate","hz":1}"#,
];

/// Bytes that each device of the two test vehicles sends in the first seconds of a short dive.
fn lines() -> Vec<Vec<u8>> {
    let mut found = Vec::new();
    for (text, first) in [(headrace_tests::VEHICLE.to_owned(), 0), (headrace_tests::other_vehicle(), OTHERS)]
    {
        let scene =
            headrace_tests::scenes::scene_from(headrace_tests::SCENE, &|_| Ok(text.clone().into_bytes()));
        let mut simulation = Simulation::new(&scene).unwrap();
        let mut lines: Vec<Vec<u8>> = (0..scene.vehicle.sensors.len())
            .map(|number| vec![first + u8::try_from(number).unwrap(), 0])
            .collect();
        while let Some(message) = simulation.next_message() {
            let line = &mut lines[usize::from(message.source)];
            if message.direction == Direction::Received && line.len() < 2000 {
                line.extend(message.bytes);
            }
        }
        found.extend(lines);
    }
    found
}

fn fixture(name: &str) -> Vec<u8> {
    std::fs::read(headrace_tests::root().join("tests/ros").join(name)).unwrap()
}

/// Content of test message `number`: both its bytes and its length depend on the number.
fn content(number: u64) -> Vec<u8> {
    let mut random = Random(number);
    (0..=number % 40).map(|_| random.bits().to_le_bytes()[3]).collect()
}

fn ours(messages: u64) -> Vec<u8> {
    let source = |id: &str| SourceInfo { id: id.to_owned(), ..SourceInfo::default() };
    let header = LogHeader { sources: vec![source("depth"), source("imu")], ..LogHeader::default() };
    let mut log = LogWriter::new(Cursor::new(Vec::new()), &header).unwrap();
    for number in 0..messages {
        // Messages are 40 ms apart, so that the log has several chunks, each of at most half a second.
        let at = BEGIN + DurNs::from_millis(i64::try_from(number * 40).unwrap());
        log.raw(u16::try_from(number % 2).unwrap(), at, at, &content(number)).unwrap();
    }
    log.finish().unwrap().0.into_inner()
}

fn foreign(messages: u64, set: impl FnOnce(WriteOptions) -> WriteOptions) -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    let mut writer = set(WriteOptions::new().profile("")).create(&mut file).unwrap();
    let channels =
        ["/raw/depth", "/raw/imu"].map(|topic| writer.add_channel(0, topic, "", &BTreeMap::new()).unwrap());
    for number in 0..messages {
        let log_time = BEGIN.0 + number * 40_000_000;
        let channel_id = channels[usize::try_from(number % 2).unwrap()];
        let sequence = u32::try_from(number).unwrap();
        let head = mcap::records::MessageHeader { channel_id, sequence, log_time, publish_time: log_time };
        writer.write_to_known_channel(&head, &content(number)).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    file.into_inner()
}

fn frame(sequence: u8) -> Vec<u8> {
    // The last field isn't zero, because MAVLink drops trailing zeros, but all 28 bytes must be sent.
    let attitude = ATTITUDE_DATA { yawspeed: 1.0, ..ATTITUDE_DATA::DEFAULT };
    let frame = Message::Attitude(attitude).to_frame(MavHeader { system_id: 1, component_id: 1, sequence });
    frame.raw_bytes().to_vec()
}

fn text(text: &str) -> Vec<u8> {
    let units: Vec<u8> = text.encode_utf16().flat_map(u16::to_be_bytes).collect();
    [&u32::try_from(units.len()).unwrap().to_be_bytes()[..], &units].concat()
}

fn ping_log(records: u32) -> Vec<u8> {
    let mut file = [text("PingViewer sensor log file"), 1_u32.to_be_bytes().to_vec()].concat();
    for words in ["abc", "2024-01-01", "v2.4", "Linux", "12"] {
        file.extend(text(words));
    }
    file.extend([0, 0, 0, 1, 0, 0, 0, 1]);
    for number in 0..records {
        file.extend(text(&format!("23:59:5{}.{:03}", number % 10, number)));
        let message = content(u64::from(number));
        file.extend(u32::try_from(message.len()).unwrap().to_be_bytes());
        file.extend(message);
    }
    file
}

fn velocity(number: i64) -> Vec<u8> {
    let at_us = 1_700_000_000_000_000 + number * 200_000;
    Velocity {
        against: Against::Bottom,
        velocity_mps: [0.1, 0.2, 0.3],
        fom_mps: 0.002,
        altitude_m: 1.5,
        valid_beams: 4,
        is_valid: true,
        status: 0,
        times_us: Some([at_us, at_us + 100_000]),
    }
    .encode()
}

fn shot(seconds: u8) -> Vec<u8> {
    let mut shot = vec![0; 128];
    shot[..8].copy_from_slice(b"81A\0\0\x80\0\x0D");
    shot[8..19].copy_from_slice(b"18-Nov-2016");
    shot[20..32].copy_from_slice(format!("19:29:{seconds:02}\0.17").as_bytes());
    shot[100] = b'I';
    shot
}
