//! `headrace check`: reports all errors in a vehicle or scene file, and the plan that results from it. With `--devices`
//! it also tests the vehicle's devices.

mod cable;
mod computer;
mod expected;
mod outlook;
mod readings;
mod results;
mod self_test;

use std::path::{Path, PathBuf};

use headrace_config::{ConfigErrors, Document};
use headrace_devices::KINDS;
use headrace_geometry::time::DurNs;
use headrace_sensor::reading::MAX_SOURCES;
use headrace_simulator::{Scene, SceneError, Simulation, position_error_model};
use headrace_vehicle::{Finding, Grade, VehicleConfig};
use serde_json::{Value, json};

use crate::cli::Check;
use crate::failure::{self, Failure};
use crate::files;
use crate::logging::complain;
use crate::output::{deliver, say, show};
use crate::vehicle_file;
use cable::Cable;
use outlook::Outlook;
use self_test::Results;

/// An error or warning, with its file and line.
struct Found {
    grade: Grade,
    file: String,
    line: usize,
    key: String,
    problem: String,
}

/// A vehicle or scene file that could be read.
struct Readable {
    vehicle: VehicleConfig,
    /// Name of the scene and its duration, s; `None` for a vehicle file.
    scene: Option<(String, f64)>,
    outlook: Option<Outlook>,
    cable: Option<Cable>,
}

/// Checks a file as `headrace check FILE` does. Returns the exit code.
pub(crate) fn file(path: &Path) -> Result<u8, Failure> {
    check(&Check {
        file: path.to_owned(),
        devices: false,
        duration: 0.0,
        folder: PathBuf::new(),
        json: false,
    })
}

/// Mode in which the vehicle's heads meet the target at the largest speed, and this speed reduced by a margin, m/s.
/// `text` is the text of the vehicle file.
pub(crate) fn best_mode(vehicle: VehicleConfig, text: &str) -> Option<(&'static str, f64)> {
    Readable::new(vehicle, ("vehicle.toml", text), &mut Vec::new()).outlook?.best_mode()
}

/// Mode that all of the vehicle's heads have, and as in [`best_mode`] its speed. `None` if their modes differ.
pub(crate) fn planned_mode(vehicle: VehicleConfig, text: &str) -> Option<(&'static str, f64)> {
    Readable::new(vehicle, ("vehicle.toml", text), &mut Vec::new()).outlook?.own_mode()
}

/// Runs `headrace check`.
pub(crate) fn check(args: &Check) -> Result<u8, Failure> {
    let (name, text) = (args.file.display().to_string(), files::read(&args.file)?);
    let mut found = Vec::new();
    if args.devices && is_scene(&text) {
        return Err(Failure::Usage(format!("check: {name} is a scene; --devices needs a vehicle file")));
    }
    let readable = if is_scene(&text) {
        scene(args, (&name, &text), &mut found)?
    } else {
        let parsed = VehicleConfig::parse(Document::new(&name, &text), &KINDS, &files::beside(&args.file));
        let vehicle = parsed.map_err(|errors| found.extend(all(&errors))).ok();
        vehicle.map(|vehicle| Readable::new(vehicle, (&name, &text), &mut found))
    };
    for one in &found {
        let grade = if one.grade == Grade::Warning { "warning: " } else { "" };
        complain(&format!("headrace: {grade}{}:{}: {}: {}", one.file, one.line, one.key, one.problem));
    }
    let count = |grade: Grade| found.iter().filter(|one| one.grade == grade).count();
    let valid = readable.as_ref().filter(|_| count(Grade::Error) == 0);
    if let Some(valid) = valid.filter(|_| !args.json) {
        show(&valid.text());
        show(&match count(Grade::Warning) {
            0 => "no errors\n".to_owned(),
            1 => "no errors, 1 warning\n".to_owned(),
            warnings => format!("no errors, {warnings} warnings\n"),
        });
    }
    let valid = valid.filter(|_| args.devices);
    let results = valid.map(|valid| self_test(args, &valid.vehicle, &text)).transpose()?;
    if args.json {
        deliver(&json(readable.as_ref(), &found, results.as_ref()).to_string())?;
    } else if let Some(results) = &results {
        show(&results.text());
    }
    Ok(match &results {
        _ if count(Grade::Error) > 0 => failure::USAGE,
        Some(results) if !results.is_ready() => failure::FAILED,
        _ => failure::OK,
    })
}

