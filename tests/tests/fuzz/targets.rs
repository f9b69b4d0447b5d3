//! Readers of files, and the conditions that every reader must satisfy.

use std::io::Cursor;

use headrace_config::Document;
use headrace_config::plain::is_plain;
use headrace_devices::KINDS;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_import::a50::{self, A50Format};
use headrace_import::candump::Candump;
use headrace_import::csv::Csv;
use headrace_import::detect::looks_like;
use headrace_import::imagenex::{self, ImagenexFormat};
use headrace_import::ping::{self, PingFormat};
use headrace_import::ros::bag::Bag;
use headrace_import::ros::mcap::Mcap;
use headrace_import::ros::{Feeds, Topic};
use headrace_import::tlog::{self, TlogFormat};
use headrace_import::{Format, Import, Input, Source, Taker};
use headrace_monitor::console;
use headrace_replay::log::{LogHeader, LogWriter, SourceInfo};
use headrace_sensor::driver::DriverSetup;
use headrace_sensor::reading::Packet;
use headrace_simulator::Scene;
use headrace_vehicle::VehicleConfig;

use headrace_tests::random::Random;

use crate::corpus::{Corpus, Kind, OTHERS};
use crate::messages::{Said, said};

/// Vehicle configurations that the readers under test need.
pub(crate) struct Surroundings {
    vehicle: VehicleConfig,
    /// Vehicles with devices that send data. The sensor numbers of the second vehicle begin at `OTHERS`.
    vehicles: [VehicleConfig; 2],
}

const VEHICLE: &str = r#"target_m = 1.2
[tunnel]
profile = "circle"
radius_m = 3
length_m = 100
[[sensors]]
id = "imu"
plugin = "imu_can"
preset = "xsens_mti600"
[[sensors]]
id = "depth"
plugin = "bar100"
[[sensors]]
id = "tether"
plugin = "tether_hid"
counts_per_metre = 2000
[[sensors]]
id = "ping_left"
plugin = "ping1d"
[[sensors]]
id = "sonar_0"
plugin = "imagenex881"
mode = "fastest"
range_m = 5
[[sensors]]
id = "sonar_1"
plugin = "imagenex881"
mode = "fastest"
range_m = 5
[[sensors]]
id = "autopilot"
plugin = "mavlink"
part = "imu"
"#;

const TOPICS: [(&str, &str); 6] = [
    ("/imu/data", "imu"),
    ("/pressure", "depth"),
    ("/cable", "tether"),
    ("/ping/left", "ping_left"),
    ("/sonar/scan", "sonar_0"),
    ("/sonar/points", "sonar_1"),
];

impl Surroundings {
    pub(crate) fn new() -> Self {
        let read = |text: &str| {
            VehicleConfig::parse(Document::new("vehicle.toml", text), &KINDS, &|name| Err(name.to_owned()))
                .unwrap()
        };
        let vehicles = [read(headrace_tests::VEHICLE), read(&headrace_tests::other_vehicle())];
        Self { vehicle: read(VEHICLE), vehicles }
    }

    /// One [`Taker`] for each sensor. A taker states which stream contains the sensor's data. In tables and ROS
    /// recordings, the stream has the sensor's name. Other files have only one stream.
    fn takers(&self, kind: Kind) -> Vec<Taker> {
        let line = match kind {
            Kind::Tlog => tlog::STREAM,
            Kind::Imagenex => imagenex::STREAM,
            Kind::Ping => ping::STREAM,
            Kind::A50 => a50::STREAM,
            _ => "can0",
        };
        let setup = DriverSetup { begun: MonoNs(0), head: None };
        let sensors = (0..).zip(&self.vehicle.sensor_configs).zip(&self.vehicle.sensors);
        sensors
            .map(|((source, config), device)| {
                let own = matches!(kind, Kind::Csv | Kind::Bag | Kind::Mcap);
                let stream = if own { config.id.clone() } else { line.to_owned() };
                let driver =
                    (kind == Kind::Tlog && config.plugin == "mavlink").then(|| device.driver(&setup));
                Taker { source, stream, driver }
            })
            .collect()
    }

    /// Maps the given topics to sensors, and returns the feeds of the import. Only messages for profiling heads get
    /// their times from the timestamps in their headers.
    fn feeds(&self, topics: &[Topic]) -> Feeds {
        let there = TOPICS.iter().filter(|(name, _)| topics.iter().any(|topic| topic.name == *name));
        let text = there.fold(String::new(), |text, (topic, sensor)| {
            let time = if sensor.starts_with("sonar") { "time = \"header\"" } else { "" };
            format!("{text}[[topics]]\ntopic = \"{topic}\"\nsensor = \"{sensor}\"\n{time}\n")
        });
        let mapping = Document::new("topics.toml", &text).root().unwrap();
        Feeds::mapped(&mapping, &self.vehicle, topics).unwrap_or_default()
    }
}

