//! What the tests of the binary share: a folder that goes away by itself, a small vehicle and a short dive, what the
//! program answered, and logs written by somebody else.

#![allow(dead_code, reason = "each test takes what it needs of this")]

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicU32, Ordering};

use mcap::{Attachment, Message, MessageStream, WriteOptions};
use serde_json::Value;

/// Two heads in a circular tunnel, with all that gives a position.
pub(crate) const VEHICLE: &str = r#"name = "test vehicle"
target_m = 1.2

[tunnel]
profile = "circle"
radius_m = 3
length_m = 100

[water]
sound_speed_mps = 1447

[heads]
planned_speed_mps = 0.2

[[sensors]]
id = "sonar_0"
plugin = "imagenex881"
connect = "tcp:192.168.0.4:4040"
mode = "fastest"
range_m = 5

[[sensors]]
id = "sonar_1"
plugin = "imagenex881"
connect = "tcp:192.168.0.5:4040"
mode = "fastest"
range_m = 5

[[sensors]]
id = "ping_left"
plugin = "ping1d"
angles_deg = [0, 0, 90]

[[sensors]]
id = "ping_right"
plugin = "ping1d"
angles_deg = [0, 0, -90]

[[sensors]]
id = "ping_up"
plugin = "ping1d"
angles_deg = [0, -90, 0]

[[sensors]]
id = "ping_down"
plugin = "ping1d"
angles_deg = [0, 90, 0]

[[sensors]]
id = "depth"
plugin = "bar100"

[[sensors]]
id = "imu"
plugin = "imu_can"
preset = "xsens_mti600"

[[sensors]]
id = "tether"
plugin = "tether_hid"
counts_per_metre = 2000
"#;

/// Six tables for one line, and a velocity log.
const OTHER_SENSORS: &str = r#"
[[sensors]]
id = "imu"
plugin = "mavlink"
connect = "udp:0.0.0.0:14550"
part = "imu"
rate_hz = 100

[[sensors]]
id = "depth"
plugin = "mavlink"
connect = "udp:0.0.0.0:14550"
part = "pressure"

[[sensors]]
id = "left"
plugin = "mavlink"
connect = "udp:0.0.0.0:14550"
part = "distance"
sensor_id = 1
angles_deg = [0, 0, 90]

[[sensors]]
id = "right"
plugin = "mavlink"
connect = "udp:0.0.0.0:14550"
part = "distance"
sensor_id = 2
angles_deg = [0, 0, -90]

[[sensors]]
id = "up"
plugin = "mavlink"
connect = "udp:0.0.0.0:14550"
part = "distance"
sensor_id = 3
angles_deg = [0, -90, 0]

[[sensors]]
id = "down"
plugin = "mavlink"
connect = "udp:0.0.0.0:14550"
part = "distance"
sensor_id = 4
angles_deg = [0, 90, 0]

[[sensors]]
id = "dvl"
plugin = "a50"
connect = "tcp:192.168.194.95:16171"
position_m = [-0.2, 0.1, -0.1]
angles_deg = [0, 0, 20]

[[sensors]]
id = "tether"
plugin = "tether_hid"
counts_per_metre = 2000
"#;

/// The two heads on a vehicle whose autopilot owns the other sensors.
pub(crate) fn other_vehicle() -> String {
    let heads = VEHICLE.split("[[sensors]]\nid = \"ping_left\"").next().unwrap();
    format!("{heads}{OTHER_SENSORS}")
}

/// Twenty seconds: four metres, some of the last one never seen from both sides.
pub(crate) const SCENE: &str = r#"name = "short dive"
vehicle = "vehicle.toml"

[trajectory]
start_m = 3

[[trajectory.legs]]
distance_m = 4
speed_mps = 0.2
"#;

/// A new folder for one test, removed with all that is in it. Commands run in it, so that messages name files alone.
pub(crate) struct Folder(PathBuf);