/// Runs the vehicle's devices, and compares them with the vehicle file.
fn self_test(args: &Check, vehicle: &VehicleConfig, text: &str) -> Result<Results, Failure> {
    if !args.json {
        let seconds = args.duration;
        say(&format!("testing the devices for {seconds} s; heads turn, so keep the vehicle at rest"));
    }
    self_test::run((vehicle, text), DurNs::from_secs_f64(args.duration), &args.folder)
}

/// Whether a text is a scene: true if it names a vehicle file or has a trajectory.
fn is_scene(text: &str) -> bool {
    let keys = |key: &&str| ["vehicle", "trajectory"].contains(key);
    Document::new("", text).root().is_ok_and(|root| root.keys().iter().any(keys))
}

/// The scene's vehicle, if scene and vehicle can be read.
fn scene(
    args: &Check,
    (name, text): (&str, &str),
    found: &mut Vec<Found>,
) -> Result<Option<Readable>, Failure> {
    let document = Document::new(name, text);
    let scene = match Scene::parse(document, &KINDS, &files::bytes_beside(&args.file), None) {
        Ok(scene) => scene,
        Err(SceneError::Config(errors)) => {
            found.extend(all(&errors));
            return Ok(None);
        }
        Err(error) => return Err(error.into()),
    };
    let duration_s = match Simulation::new(&scene) {
        Ok(simulation) => simulation.duration_s(),
        Err(error) => {
            let (key, line) = ("trajectory".to_owned(), document.line_of("trajectory"));
            let (file, problem) = (name.to_owned(), error.to_string());
            found.push(Found { grade: Grade::Error, file, line, key, problem });
            return Ok(None);
        }
    };
    let vehicle_file = document.root()?.text("vehicle")?.unwrap_or_default();
    let mut readable = Readable::new(scene.vehicle, (&vehicle_file, &scene.vehicle_text), found);
    readable.scene = Some((scene.name, duration_s));
    Ok(Some(readable))
}

fn all(errors: &ConfigErrors) -> Vec<Found> {
    let found = |error: &headrace_config::ConfigError| Found {
        grade: Grade::Error,
        file: error.file.clone(),
        line: error.line,
        key: error.key.clone()
            + &error.value.as_ref().map_or_else(String::new, |value| format!(" = {value}")),
        problem: error.problem.clone(),
    };
    errors.errors().iter().map(found).collect()
}

impl Readable {
    /// Checks a vehicle, and adds the findings about it. `name` and `text` are the name and text of the vehicle's file.
    fn new(vehicle: VehicleConfig, (name, text): (&str, &str), found: &mut Vec<Found>) -> Self {
        // The files that the vehicle file names have been read already.
        let named = |file: &str| vehicle.attachments.iter().find(|(attached, _)| attached == file);
        let own = |file: &str| Ok(named(file).map_or(text, |(_, text)| text.as_str()).as_bytes().to_vec());
        let errors = position_error_model::expected_errors(&vehicle, "vehicle.toml", &KINDS, &own);
        let errors = errors.map_err(|why| why.to_string());
        let outlook =
            errors.clone().and_then(|errors| Outlook::of(&vehicle, errors).map_err(|why| why.to_string()));
        let outlook = match outlook {
            Ok(outlook) => outlook,
            Err(why) => {
                let key = "heads".to_owned();
                let problem = format!("can't be used for a plan: {why}");
                let finding = Finding { grade: Grade::Error, key, problem };
                found.push(placed(finding, name, text));
                None
            }
        };
        vehicle_file::log(name, &vehicle);
        let mut findings = vehicle.findings();
        findings.extend(too_many(&vehicle));
        // If the vehicle has errors, the problems of its plan would only repeat these errors.
        if findings.iter().all(|finding| finding.grade != Grade::Error) {
            findings.extend(outlook.iter().flat_map(|outlook| outlook.findings(&vehicle)));
        }
        found.extend(findings.into_iter().map(|finding| placed(finding, name, text)));
        found.sort_by_key(|one| (one.grade == Grade::Warning, one.line));
        let v_max_mps = outlook.as_ref().and_then(Outlook::v_max_mps);
        let cable = Cable::of(&vehicle, text, errors.ok().flatten().as_ref(), v_max_mps);
        Self { vehicle, scene: None, outlook, cable }
    }