/// Gives a file with arbitrary content to its reader.
///
/// Errors: a description of the fault that the reader showed.
pub(crate) fn try_one(
    kind: Kind,
    bytes: &[u8],
    corpus: &Corpus,
    around: &Surroundings,
) -> Result<(), String> {
    looks_like(bytes);
    if let Kind::Vehicle | Kind::Scene = kind {
        return written_by_people(kind, bytes).map(drop);
    }
    match kind {
        Kind::Line => return sent(bytes, around).map(drop),
        Kind::Console => return command(bytes).map(drop),
        Kind::Viewer => return from_viewer(bytes).map(drop),
        _ => {}
    }
    if kind != Kind::Log {
        imported(kind, bytes, around);
        return Ok(());
    }
    let Ok((said, silent)) = said(bytes) else { return Ok(()) };
    if !silent || !is_vouched_for(bytes) {
        return Ok(());
    }
    // The log reports no loss. It must therefore contain all messages of one of the intact logs. It may also contain
    // parts of other intact logs.
    let holds =
        |whole: &Said| whole.iter().all(|(message, count)| said.get(message).is_some_and(|got| got >= count));
    if corpus.said.iter().any(holds) {
        Ok(())
    } else {
        Err(format!("{} messages, and no loss is reported", said.len()))
    }
}

/// Whether every checksum is present. A checksum of zero counts as missing. Without a checksum, a changed byte can't be
/// detected.
fn is_vouched_for(log: &[u8]) -> bool {
    let mut rest = &log[8..];
    while let Some((head, behind)) = rest.split_first_chunk::<9>() {
        let len = u64::from_le_bytes(head[1..].try_into().unwrap());
        let Some((body, next)) = usize::try_from(len).ok().and_then(|len| behind.split_at_checked(len))
        else {
            break;
        };
        let sum = match head[0] {
            0x06 => body.get(24..28),
            0x0F => body.get(..4),
            _ => None,
        };
        if sum == Some(&[0; 4]) {
            return false;
        }
        rest = next;
    }
    true
}

/// Number of items (messages, sensors or readings) that the reader gets from an intact file.
pub(crate) fn gives(kind: Kind, bytes: &[u8], around: &Surroundings) -> u64 {
    match kind {
        Kind::Log => said(bytes).unwrap().0.len() as u64,
        Kind::Vehicle | Kind::Scene => written_by_people(kind, bytes).unwrap(),
        Kind::Line => sent(bytes, around).unwrap(),
        Kind::Console => command(bytes).unwrap(),
        Kind::Viewer => from_viewer(bytes).unwrap(),
        kind => imported(kind, bytes, around),
    }
}

/// Decodes a device's bytes both whole and in pieces; returns the number of readings.
///
/// Errors: a reading isn't a finite number, the counts don't add up, or the readings depend on how the bytes are split.
fn sent(bytes: &[u8], around: &Surroundings) -> Result<u64, String> {
    let &[number, seed, ref line @ ..] = bytes else { return Ok(0) };
    let [first, second] = &around.vehicles;
    let (vehicle, number) = if number >= OTHERS { (second, number - OTHERS) } else { (first, number) };
    let Some(device) = vehicle.sensors.get(usize::from(number) % vehicle.sensors.len()) else { return Ok(0) };
    let mut random = Random(u64::from(seed));
    let mut decoder = device.specification().decoder;
    let (mut rest, mut at, mut count) = (line, MonoNs(1_000_000_000), 0);
    let mut said = Ok(());
    while !rest.is_empty() {
        let (now, later) = rest.split_at((1 + random.below(24)).min(rest.len()));
        // The next piece of the device's bytes usually follows at once, but sometimes after a silence or with an
        // earlier timestamp.
        at = match random.below(40) {
            0 => at + DurNs::from_millis(3_600_000),
            1 => MonoNs(at.0.saturating_sub(1_000_000_000)),
            _ => at + DurNs::from_millis(1),
        };
        decoder.decode(Packet { received: at, bytes: now }, &mut |decoded| {
            count += 1;
            if !decoded.reading.is_finite() {
                said = Err(format!("no number: {:?}", decoded.reading));
            }
        });
        rest = later;
    }
    let counts = decoder.counts();
    if counts.skipped_bytes > line.len() as u64 {
        said = Err(format!("{counts:?} of {} bytes", line.len()));
    }
    said.map(|()| count)
}

/// Reads a packet of operator input. Errors: the command isn't the same after it has been written and read again.
fn command(bytes: &[u8]) -> Result<u64, String> {
    let Ok(command) = console::Command::parse(bytes) else { return Ok(0) };
    let json = command.to_json();
    match console::Command::parse(json.as_bytes()) {
        Ok(again) if again == command => Ok(1),
        other => Err(format!("{command:?} is written {json}, which is {other:?}")),
    }
}

/// Reads a viewer's message. Errors: the message is accepted, but the loop's input has no such command.
fn from_viewer(bytes: &[u8]) -> Result<u64, String> {
    let Ok(text) = str::from_utf8(bytes) else { return Ok(0) };
    match headrace_dashboard::command::command_of(text) {
        Ok(None) => Ok(1),
        Ok(Some(taken)) => {
            let json = serde_json::to_string(&taken).map_err(|error| error.to_string())?;
            let read: serde_json::Value = serde_json::from_str(&json).map_err(|error| error.to_string())?;
            if read["do"] == taken.word() { Ok(1) } else { Err(format!("{taken:?} is written {json}")) }
        }
        Err(words) if words.is_empty() => Err("refused without words".to_owned()),
        Err(_) => Ok(0),
    }
}

