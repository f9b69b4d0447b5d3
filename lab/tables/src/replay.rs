//! Replays one dive from its log to its report, in-process and on the calling thread.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use headrace_config::Document;
use headrace_devices::KINDS;
use headrace_fusion::Navigation;
use headrace_monitor::App;
use headrace_monitor::report::{LogReport, Report};
use headrace_monitor::run::Loop;
use headrace_replay::drive::{Pace, drive};
use headrace_replay::log::files_digest;
use headrace_replay::log::format::VEHICLE_FILE;
use headrace_replay::player::Player;
use headrace_replay::regular_file;
use headrace_replay::smooth::FirstPass;
use headrace_vehicle::{NavigationConfig, VehicleConfig};

use crate::stoppable::Stoppable;
use crate::{Error, Parameters};

/// Maximum size of a vehicle file, or of a file that it names, bytes.
const TEXT_BYTES: u64 = 16 << 20;

/// A replayed dive.
pub(crate) struct Dive {
    pub(crate) report: Report,
    pub(crate) vehicle: String,
    pub(crate) about: About,
}

/// Facts about a log, from the log's own metadata.
#[derive(Debug, Clone, Default)]
pub(crate) struct About {
    /// The program that wrote the log.
    pub(crate) recorded_version: Option<String>,
    /// Name of the simulated scene, if the log is a simulation.
    pub(crate) scene: Option<String>,
    /// UTC at the zero of the log's clock, nanoseconds.
    pub(crate) utc_of_zero_ns: Option<i64>,
}

/// Keys of a log's metadata, as written by `headrace run` and `headrace simulate`.
const VERSION: &str = "version";
const SCENE: &str = "simulated";
const ANCHOR: [&str; 2] = ["clock_anchor_monotonic_ns", "clock_anchor_utc_ns"];

/// SHA-256 over the concatenated bytes of a dive's files, hexadecimal.
///
/// Errors: a file can't be read.
pub fn log_digest(log: &[PathBuf]) -> Result<String, Error> {
    if log.is_empty() {
        return Err(Error::NoLog);
    }
    Ok(files_digest(log)?)
}

pub(crate) fn run(
    log: &[PathBuf],
    sha256: &str,
    parameters: &Parameters,
    stop: &AtomicBool,
) -> Result<Dive, Error> {
    let first = log.first().ok_or(Error::NoLog)?;
    parameters.check()?;
    let mut player = Player::open(log)?;
    let mut vehicle = vehicle(first, &player, parameters)?;
    parameters.apply(&mut vehicle)?;
    let mut report = if parameters.smooth {
        smoothed(log, &mut player, &vehicle, stop)?
    } else {
        straight(Stoppable::new(&mut player, stop), &vehicle, vehicle.navigation(), &mut |_| ())?
    };
    report.log = Some(LogReport {
        path: first.display().to_string(),
        sha256: sha256.to_owned(),
        messages: player.played(),
        losses: player.losses(),
        notes: player.notes(),
        parts: Vec::new(),
    });
    Ok(Dive { report, vehicle: vehicle.name, about: about(&player) })
}

/// Reads the vehicle from the parameters' vehicle file or, if they have none, from the log's.
fn vehicle(log: &Path, player: &Player, parameters: &Parameters) -> Result<VehicleConfig, Error> {
    let info = player.info();
    let load = |name: &str| {
        if let Some(text) = parameters.vehicle_files.get(name) {
            return Ok(text.clone());
        }
        let found = info.attachments.iter().find(|(attached, _)| attached == name);
        let (_, content) = found.ok_or_else(|| "is neither given nor attached to the log".to_owned())?;
        String::from_utf8(content.clone())
            .map_err(|_| "is attached to the log, but isn't UTF-8 text".to_owned())
    };
    let (name, text) = match (&parameters.vehicle, &info.vehicle_toml) {
        (Some(text), _) => ("vehicle".to_owned(), text),
        (None, Some(text)) => (format!("{}/{VEHICLE_FILE}", log.display()), text),
        (None, None) => {
            let loss = player.losses().into_iter().next();
            return Err(Error::NoVehicle { log: log.to_owned(), loss });
        }
    };
    Ok(VehicleConfig::parse(Document::new(&name, text), &KINDS, &load)?)
}

/// Replays the log from its beginning to its end.
fn straight(
    mut player: Stoppable<'_>,
    vehicle: &VehicleConfig,
    navigation: Box<dyn Navigation>,
    after_tick: &mut dyn FnMut(&Loop),
) -> Result<Report, Error> {
    let mut app = App::new(vehicle.mission());
    for sensor in &vehicle.sensors {
        app.add_device(sensor.as_ref())?;
    }
    let mut armed = app.arm(navigation)?;
    player.connect(armed.sources());
    drive(&mut armed, &mut player, Pace::default(), after_tick)?;
    player.check()?;
    armed.finish(&mut |_, _| ());
    after_tick(&armed);
    let now = armed.now();
    armed.tick(now);
    armed.release_samples();
    Ok(Report::of(&armed))
}

/// Replays with the filter, smooths the result, and replays along the smoothed trajectory, like `headrace replay
/// --smooth`.
fn smoothed(
    log: &[PathBuf],
    player: &mut Player,
    vehicle: &VehicleConfig,
    stop: &AtomicBool,
) -> Result<Report, Error> {
    let NavigationConfig::Filter(settings) = vehicle.navigation else {
        return Err(Error::NoFilter { log: log.first().cloned().unwrap_or_default() });
    };
    let (mut pass, filters) = FirstPass::new(vehicle, settings)?;
    let mut first = Player::open(log)?;
    let first = Stoppable::new(&mut first, stop);
    let before = straight(first, vehicle, filters, &mut |dive| pass.after_tick(dive))?;
    let (navigation, changes) = pass.smooth()?;
    let mut report = straight(Stoppable::new(player, stop), vehicle, navigation, &mut |_| ())?;
    changes.complete(&before, &mut report);
    Ok(report)
}

fn about(player: &Player) -> About {
    let metadata = &player.info().metadata;
    let [monotonic, utc] = ANCHOR.map(|key| metadata.get(key).and_then(|text| text.parse::<i64>().ok()));
    About {
        recorded_version: metadata.get(VERSION).cloned(),
        scene: metadata.get(SCENE).cloned(),
        utc_of_zero_ns: utc.zip(monotonic).and_then(|(utc, monotonic)| utc.checked_sub(monotonic)),
    }
}

impl Parameters {
    /// Reads a vehicle file, and the files that it names, into the parameters.
    ///
    /// Errors: a file can't be read, or is invalid.
    pub fn read_vehicle(&mut self, path: &Path) -> Result<(), Error> {
        let failed = |source| Error::Read { path: path.to_owned(), source };
        let text = regular_file::read_text(path, TEXT_BYTES).map_err(failed)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let load = |name: &str| {
            let path = folder.join(name);
            regular_file::read_text(&path, TEXT_BYTES)
                .map_err(|error| format!("can't be read at {}: {error}", path.display()))
        };
        let vehicle = VehicleConfig::parse(Document::new(&path.display().to_string(), &text), &KINDS, &load)?;
        self.vehicle_files = vehicle.attachments.into_iter().collect();
        self.vehicle = Some(text);
        Ok(())
    }
}
