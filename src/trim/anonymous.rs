//! Anonymises the header of a log: removes comments, names, addresses, serial numbers and the time of day.
//!
//! The vehicle file is edited as text, string by string. Its keys and numbers are kept.

use headrace_devices::KINDS;
use headrace_replay::log::format::{FORMAT_KEY, VEHICLE_FILE};
use headrace_replay::log::{DiveLog, LogHeader, SourceInfo, TRIMMED};
use headrace_sensor::connect::{Connect, SerialPort};
use headrace_vehicle::VehicleConfig;

use crate::failure::Failure;
use crate::files;

/// Metadata keys that are kept, because their values don't identify anyone.
const KEPT_KEYS: [&str; 4] = [FORMAT_KEY, "version", "import_format", TRIMMED];
/// Log times after this time, the beginning of the year 2000, are UTC. Earlier log times are those of a monotonic
/// clock.
const UTC_FROM_NS: u64 = 946_684_800_000_000_000;

/// Header without identifying data.
pub(crate) struct Anonymous {
    vehicle_toml: String,
    /// Name of each attached file in the old log, and its new name.
    names: Vec<(String, String)>,
    /// Texts that name the identifying items which couldn't be removed.
    pub(crate) left: Vec<String>,
}

impl Anonymous {
    /// Anonymises the header of a log and its vehicle file.
    ///
    /// Errors: the anonymised vehicle file can't be parsed, which would be a bug.
    pub(crate) fn of(log: &DiveLog, vehicle: &VehicleConfig) -> Result<Self, Failure> {
        let info = log.header();
        let text = info.vehicle_toml.clone().unwrap_or_default();
        let names: Vec<(String, String)> = (1..)
            .zip(&info.attachments)
            .map(|(number, (name, _))| (name.clone(), format!("file{number}{}", ending(name))))
            .collect();
        let vehicle_toml = anonymised(&text, &names);
        let attachments: Vec<(String, Vec<u8>)> = names
            .iter()
            .zip(&info.attachments)
            .map(|((_, name), (_, content))| (name.clone(), content.clone()))
            .collect();
        let document = headrace_config::Document::new(VEHICLE_FILE, &vehicle_toml);
        VehicleConfig::parse(document, &KINDS, &files::attached(&attachments))?;
        Ok(Self { vehicle_toml, names, left: left(log, vehicle) })
    }

    /// Header of the new log: `header` without identifying data.
    pub(crate) fn header(&self, mut header: LogHeader) -> LogHeader {
        header.vehicle_toml.clone_from(&self.vehicle_toml);
        for (name, _) in &mut header.attachments {
            if let Some((_, other)) = self.names.iter().find(|(known, _)| known == name) {
                name.clone_from(other);
            }
        }
        header.metadata.retain(|key, _| KEPT_KEYS.contains(&key.as_str()));
        for (number, source) in header.sources.iter_mut().enumerate() {
            source.connect = connect(&source.connect, number);
        }
        header
    }
}

/// Texts that name the identifying items which can't be removed.
fn left(log: &DiveLog, vehicle: &VehicleConfig) -> Vec<String> {
    let info = log.header();
    let ids = |sources: &[SourceInfo]| {
        sources.iter().map(|source| source.id.as_str()).collect::<Vec<_>>().join(", ")
    };
    let mut left = vec![
        format!("not anonymised: the sensors' ids ({})", ids(&info.sources)),
        format!("not anonymised: the tunnel's shape ({}) and all numbers of the vehicle file", vehicle.tunnel.name),
        "not anonymised: device data except positions, texts and system ids of MAVLink; it may contain serial numbers, versions \
         and the time of day (CAN units, velocity logs, depth sensors when they are opened)"
            .to_owned(),
    ];
    if !info.attachments.is_empty() {
        left.push("not anonymised: the content of the attached files".to_owned());
    }
    if log.times().is_some_and(|(_, to)| to.0 >= UTC_FROM_NS) {
        left.push("not anonymised: the messages' times, which are UTC and show the date".to_owned());
    }
    left
}

/// Extension of a file name, with the dot.
fn ending(name: &str) -> &str {
    name.rfind('.').and_then(|dot| name.get(dot..)).unwrap_or_default()
}

/// Anonymised value of a sensor's `connect`. The kind of connection (serial, TCP, UDP, CAN, ...) stays, but host names,
/// paths and serial numbers are replaced or removed. `number` keeps the values of several sensors distinct.
fn connect(text: &str, number: usize) -> String {
    // Addresses reserved for documentation. Source: RFC 5737.
    let host = |address: &str| {
        let port = address.rsplit_once(':').map_or("", |(_, port)| port);
        format!("192.0.2.{}:{port}", number % 250 + 1)
    };
    let connect = match Connect::parse(text) {
        Ok(Connect::Tcp { address }) => Connect::Tcp { address: host(&address) },
        Ok(Connect::Udp { address }) => Connect::Udp { address: host(&address) },
        Ok(Connect::UdpListen { address, .. }) => Connect::UdpListen { address: host(&address), from: None },
        Ok(Connect::Serial { baud, .. }) => {
            Connect::Serial { port: SerialPort::Path(format!("/dev/ttyUSB{number}")), baud }
        }
        Ok(Connect::Hid(mut usb)) => {
            usb.serial = None;
            Connect::Hid(usb)
        }
        Ok(Connect::Can { .. }) => Connect::Can { interface: format!("can{number}") },
        Ok(connect @ Connect::I2c { .. }) => connect,
        Err(_) => return String::new(),
    };
    connect.to_string()
}

