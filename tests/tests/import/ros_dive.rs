//! Validation: a simulated dive is written as a ROS 2 recording and imported. The imported log has the same bytes and
//! times, and its replay gives the same digest.
//!
//! The recording is written by the code in this file.

use std::collections::BTreeMap;
use std::io::Cursor;

use headrace_bar100::calibration::Overrides;
use headrace_bar100::decoder::{Bar100Decoder, DecoderSettings};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_imagenex881::codec::{Header, Model};
use headrace_sensor::device::Decoder as _;
use headrace_sensor::reading::{Packet, Reading};
use headrace_tests::{Folder, raw_messages};
use mcap::{Message, WriteOptions};

/// Plain CDR in little-endian order. Four bytes of encapsulation come first. Numbers are aligned relative to the fifth
/// byte.
struct Cdr(Vec<u8>);

impl Cdr {
    fn new() -> Self {
        Self(vec![0, 1, 0, 0])
    }

    fn number<const N: usize>(mut self, bytes: [u8; N]) -> Self {
        while !(self.0.len() - 4).is_multiple_of(N) {
            self.0.push(0);
        }
        self.0.extend(bytes);
        self
    }

    fn u32(self, value: usize) -> Self {
        self.number(u32::try_from(value).unwrap().to_le_bytes())
    }

    #[expect(clippy::cast_possible_truncation, reason = "the message has single precision")]
    fn f32(self, value: f64) -> Self {
        self.number((value as f32).to_le_bytes())
    }

    fn f64s(self, values: &[f64]) -> Self {
        values.iter().fold(self, |cdr, value| cdr.number(value.to_le_bytes()))
    }

    fn header(self, at_ns: u64, frame: &str) -> Self {
        let mut cdr = self.u32(usize::try_from(at_ns / 1_000_000_000).unwrap());
        cdr = cdr.u32(usize::try_from(at_ns % 1_000_000_000).unwrap()).u32(frame.len() + 1);
        cdr.0.extend(frame.as_bytes());
        cdr.0.push(0);
        cdr
    }
}

