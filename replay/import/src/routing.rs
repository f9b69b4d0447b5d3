//! Assigns the connections recorded in a foreign log, such as CAN interfaces, to sensors. Options and error texts call
//! these connections lines.

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_replay::log::SourceInfo;
use headrace_sensor::driver::{Driver, DriverSetup, Wire};
use headrace_vehicle::VehicleConfig;

use crate::kind::FileKind;

/// A sensor that receives data of the file.
pub struct Taker {
    /// Number of the sensor's source in the log.
    pub source: u16,
    /// Name of the recorded connection whose data the sensor receives.
    pub stream: String,
    /// Driver that picks the sensor's data from a shared connection. Without a driver, the sensor gets all data of the
    /// connection.
    pub driver: Option<Box<dyn Driver>>,
}

/// Collects the packets that a driver delivers. Messages to the device are discarded.
struct Heard(Vec<(MonoNs, Vec<u8>)>);

impl Wire for Heard {
    fn send(&mut self, _: &[u8]) {}

    fn exchange(&mut self, _: &[u8], _: DurNs, _: usize) {}

    fn deliver(&mut self, received: MonoNs, bytes: &[u8]) {
        self.0.push((received, bytes.to_vec()));
    }
}

impl Taker {
    /// Whether the sensor receives the data of this connection.
    pub(super) fn listens_to(&self, stream: &str) -> bool {
        self.stream == stream
    }

    /// Returns the sensor's packets in an entry of the file.
    pub(super) fn take(&mut self, at: MonoNs, bytes: &[u8]) -> Vec<(MonoNs, Vec<u8>)> {
        let mut heard = Heard(Vec::new());
        match &mut self.driver {
            Some(driver) => driver.heard(at, bytes, &mut heard),
            None => heard.deliver(at, bytes),
        }
        heard.0
    }
}

/// Reason why the connections in a file can't be assigned to sensors.
///
/// Messages name the options of `headrace import`.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RoutingError {
    /// An option names a sensor that the vehicle file doesn't have.
    #[error("--source {id}: the vehicle file has no such sensor; allowed are {allowed}")]
    NoSuchSensor {
        /// Name of the sensor in the option.
        id: String,
        /// Ids of the sensors in the vehicle file.
        allowed: String,
    },
    /// The vehicle file has no sensor for the data of this kind of log file.
    #[error("the vehicle file has no sensor {which} to receive the data; name one with --source ID={line}")]
    NoTaker {
        /// Description of sensors that could receive the data.
        which: String,
        /// Form of a connection's name in this kind of log file.
        line: &'static str,
    },
    /// The file comes from one device, but several sensors could be that device.
    #[error(
        "the file comes from one device, but {several} have plugin {plugin}; choose one with --source ID={line}"
    )]
    SeveralTakers {
        /// Ids of the sensors that the device could be.
        several: String,
        /// Plugin that these sensors have in common.
        plugin: &'static str,
        /// Form of a connection's name in this kind of log file.
        line: &'static str,
    },
    /// The file contains values, and there is no vehicle file with sensors that could encode them.
    #[error("{format} needs --vehicle VEHICLE.toml, whose sensors encode its values")]
    NoVehicle {
        /// Kind of the file that contains values.
        format: &'static str,
    },
    /// Neither a vehicle file nor an option names a sensor.
    #[error("the sensors of the messages are unknown; give --vehicle VEHICLE.toml or --source ID={line}")]
    NoSensor {
        /// Form of a connection's name in this kind of log file.
        line: &'static str,
    },
    /// An option names a connection, but the file has no connections, because it contains values instead of bytes.
    #[error("--source isn't for {format}; a mapping file names the sensors")]
    NoLines {
        /// Kind of the file that contains values.
        format: &'static str,
    },
    /// An option names a connection that this kind of log file doesn't have.
    #[error("--source {id}={line}: such a file has one line, {only}")]
    NoSuchLine {
        /// Name of the sensor in the option.
        id: String,
        /// Name of the connection in the option.
        line: String,
        /// The only connection that this kind of log file has.
        only: &'static str,
    },
    /// Two options name the same sensor, but a sensor can have only one connection.
    #[error("--source {id}: named twice; a sensor listens to one line")]
    Twice {
        /// Name of the sensor in both options.
        id: String,
    },
}

