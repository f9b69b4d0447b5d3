//! Which sensor listens to which line of a foreign log.

use headrace_geometry::time::MonoNs;
use headrace_replay::import::Taker;
use headrace_replay::log::SourceInfo;
use headrace_sensor::connect::Connect;
use headrace_sensor::device::DeviceKind as _;
use headrace_sensor::driver::DriverSetup;
use headrace_vehicle::VehicleConfig;

use super::kind::Kind;
use super::{imagenex, ping, tlog};
use crate::failure::Failure;

/// The sensors that listen, by the vehicle file and what was said besides.
pub(super) fn takers(
    kind: Kind,
    vehicle: Option<&VehicleConfig>,
    said: &[(String, String)],
) -> Result<Vec<Taker>, Failure> {
    check_streams(kind, said)?;
    if let (true, Some(vehicle)) = (kind.has_values(), vehicle) {
        let taker = |(source, id): (u16, &String)| Taker { source, stream: id.clone(), driver: None };
        return Ok((0..).zip(vehicle.sensor_configs.iter().map(|config| &config.id)).map(taker).collect());
    }
    let Some(vehicle) = vehicle else { return without_vehicle(kind, said) };
    let ids: Vec<&str> = vehicle.sensor_configs.iter().map(|sensor| sensor.id.as_str()).collect();
    if let Some((id, _)) = said.iter().find(|(id, _)| !ids.contains(&id.as_str())) {
        let allowed = ids.join(", ");
        return Err(refused(&format!(
            "--source {id}: the vehicle file has no such sensor; allowed are {allowed}"
        )));
    }
    let mut takers = Vec::new();
    for ((source, config), device) in (0..).zip(&vehicle.sensor_configs).zip(&vehicle.sensors) {
        let mine = said.iter().find(|(id, _)| *id == config.id).map(|(_, stream)| stream.clone());
        let is_of_kind = kind == Kind::Candump || config.plugin == kind.plugin();
        let usual = kind.usual_stream(&config.connect).filter(|_| is_of_kind);
        // Where anything is said, only what is said holds.
        let Some(stream) = mine.or(usual.filter(|_| said.is_empty())) else { continue };
        // All of a telemetry link is on one line; the driver of a part knows its own.
        let setup = DriverSetup { begun: MonoNs(0), head: None };
        let driver = (kind == Kind::Tlog && config.plugin == kind.plugin()).then(|| device.driver(&setup));
        takers.push(Taker { source, stream, driver });
    }
    let (plugin, stream) = (kind.plugin(), kind.stream_form());
    if takers.is_empty() {
        let whose = match kind {
            Kind::Candump => "with connect = \"can:INTERFACE\"".to_owned(),
            _ => format!("of plugin {plugin}"),
        };
        return Err(refused(&format!(
            "the vehicle file has no sensor {whose} to take it; --source ID={stream} names one"
        )));
    }
    if matches!(kind, Kind::Imagenex | Kind::Ping) && takers.len() > 1 {
        let several: Vec<&str> =
            takers.iter().filter_map(|taker| ids.get(usize::from(taker.source)).copied()).collect();
        let several = several.join(", ");
        return Err(refused(&format!(
            "the file is of one device, and {several} are of plugin {plugin}; --source ID={stream} says which"
        )));
    }
    Ok(takers)
}

/// The log's sources where there is no vehicle file.
pub(super) fn sources(kind: Kind, said: &[(String, String)]) -> Vec<SourceInfo> {
    let source = |(id, _): &(String, String)| SourceInfo {
        id: id.clone(),
        plugin: kind.plugin().to_owned(),
        connect: String::new(),
    };
    said.iter().map(source).collect()
}

fn without_vehicle(kind: Kind, said: &[(String, String)]) -> Result<Vec<Taker>, Failure> {
    if kind.has_values() {
        return Err(refused(&format!(
            "{} wants --vehicle VEHICLE.toml, whose sensors' bytes its values become",
            kind.name()
        )));
    }
    if said.is_empty() {
        let stream = kind.stream_form();
        return Err(refused(&format!(
            "which sensors are the messages of? --vehicle VEHICLE.toml says so, or --source ID={stream}"
        )));
    }
    let takers =
        (0..).zip(said).map(|(source, (_, stream))| Taker { source, stream: stream.clone(), driver: None });
    Ok(takers.collect())
}

fn check_streams(kind: Kind, said: &[(String, String)]) -> Result<(), Failure> {
    let form = kind.stream_form();
    if kind.has_values() && !said.is_empty() {
        return Err(refused(&format!(
            "--source isn't for {}; a mapping file names the sensors",
            kind.name()
        )));
    }
    let wrong = said.iter().find(|(_, stream)| kind != Kind::Candump && stream != form);
    if let Some((id, stream)) = wrong {
        return Err(refused(&format!("--source {id}={stream}: such a file has one line, {form}")));
    }
    let doubled =
        said.iter().enumerate().find(|(at, (id, _))| said.iter().take(*at).any(|(other, _)| other == id));
    match doubled {
        Some((_, (id, _))) => {
            Err(refused(&format!("--source {id}: named twice; a sensor listens to one line")))
        }
        None => Ok(()),
    }
}

fn refused(problem: &str) -> Failure {
    Failure::Usage(format!("import: {problem}"))
}

impl Kind {
    /// Whether such files have values, of which emulators make bytes.
    fn has_values(self) -> bool {
        matches!(self, Self::Csv | Self::Rosbag | Self::Mcap)
    }

    /// The kind of sensor whose bytes such files have.
    fn plugin(self) -> &'static str {
        match self {
            Self::Tlog => headrace_mavlink::Kind.name(),
            Self::Candump => headrace_imu_can::Kind.name(),
            Self::Imagenex => headrace_imagenex881::Kind.name(),
            Self::Ping => headrace_ping1d::Kind.name(),
            Self::Csv | Self::Rosbag | Self::Mcap => "",
        }
    }

    /// The line that a sensor listens to that is connected like this.
    fn usual_stream(self, connect: &str) -> Option<String> {
        match self {
            Self::Candump => match Connect::parse(connect) {
                Ok(Connect::Can { interface }) => Some(interface),
                _ => None,
            },
            other => Some(other.stream_form().to_owned()),
        }
    }

    /// How a line is named.
    fn stream_form(self) -> &'static str {
        match self {
            Self::Tlog => tlog::STREAM,
            Self::Candump => "INTERFACE",
            Self::Imagenex => imagenex::STREAM,
            Self::Ping => ping::STREAM,
            Self::Csv | Self::Rosbag | Self::Mcap => "ID",
        }
    }
}