/// What the program answered.
pub(crate) struct Answer {
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl Folder {
    pub(crate) fn new() -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let name = format!("headrace-test-{}-{}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
        let path = std::env::temp_dir().join(name);
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    /// A folder with the short dive: `vehicle.toml`, `scene.toml` and `dive.mcap`.
    pub(crate) fn with_dive() -> Self {
        let folder = Self::new();
        folder.write("vehicle.toml", VEHICLE);
        folder.write("scene.toml", SCENE);
        folder.simulate("scene.toml", "dive.mcap");
        folder
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    pub(crate) fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), content).unwrap();
    }

    pub(crate) fn read(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap()
    }

    /// Runs the binary in this folder.
    pub(crate) fn headrace(&self, arguments: &[&str]) -> Answer {
        let output = Command::new(env!("CARGO_BIN_EXE_headrace"))
            .args(arguments)
            .current_dir(&self.0)
            .output()
            .unwrap();
        let text = |bytes| String::from_utf8(bytes).unwrap();
        Answer { code: output.status.code(), stdout: text(output.stdout), stderr: text(output.stderr) }
    }

    pub(crate) fn simulate(&self, scene: &str, log: &str) {
        let answer = self.headrace(&["simulate", scene, "-o", log]);
        assert_eq!(answer.code, Some(0), "{}", answer.stderr);
    }

    /// Dives a log of `vehicle.toml` as if it came from ports, as fast as it can, and records it; what the program answered.
    #[track_caller]
    pub(crate) fn record(&self, from: &str, to: &str, further: &[&str]) -> Answer {
        let arguments = ["run", "vehicle.toml", "--source", from, "--record", to, "--speed", "max"];
        let answer = self.headrace(&[&arguments[..], further].concat());
        assert_eq!(answer.code, Some(0), "{}", answer.stderr);
        answer
    }

    /// `scene.toml` is refused: exit code 2, these words, and no log.
    #[track_caller]
    pub(crate) fn refuses_scene(&self, words: &[&str]) {
        let answer = self.headrace(&["simulate", "scene.toml", "-o", "dive.mcap"]);
        assert_eq!(answer.code, Some(2), "{}", answer.stderr);
        for word in words {
            assert!(answer.stderr.contains(word), "{word:?} is not in {}", answer.stderr);
        }
        assert!(!self.path("dive.mcap").exists(), "no log of a scene that is none");
    }

    /// Exit code and report of `replay LOG --json` with further arguments.
    pub(crate) fn replay(&self, log: &str, further: &[&str]) -> (Option<i32>, Value) {
        let answer = self.headrace(&[&["replay", log, "--json"], further].concat());
        let report = serde_json::from_str(&answer.stdout)
            .unwrap_or_else(|error| panic!("{log}: {error}: {}", answer.stderr));
        (answer.code, report)
    }

    /// The digest of a replay that must find nothing amiss.
    pub(crate) fn digest(&self, log: &str, further: &[&str]) -> String {
        let (code, report) = self.replay(log, further);
        assert_eq!(code, Some(0), "{log} {further:?}: {:?}", report["log"]["losses"]);
        report["digest"].as_str().unwrap().to_owned()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        if let Err(error) = std::fs::remove_dir_all(&self.0) {
            eprintln!("removing {}: {error}", self.0.display());
        }
    }
}

/// What the devices sent, in the order of the file.
pub(crate) fn raw_messages(log: &[u8]) -> Vec<Message<'_>> {
    let all = MessageStream::new(log).unwrap().map(Result::unwrap);
    all.filter(|message| message.channel.topic.starts_with("/raw/")).collect()
}

/// Writes a log with the `mcap` crate's own writer: these messages in this order, and perhaps a vehicle file.
pub(crate) fn write_log(path: &Path, options: WriteOptions, vehicle: Option<&str>, messages: &[Message<'_>]) {
    let mut writer = options.create(BufWriter::new(File::create(path).unwrap())).unwrap();
    if let Some(vehicle) = vehicle {
        let attachment = Attachment {
            log_time: 0,
            create_time: 0,
            name: "vehicle.toml".to_owned(),
            media_type: "application/toml".to_owned(),
            data: vehicle.as_bytes().into(),
        };
        writer.attach(&attachment).unwrap();
    }
    for message in messages {
        writer.write(message).unwrap();
    }
    writer.finish().unwrap();
}