    fn text(&self) -> String {
        let vehicle = &self.vehicle;
        let mut lines = Vec::new();
        lines.extend(self.scene.as_ref().map(|(name, duration_s)| format!("{name}: {duration_s:.0} s")));
        lines.push(format!(
            "{}: target {} m, sections of {} m",
            vehicle.name, vehicle.target.max_hole_m, vehicle.section_m
        ));
        lines.push(format!(
            "tunnel {}: perimeter {:.2} m, length {} m",
            vehicle.tunnel.name,
            vehicle.tunnel.profile.perimeter_m(),
            vehicle.tunnel.length_m
        ));
        for sensor in &vehicle.sensor_configs {
            let connect = if sensor.connect.is_empty() { "-" } else { &sensor.connect };
            lines.push(format!("  {:<12} {:<12} {connect}", sensor.id, sensor.plugin));
        }
        match &self.outlook {
            Some(outlook) => lines.extend(outlook.lines()),
            None => lines.push("no profiling head: nothing to plan".to_owned()),
        }
        lines.extend(self.cable.as_ref().map(Cable::line));
        lines.join("\n") + "\n"
    }
}

/// Finding for a vehicle with more sensors than the limit.
fn too_many(vehicle: &VehicleConfig) -> Option<Finding> {
    let count = vehicle.sensor_configs.len();
    let problem =
        format!("{count} sensors; a vehicle has up to {MAX_SOURCES}: leave out this one and those after it");
    (count > MAX_SOURCES).then(|| Finding {
        grade: Grade::Error,
        key: format!("sensors[{MAX_SOURCES}].id"),
        problem,
    })
}

/// Adds to a finding the line that it concerns in the file, and the present value of its key.
fn placed(finding: Finding, name: &str, text: &str) -> Found {
    let Finding { grade, key, problem } = finding;
    let line = Document::new(name, text).line_of(&key);
    Found { grade, file: name.to_owned(), line, key, problem }
}

fn json(readable: Option<&Readable>, found: &[Found], results: Option<&Results>) -> Value {
    let of = |grade: Grade| -> Vec<Value> {
        let one =
            |one: &Found| json!({"file": one.file, "line": one.line, "key": one.key, "problem": one.problem});
        found.iter().filter(|one| one.grade == grade).map(one).collect()
    };
    let mut shown = json!({"errors": of(Grade::Error), "warnings": of(Grade::Warning)});
    if let (Some(readable), Some(shown)) = (readable, shown.as_object_mut()) {
        let vehicle = &readable.vehicle;
        let sensor =
            |s: &headrace_sensor::SensorConfig| json!({"id": s.id, "plugin": s.plugin, "connect": s.connect});
        let entries = [
            ("vehicle", json!(vehicle.name)),
            ("target_m", json!(vehicle.target.max_hole_m)),
            ("section_m", json!(vehicle.section_m)),
            ("tunnel", json!(vehicle.tunnel.name)),
            ("perimeter_m", json!(vehicle.tunnel.profile.perimeter_m())),
            ("length_m", json!(vehicle.tunnel.length_m)),
            ("sensors", vehicle.sensor_configs.iter().map(sensor).collect()),
            ("scene", json!(readable.scene.as_ref().map(|(name, _)| name))),
            ("duration_s", json!(readable.scene.as_ref().map(|(_, duration_s)| duration_s))),
            ("cable", json!(readable.cable.as_ref().map(Cable::json))),
            ("plan", json!(readable.outlook.as_ref().map(Outlook::json))),
            ("devices", json!(results.map(Results::json))),
        ];
        shown.extend(entries.map(|(key, value)| (key.to_owned(), value)));
    }
    shown
}
