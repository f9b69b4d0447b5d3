//! Reads vehicle files from disk or from a log.

use std::path::{Path, PathBuf};

use headrace_config::{Document, Loader};
use headrace_devices::KINDS;
use headrace_replay::log::LogInfo;
use headrace_replay::log::format::VEHICLE_FILE;
use headrace_vehicle::VehicleConfig;

use crate::failure::Failure;
use crate::files;

/// Reads and parses a vehicle file. Also returns the file's text.
pub(crate) fn read(path: &Path) -> Result<(String, VehicleConfig), Failure> {
    let text = files::read(path)?;
    let vehicle = parse(&path.display().to_string(), &text, &files::beside(path))?;
    Ok((text, vehicle))
}

/// Vehicle file that an option names, if any, and the files that it was read from.
#[derive(Default)]
pub(crate) struct Given {
    /// Parsed vehicle, and the text of its file.
    vehicle: Option<(String, VehicleConfig)>,
    /// The vehicle file itself, and the files that it refers to.
    pub(crate) files: Vec<PathBuf>,
}

impl Given {
    /// Reads the vehicle file that an option names, if any.
    pub(crate) fn read(path: Option<&Path>) -> Result<Self, Failure> {
        let Some(path) = path else { return Ok(Self::default()) };
        let (text, vehicle) = read(path)?;
        Ok(Self { files: files(path, &vehicle), vehicle: Some((text, vehicle)) })
    }

    /// The vehicle file that was given, or else the one attached to a log; see [`attached`].
    pub(crate) fn or_attached(
        self,
        info: &LogInfo,
        losses: &[String],
        log: &Path,
    ) -> Result<(String, VehicleConfig), Failure> {
        self.vehicle.map_or_else(|| attached(info, losses, log), Ok)
    }
}

/// Paths of a vehicle file and of the other files that it refers to.
pub(crate) fn files(path: &Path, vehicle: &VehicleConfig) -> Vec<PathBuf> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let others = vehicle.attachments.iter().map(|(name, _)| folder.join(name));
    std::iter::once(path.to_owned()).chain(others).collect()
}

/// Parses the vehicle file attached to a log. Also returns the file's text.
///
/// `losses` are the losses of the log.
///
/// Errors: no vehicle file is attached, it can't be read, or it is invalid.
pub(crate) fn attached(
    info: &LogInfo,
    losses: &[String],
    log: &Path,
) -> Result<(String, VehicleConfig), Failure> {
    let text = info.vehicle_toml.clone().ok_or_else(|| {
        let damage = losses.first().map(|loss| format!(" can be read from this damaged log ({loss})"));
        let which = damage.unwrap_or_else(|| " is attached to this log".to_owned());
        Failure::Usage(format!("reading {}: no vehicle file{which}; give one with --vehicle", log.display()))
    })?;
    // Messages name the attached file as if it were in a folder that has the log's name.
    let vehicle =
        parse(&format!("{}/{VEHICLE_FILE}", log.display()), &text, &files::attached(&info.attachments))?;
    Ok((text, vehicle))
}

/// Parses a vehicle file's text. `load` loads the files that it refers to.
pub(crate) fn parse(name: &str, text: &str, load: Loader<'_>) -> Result<VehicleConfig, Failure> {
    let vehicle = VehicleConfig::parse(Document::new(name, text), &KINDS, load)?;
    log(name, &vehicle);
    Ok(vehicle)
}

/// Writes a log message about a parsed vehicle file.
pub(crate) fn log(name: &str, vehicle: &VehicleConfig) {
    tracing::info!(
        file = name,
        vehicle = vehicle.name,
        sensors = vehicle.sensors.len(),
        "vehicle file parsed"
    );
    for (number, sensor) in vehicle.sensor_configs.iter().enumerate() {
        tracing::debug!(number, id = sensor.id, plugin = sensor.plugin, connect = sensor.connect, "sensor");
    }
}