/// Topic, type and content of the ROS message that is made of a device's message; `None` if none is made.
type Written = Option<(String, &'static str, Cdr)>;

struct Translator {
    depth: Bar100Decoder,
    imu: [Vec<f64>; 2],
}

impl Translator {
    fn new() -> Self {
        let overrides = Overrides::default();
        let latency = DurNs(0);
        let depth = DecoderSettings { overrides, ambient_bar: 1.013_25, reject_busy: false, latency };
        Self { depth: Bar100Decoder::new(depth), imu: [Vec::new(), Vec::new()] }
    }

    fn written(&mut self, id: &str, at_ns: u64, bytes: &[u8]) -> Written {
        let stamped = Cdr::new().header(at_ns, id);
        match id {
            "depth" => {
                let mut pressure_pa = None;
                let packet = Packet { received: MonoNs(at_ns), bytes };
                self.depth.decode(packet, &mut |decoded| {
                    if let Reading::Pressure(water) = decoded.reading {
                        pressure_pa = Some(water.pressure_pa);
                    }
                });
                let cdr = stamped.f64s(&[pressure_pa?, 0.0]);
                Some(("/depth".to_owned(), "sensor_msgs/msg/FluidPressure", cdr))
            }
            "imu" => {
                let words: Vec<f64> = bytes[8..]
                    .as_chunks()
                    .0
                    .iter()
                    .map(|word| f64::from(i16::from_be_bytes(*word)))
                    .collect();
                let scaled =
                    |unit: f64, count: usize| words[..count].iter().map(|word| word / unit).collect();
                match bytes[0] {
                    0x21 => self.imu[0] = scaled(32_767.0, 4),
                    0x32 => self.imu[1] = scaled(512.0, 3),
                    0x34 => {
                        let force: Vec<f64> = scaled(256.0, 3);
                        let [w, x, y, z] = self.imu[0][..].try_into().unwrap();
                        let nine = [0.0; 9];
                        let cdr = stamped.f64s(&[x, y, z, w]).f64s(&nine).f64s(&self.imu[1]).f64s(&nine);
                        return Some((
                            "/imu".to_owned(),
                            "sensor_msgs/msg/Imu",
                            cdr.f64s(&force).f64s(&nine),
                        ));
                    }
                    _ => (),
                }
                None
            }
            "tether" => {
                let count = i32::from_le_bytes(bytes[3..7].try_into().unwrap());
                let cdr = Cdr::new().f64s(&[f64::from(count) / 2000.0]);
                Some(("/cable".to_owned(), "std_msgs/msg/Float64", cdr))
            }
            id if id.starts_with("ping") => {
                let mm = u32::from_le_bytes(bytes[8..12].try_into().unwrap());
                let range_m = if mm == 0 { f64::INFINITY } else { f64::from(mm) / 1000.0 };
                let cdr = stamped.number([0]).f32(0.4).f32(0.3).f32(100.0).f32(range_m);
                Some((format!("/{id}"), "sensor_msgs/msg/Range", cdr))
            }
            id => {
                let (header, _) = Header::decode(bytes, Some(Model::Head881)).unwrap();
                let angle = (f64::from(header.position) - 600.0) * std::f64::consts::TAU / 1200.0;
                let range_m =
                    header.profile_mm(Model::Head881).map_or(f64::INFINITY, |mm| f64::from(mm) / 1000.0);
                let cdr = [angle, angle, 0.0, 0.0, 0.0, 0.1, 100.0].into_iter().fold(stamped, Cdr::f32);
                let cdr = cdr.u32(1).f32(range_m).u32(0);
                Some((format!("/{id}"), "sensor_msgs/msg/LaserScan", cdr))
            }
        }
    }
}

fn recording(messages: &[Message<'_>]) -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    let mut writer = WriteOptions::new().profile("ros2").create(&mut file).unwrap();
    let mut translator = Translator::new();
    let mut channels = BTreeMap::new();
    for message in messages {
        let id = message.channel.topic.strip_prefix("/raw/").unwrap();
        let Some((topic, of, cdr)) = translator.written(id, message.log_time, &message.data) else {
            continue;
        };
        let channel = *channels.entry(topic.clone()).or_insert_with(|| {
            let schema = writer.add_schema(of, "ros2msg", b"").unwrap();
            writer.add_channel(schema, &topic, "cdr", &BTreeMap::new()).unwrap()
        });
        let (log_time, publish_time) = (message.log_time, message.log_time);
        let head = mcap::records::MessageHeader { channel_id: channel, sequence: 0, log_time, publish_time };
        writer.write_to_known_channel(&head, &cdr.0).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    file.into_inner()
}

#[test]
fn imported_ros_recording_equals_its_original_dive() {
    let folder = Folder::with_dive();
    let dive = folder.read("dive.mcap");
    let messages = raw_messages(&dive);
    folder.write("ros.mcap", recording(&messages));
    let ids = ["depth", "imu", "ping_left", "ping_right", "ping_up", "ping_down", "sonar_0", "sonar_1"];
    let table = |topic: &str, id: &str| format!("[[topics]]\ntopic = \"/{topic}\"\nsensor = \"{id}\"\n");
    // The devices assume a speed of sound of 1500 m/s, but the speed in this water is 1447 m/s.
    let speed = |id: &str| if matches!(id, "depth" | "imu") { "" } else { "sound_speed_mps = 1500\n" };
    let mapping: String = ids.iter().map(|id| table(id, id) + speed(id)).collect();
    folder.write("topics.toml", mapping + &table("cable", "tether"));
    let arguments = ["import", "ros.mcap", "--map", "topics.toml", "--vehicle", "vehicle.toml"];
    let answer = folder.headrace(&[&arguments[..], &["-o", "out.mcap"]].concat());
    assert_eq!((answer.code, answer.stderr.as_str()), (Some(0), ""));
    let imported = folder.read("out.mcap");
    let got = raw_messages(&imported);
    // Messages with equal times may be in any order, so both lists are sorted.
    let shown = |messages: &[Message<'_>]| {
        let mut all: Vec<_> = messages
            .iter()
            .map(|message| {
                (message.log_time, message.channel.topic.clone(), message.sequence, message.data.to_vec())
            })
            .collect();
        all.sort();
        all
    };
    let (got, wanted) = (shown(&got), shown(&messages));
    assert_eq!(got.len(), wanted.len());
    for (got, wanted) in got.iter().zip(&wanted) {
        assert_eq!(got, wanted);
    }
    // The two digests are equal although the original log replays by its ticks, and the imported log by time.
    assert_eq!(folder.digest("out.mcap", &[]), folder.digest("dive.mcap", &[]));
}
