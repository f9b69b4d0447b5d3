//! Vehicle files: from disk, or attached to a log.

use std::path::{Path, PathBuf};

use headrace_config::Document;
use headrace_devices::KINDS;
use headrace_replay::log::LogInfo;
use headrace_replay::log::format::VEHICLE_FILE;
use headrace_replay::regular_file;
use headrace_vehicle::VehicleConfig;

use crate::errors::Failure;

/// Maximum size of a text file, bytes. `DATA_BYTES` is the maximum size of a data file.
const TEXT_BYTES: u64 = 16 << 20;
const DATA_BYTES: u64 = 256 << 20;

/// Reads a vehicle file: its text, and the parsed vehicle.
///
/// Errors: the file can't be read; its keys are invalid.
pub(crate) fn read(path: &Path) -> Result<(String, VehicleConfig), Failure> {
    let failed = |source| Failure::File { path: path.to_owned(), source };
    let text = regular_file::read_text(path, TEXT_BYTES).map_err(failed)?;
    let folder = folder_of(path);
    let load = |name: &str| {
        let path = folder.join(name);
        regular_file::read_text(&path, TEXT_BYTES)
            .map_err(|error| format!("can't be read at {}: {error}", path.display()))
    };
    let vehicle = VehicleConfig::parse(Document::new(&path.display().to_string(), &text), &KINDS, &load)?;
    Ok((text, vehicle))
}

/// Reads the vehicle file attached to a log of that name.
///
/// Errors: no vehicle file is attached; its keys are invalid.
pub(crate) fn attached(info: &LogInfo, log: &str) -> Result<VehicleConfig, Failure> {
    let text = info.vehicle_toml.as_deref().ok_or_else(|| Failure::NoVehicleFile { file: log.to_owned() })?;
    let load = |name: &str| {
        let content = info.attachments.iter().find(|(attached, _)| attached == name);
        let (_, content) = content.ok_or_else(|| "is not attached to the log".to_owned())?;
        let text = String::from_utf8(content.clone());
        text.map_err(|_| "is attached to the log, but isn't UTF-8 text".to_owned())
    };
    Ok(VehicleConfig::parse(Document::new(&format!("{log}/{VEHICLE_FILE}"), text), &KINDS, &load)?)
}

/// Returns a function that loads the files that a vehicle file's simulation needs, from the vehicle file's folder.
pub(crate) fn bytes_beside(path: &Path) -> impl Fn(&str) -> Result<Vec<u8>, String> {
    let folder = folder_of(path);
    move |name| {
        let path = folder.join(name);
        regular_file::read(&path, DATA_BYTES)
            .map_err(|error| format!("can't be read at {}: {error}", path.display()))
    }
}

fn folder_of(path: &Path) -> PathBuf {
    path.parent().map(Path::to_owned).unwrap_or_default()
}