/// Largest number of lines in the list of a file's errors, including the line that says that there are more.
const MOST_ERRORS: usize = 101;

/// Reads a vehicle file or a scene; returns its number of sensors. Errors: the list of errors that the reader returns
/// is faulty.
fn written_by_people(kind: Kind, bytes: &[u8]) -> Result<u64, String> {
    let Ok(text) = str::from_utf8(bytes) else { return Ok(0) };
    let document = Document::new("file", text);
    let vehicle = headrace_tests::VEHICLE;
    let read = if kind == Kind::Vehicle {
        VehicleConfig::parse(document, &KINDS, &|name| Err(name.to_owned()))
            .map(|vehicle| vehicle.sensors.len())
            .map_err(|errors| errors.to_string())
    } else {
        Scene::parse(document, &KINDS, &|_| Ok(vehicle.into()), None)
            .map(|scene| scene.vehicle.sensors.len())
            .map_err(|error| error.to_string())
    };
    match read {
        Ok(sensors) => Ok(sensors as u64),
        Err(words) if words.lines().count() > MOST_ERRORS || words.is_empty() => {
            Err(format!("{} lines of errors", words.lines().count()))
        }
        Err(words) if !is_plain(&words.replace('\n', "")) => Err(format!("codes in errors: {words:?}")),
        Err(_) => Ok(0),
    }
}

/// Imports a file into a log, and checks that the log is intact.
fn imported(kind: Kind, bytes: &[u8], around: &Surroundings) -> u64 {
    let format: Box<dyn Format> = match kind {
        // Of the kinds in this arm, only ROS recordings have an importer. Files of all these kinds are therefore
        // imported as if they were ROS recordings.
        Kind::Log | Kind::Mcap | Kind::Vehicle | Kind::Scene | Kind::Line | Kind::Console | Kind::Viewer => {
            let Ok(recording) = Mcap::open("file", Cursor::new(bytes)) else { return 0 };
            let feeds = around.feeds(&recording.topics());
            return written(kind, recording.feeding(feeds), around);
        }
        Kind::Tlog => Box::<TlogFormat>::default(),
        Kind::Candump => Box::new(Candump),
        Kind::Imagenex => Box::new(ImagenexFormat),
        Kind::Ping => Box::<PingFormat>::default(),
        Kind::A50 => Box::<A50Format>::default(),
        Kind::Csv => {
            let Some(table) = table(bytes, around) else { return 0 };
            Box::new(table)
        }
        Kind::Bag => {
            let Ok(topics) = Bag::topics("file", Cursor::new(bytes)) else { return 0 };
            Box::new(Bag::new(around.feeds(&topics)))
        }
    };
    written(kind, Input::new("file", Cursor::new(bytes.to_vec()), format), around)
}

/// Reads a table with pressure and cable chainage, or with the angles and ranges of a head.
fn table(bytes: &[u8], around: &Surroundings) -> Option<Csv> {
    let columns = |columns: &[[&str; 4]]| {
        let head = "time_column = \"t\"\nutc = true\n".to_owned();
        columns.iter().fold(head, |text, [column, sensor, quantity, unit]| {
            format!("{text}[[columns]]\ncolumn = \"{column}\"\nsensor = \"{sensor}\"\nquantity = \"{quantity}\"\nunit = \"{unit}\"\n")
        })
    };
    let values = columns(&[["depth", "depth", "pressure", "Pa"], ["tether", "tether", "chainage", "m"]]);
    let heads = columns(&[["angle", "sonar_0", "angle", "rad"], ["range", "sonar_0", "range", "m"]]);
    let front = String::from_utf8_lossy(bytes);
    [values, heads].iter().find_map(|text| {
        Csv::new(&Document::new("map.toml", text).root().unwrap(), &around.vehicle, &front).ok()
    })
}

fn written<S: Source>(kind: Kind, input: S, around: &Surroundings) -> u64 {
    let Ok(import) = Import::of(input, "entry") else { return 0 };
    let ids = around.vehicle.sensor_configs.iter().map(|config| config.id.clone());
    let sources = ids.map(|id| SourceInfo { id, ..SourceInfo::default() }).collect();
    let header = LogHeader { sources, ..LogHeader::default() };
    let mut log = LogWriter::new(Cursor::new(Vec::new()), &header).unwrap();
    let Ok(imported) = import.write(&mut log, &mut around.takers(kind), &mut |_| ()) else { return 0 };
    let file = log.finish().unwrap().0.into_inner();
    let (said, whole) = said(&file).unwrap();
    let messages: u64 = imported.messages.iter().sum();
    assert!(whole, "a log that was just written has losses");
    assert_eq!(said.values().map(|count| u64::from(*count)).sum::<u64>(), messages, "messages of the log");
    assert!(imported.losses.iter().chain(&imported.remarks).all(|words| !words.is_empty()));
    messages
}