/// The vehicle file without comments. Names, addresses and attached files are replaced.
fn anonymised(text: &str, names: &[(String, String)]) -> String {
    let (mut clean, mut rest, mut count) = (String::new(), text, 0);
    while let Some(c) = rest.chars().next() {
        match c {
            '#' => rest = rest.find('\n').and_then(|end| rest.get(end..)).unwrap_or_default(),
            '"' | '\'' => {
                let len = string_len(rest, c);
                let (string, after) = rest.split_at_checked(len).unwrap_or((rest, ""));
                let key = key_before(&clean);
                clean.push_str(&other_string(string, key, names, &mut count));
                rest = after;
            }
            c => {
                clean.push(c);
                rest = rest.get(c.len_utf8()..).unwrap_or_default();
            }
        }
    }
    let lines = clean.lines().map(str::trim_end).filter(|line| !line.is_empty());
    lines.fold(String::new(), |all, line| all + line + "\n")
}

/// Length of the TOML string at the beginning of `text`, in bytes, including its quotes.
fn string_len(text: &str, quote: char) -> usize {
    let long: String = [quote; 3].iter().collect();
    let end = if text.starts_with(&long) { long.as_str() } else { text.get(..1).unwrap_or_default() };
    let mut at = end.len();
    while let Some(rest) = text.get(at..).filter(|rest| !rest.is_empty()) {
        if rest.starts_with(end) {
            return at + end.len();
        }
        let first = rest.chars().next().map_or(1, char::len_utf8);
        let escaped = quote == '"' && rest.starts_with('\\');
        let second = rest.chars().nth(1).filter(|_| escaped).map_or(0, char::len_utf8);
        at += first + second;
    }
    text.len()
}

/// TOML key of the value that comes right after `text`, without the names of its tables.
fn key_before(text: &str) -> &str {
    let line = text.rsplit(['\n', ',', '{', '[']).next().unwrap_or_default();
    let key = line.split_once('=').map_or("", |(key, _)| key);
    key.rsplit('.').next().unwrap_or_default().trim().trim_matches(['"', '\''])
}

/// The text that replaces a string of the vehicle file in the anonymised file.
fn other_string(string: &str, key: &str, names: &[(String, String)], count: &mut usize) -> String {
    let inner = string.trim_matches(['"', '\'']);
    if let Some((_, other)) = names.iter().find(|(name, _)| name == inner) {
        return format!("{other:?}");
    }
    match key {
        "name" => {
            *count += 1;
            format!("\"name {count}\"")
        }
        "connect" => {
            *count += 1;
            format!("{:?}", connect(inner, *count))
        }
        _ => string.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn anonymising_changes_only_comments_names_addresses_and_files() {
        let text = r##"# Gate 3 of the Upper Plant
name = "VITA # 7" # Anna's
target_m = 1.2
[tunnel]
profile = 'polyline' # of 1962
file = "upper plant.csv"
[[openings]]
name = """gate "three"
at the bend"""
from_m = 1
[[sensors]]
id = "sonar_0"
connect = "tcp:plant-router.example:4040"
[[sensors]]
connect = "serial:/dev/serial/by-id/usb-FTDI_A50285BI-if00?baud=9600"
[[sensors]]
signals = { rate = ["A#1", "B\"#"], sample_time = "T" }
connect = "hid:1209:0001:SN4711"
[more]
inner."name" = "Anna"
'connect' = "can:plant"
"##;
        let names = [("upper plant.csv".to_owned(), "file1.csv".to_owned())];
        let expected = r##"name = "name 1"
target_m = 1.2
[tunnel]
profile = 'polyline'
file = "file1.csv"
[[openings]]
name = "name 2"
from_m = 1
[[sensors]]
id = "sonar_0"
connect = "tcp:192.0.2.4:4040"
[[sensors]]
connect = "serial:/dev/ttyUSB4?baud=9600"
[[sensors]]
signals = { rate = ["A#1", "B\"#"], sample_time = "T" }
connect = "hid:1209:0001"
[more]
inner."name" = "name 6"
'connect' = "can:can7"
"##;
        assert_eq!(anonymised(text, &names), expected);
    }

    #[test]
    fn anonymised_shipped_vehicle_files_differ_only_in_names() {
        for name in ["vita1.toml", "vita2-2.toml", "vita2-3.toml", "vita2-4.toml"] {
            let file = format!("{}/deploy/vehicles/{name}", env!("CARGO_MANIFEST_DIR"));
            let text = std::fs::read_to_string(file).unwrap();
            let clean = anonymised(&text, &[]);
            assert!(!clean.contains('#') && !clean.contains("VITA") && !clean.contains("192.168"), "{clean}");
            let read = |text: &str| {
                let document = headrace_config::Document::new(name, text);
                VehicleConfig::parse(document, &KINDS, &|_| Err("no file".to_owned())).unwrap()
            };
            let (before, after) = (read(&text), read(&clean));
            let shown = |vehicle: &VehicleConfig| format!("{:?} {:?}", vehicle.tunnel, vehicle.site);
            assert_eq!((shown(&after), after.target), (shown(&before), before.target));
            let sensors = |vehicle: &VehicleConfig| {
                let sensors = vehicle.sensor_configs.iter();
                sensors.map(|s| format!("{} {} {:?}", s.id, s.plugin, s.mount)).collect::<Vec<_>>()
            };
            assert_eq!(sensors(&after), sensors(&before));
        }
    }

    #[test]
    fn anonymising_accepts_unterminated_strings() {
        for text in ["name = \"", "'", "\"\"\"", "\"\\", "#", "name = 'é", "\u{e9}#"] {
            anonymised(text, &[]);
        }
    }
}