/// Returns the sensors that receive data: the sensors of the vehicle file, or the sensors in `explicit`.
///
/// `explicit` has pairs of a sensor's id and the name of its connection. If `explicit` isn't empty, it replaces the
/// connections in the vehicle file.
///
/// Errors: see [`RoutingError`].
pub fn takers(
    kind: FileKind,
    vehicle: Option<&VehicleConfig>,
    explicit: &[(String, String)],
) -> Result<Vec<Taker>, RoutingError> {
    check_lines(kind, explicit)?;
    if let (true, Some(vehicle)) = (kind.has_values(), vehicle) {
        let taker = |(source, id): (u16, &String)| Taker { source, stream: id.clone(), driver: None };
        return Ok((0..).zip(vehicle.sensor_configs.iter().map(|config| &config.id)).map(taker).collect());
    }
    let Some(vehicle) = vehicle else { return without_vehicle(kind, explicit) };
    let ids: Vec<&str> = vehicle.sensor_configs.iter().map(|sensor| sensor.id.as_str()).collect();
    if let Some((id, _)) = explicit.iter().find(|(id, _)| !ids.contains(&id.as_str())) {
        return Err(RoutingError::NoSuchSensor { id: id.clone(), allowed: ids.join(", ") });
    }
    let mut takers = Vec::new();
    for ((source, config), device) in (0..).zip(&vehicle.sensor_configs).zip(&vehicle.sensors) {
        let own = explicit.iter().find(|(id, _)| *id == config.id).map(|(_, line)| line.clone());
        let is_of_kind = kind == FileKind::Candump || config.plugin == kind.plugin();
        let usual = kind.usual_line(&config.connect).filter(|_| is_of_kind);
        let Some(stream) = own.or(usual.filter(|_| explicit.is_empty())) else { continue };
        // All devices of a telemetry link share one connection, so each device's driver must pick out its own messages.
        let setup = DriverSetup { begun: MonoNs(0), head: None };
        let has_driver = kind == FileKind::Tlog && config.plugin == kind.plugin();
        takers.push(Taker { source, stream, driver: has_driver.then(|| device.driver(&setup)) });
    }
    let (plugin, line) = (kind.plugin(), kind.line_form());
    if takers.is_empty() {
        let which = match kind {
            FileKind::Candump => "with connect = \"can:INTERFACE\"".to_owned(),
            _ => format!("of plugin {plugin}"),
        };
        return Err(RoutingError::NoTaker { which, line });
    }
    if kind.has_one_device() && takers.len() > 1 {
        let several: Vec<&str> =
            takers.iter().filter_map(|taker| ids.get(usize::from(taker.source)).copied()).collect();
        return Err(RoutingError::SeveralTakers { several: several.join(", "), plugin, line });
    }
    Ok(takers)
}

/// Returns the sources of a log that is imported without a vehicle file.
pub fn sources(kind: FileKind, explicit: &[(String, String)]) -> Vec<SourceInfo> {
    let source = |(id, _): &(String, String)| SourceInfo {
        id: id.clone(),
        plugin: kind.plugin().to_owned(),
        connect: String::new(),
    };
    explicit.iter().map(source).collect()
}

fn without_vehicle(kind: FileKind, explicit: &[(String, String)]) -> Result<Vec<Taker>, RoutingError> {
    if kind.has_values() {
        return Err(RoutingError::NoVehicle { format: kind.name() });
    }
    if explicit.is_empty() {
        return Err(RoutingError::NoSensor { line: kind.line_form() });
    }
    let takers =
        (0..).zip(explicit).map(|(source, (_, line))| Taker { source, stream: line.clone(), driver: None });
    Ok(takers.collect())
}

fn check_lines(kind: FileKind, explicit: &[(String, String)]) -> Result<(), RoutingError> {
    let only = kind.line_form();
    if kind.has_values() && !explicit.is_empty() {
        return Err(RoutingError::NoLines { format: kind.name() });
    }
    let wrong = explicit.iter().find(|(_, line)| kind != FileKind::Candump && line != only);
    if let Some((id, line)) = wrong {
        return Err(RoutingError::NoSuchLine { id: id.clone(), line: line.clone(), only });
    }
    let mut pairs = explicit.iter().enumerate();
    let doubled = pairs.find(|(at, (id, _))| explicit.iter().take(*at).any(|(other, _)| other == id));
    doubled.map_or(Ok(()), |(_, (id, _))| Err(RoutingError::Twice { id: id.clone() }))
}
