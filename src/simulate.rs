//! `headrace simulate`: writes a scene as a log, with its ground truth.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use headrace_config::Document;
use headrace_devices::KINDS;
use headrace_geometry::time::MonoNs;
use headrace_replay::atomic_file::AtomicFile;
use headrace_replay::log::LogWriter;
use headrace_replay::simulation;
use headrace_sensor::device::Direction;
use headrace_simulator::environment::What;
use headrace_simulator::{START, Scene, Simulation, SoundingTruth, Take, TruthRow};
use serde_json::json;

use crate::cli::{Explain, Simulate, TakeWhat};
use crate::dive::log_header;
use crate::explain::{explain, worth_of};
use crate::failure::{self, Failure};
use crate::files::{self, Beside};
use crate::output::{append, deliver, say};
use crate::outputs::{Claims, Kind, SIMULATED, TRUTH};
use crate::phase::Phase;
use crate::progress::Progress;

/// Runs `headrace simulate`.
pub(crate) fn simulate(args: &Simulate) -> Result<u8, Failure> {
    let text = files::read(&args.scene)?;
    let name = args.scene.display().to_string();
    let beside = Beside::of(&args.scene);
    let load = |name: &str| beside.load(name);
    let take = args.take.map(|take| match take {
        TakeWhat::Only => Take::Only,
        TakeWhat::Called => Take::Called,
    });
    let read = |seed| Scene::parse_taking(Document::new(&name, &text), &KINDS, &load, seed, take);
    let scene = read(args.seed)?;
    match args.explain {
        Some(Explain::List) => return explain(&scene, None, args.json),
        Some(Explain::Worth) => {
            let seeds = (scene.seed..).take(usize::from(args.seeds));
            let mut scenes = seeds.map(|seed| read(Some(seed))).collect::<Result<Vec<_>, _>>()?;
            let worth = worth_of(&mut scenes)?;
            return explain(&scene, Some(&worth), args.json);
        }
        None => {}
    }
    let Some(output) = &args.output else {
        let what = "simulate: needs -o LOG.mcap for the log, or --explain to list what would be simulated";
        return Err(Failure::Usage(what.to_owned()));
    };
    let mut claims = Claims::reading(beside.files(), &args.overwrite);
    claims.claim("-o", output, Kind::Simulation)?;
    if let Some(truth) = &args.truth {
        claims.claim("--truth", truth, Kind::Truth)?;
    }
    let mut simulation = simulation(&scene, args.truth.is_some())?;
    let mut truth = args.truth.as_deref().map(|path| Truth::create(path, &scene, &simulation)).transpose()?;
    let mut header = log_header(&scene.vehicle, &scene.vehicle_text, false);
    header.metadata.insert(SIMULATED.to_owned(), scene.name.clone());
    let failed = |source| Failure::Write { path: output.clone(), source };
    let mut writer = LogWriter::new(AtomicFile::create(output).map_err(failed)?, &header)
        .map_err(Failure::writing(output))?;
    let _phase = Phase::start("simulate");
    let mut progress = Progress::start();
    let (longest_s, at_most) = (simulation.duration_s(), if scene.is_advised() { "at most " } else { "" });
    while let Some(message) = simulation.next_message() {
        let after_s = message.at.since(START).as_secs_f64();
        progress.at(|| (format!("{after_s:.0} s of {at_most}{longest_s:.0} s"), Some(after_s / longest_s)));
        let written = match message.direction {
            Direction::Received => writer.raw(message.source, message.at, message.at, message.bytes),
            Direction::Sent => writer.sent(message.source, message.at, message.bytes),
        };
        written.map_err(Failure::writing(output))?;
        if let Some(truth) = &mut truth {
            truth.write(&scene, &simulation.take_truth())?;
        }
    }
    // If the simulated pilot follows advice, the duration of the dive is known only after the simulation.
    let duration_s = simulation.duration_s();
    let (file, written) = writer.finish().map_err(Failure::writing(output))?;
    file.complete().map_err(failed)?;
    let truth = truth.map(Truth::finish).transpose()?;
    drop(progress);
    if args.json {
        let shown = json!({
            "scene": scene.name, "seed": scene.seed, "duration_s": duration_s, "messages": written.messages,
            "bytes": written.bytes, "truth_rows": truth,
        });
        deliver(&shown.to_string())?;
    } else {
        say(&format!(
            "{}: {duration_s:.1} s of {}, seed {}, {} messages, {} bytes in {}",
            scene.name,
            scene.vehicle.name,
            scene.seed,
            written.messages,
            written.bytes,
            output.display()
        ));
        if let (Some(rows), Some(path)) = (truth, &args.truth) {
            say(&format!("ground truth of {rows} measurements in {}", path.display()));
        }
    }
    Ok(failure::OK)
}

/// Writer of the ground truth as CSV, with a row per measurement.
struct Truth {
    path: PathBuf,
    file: AtomicFile,
    effects: Vec<&'static str>,
    features: Vec<String>,
    rows: u64,
}

const COLUMNS: &str = "time_s,source,sense,number,chainage_m,x_m,y_m,z_m,roll_deg,pitch_deg,yaw_deg,angle_deg,\
                       wall_x_m,wall_y_m,wall_z_m,arc_m,wall,true_range_m,measured_range_m,effects";

impl Truth {
    fn create(path: &Path, scene: &Scene, simulation: &Simulation) -> Result<Self, Failure> {
        let failed = |source| Failure::Write { path: path.to_owned(), source };
        let file = AtomicFile::create(path).map_err(failed)?;
        let effects = simulation.added().iter().map(|added| added.effect).collect();
        let features =
            simulation.scenery().map(|scenery| scenery.environment.features().to_vec()).unwrap_or_default();
        let mut truth = Self { path: path.to_owned(), file, effects, features, rows: 0 };
        truth.line(&format!("{TRUTH}{}, seed {}", scene.name.replace('\n', " "), scene.seed))?;
        truth.line(COLUMNS)?;
        Ok(truth)
    }

    fn write(&mut self, scene: &Scene, rows: &[TruthRow]) -> Result<(), Failure> {
        for row in rows {
            let line = self.row(scene, row);
            self.line(&line)?;
            self.rows += 1;
        }
        Ok(())
    }

    /// Moves the finished CSV file to its path, and returns its number of rows.
    fn finish(self) -> Result<u64, Failure> {
        let Self { path, file, rows, .. } = self;
        file.complete().map_err(|source| Failure::Write { path, source })?;
        Ok(rows)
    }

    fn line(&mut self, text: &str) -> Result<(), Failure> {
        writeln!(self.file, "{text}").map_err(|source| Failure::Write { path: self.path.clone(), source })
    }

    fn row(&self, scene: &Scene, row: &TruthRow) -> String {
        let id =
            scene.vehicle.sensor_configs.get(usize::from(row.source)).map_or("", |sensor| sensor.id.as_str());
        let (position, (roll, pitch, yaw)) = (row.pose.position, row.pose.attitude.roll_pitch_yaw());
        let mut text = format!(
            "{},{id},{},{},{},{},{},{},{},{},{}",
            seconds(row.at),
            row.sense.as_str().replace(' ', "_"),
            row.number,
            row.chainage_m,
            position.x(),
            position.y(),
            position.z(),
            roll.to_degrees(),
            pitch.to_degrees(),
            yaw.to_degrees()
        );
        match &row.sounding {
            Some(sounding) => text.push_str(&self.sounding(sounding)),
            None => text.push_str(",,,,,,,,,"),
        }
        let causes = row.causes.iter().map(|cause| {
            let effect = self.effects.get(usize::from(cause.effect)).copied().unwrap_or("");
            let value = |value: f64| if value.is_nan() { "none".to_owned() } else { value.to_string() };
            format!("{effect} {} {} -> {}", cause.what, value(cause.from), value(cause.to))
        });
        text.push_str(&causes.collect::<Vec<_>>().join("; "));
        text
    }

    /// Columns of the ground truth for a sounding.
    fn sounding(&self, sounding: &SoundingTruth) -> String {
        let mut text = format!(",{}", sounding.measured.angle_rad.to_degrees());
        match &sounding.wall {
            Some((hit, arc_m)) => append(
                &mut text,
                format_args!(
                    ",{},{},{},{arc_m},{},{}",
                    hit.point.x(),
                    hit.point.y(),
                    hit.point.z(),
                    self.wall(hit.what),
                    hit.range_m
                ),
            ),
            None => text.push_str(",,,,,,"),
        }
        match sounding.measured.range_m {
            Some(range_m) => append(&mut text, format_args!(",{range_m},")),
            None => text.push_str(",,"),
        }
        text
    }

    fn wall(&self, what: What) -> &str {
        match what {
            What::Wall => "wall",
            What::Feature(number) => self.features.get(usize::from(number)).map_or("feature", String::as_str),
        }
    }
}

/// A time on the dive's clock, seconds, exact to the nanosecond.
fn seconds(at: MonoNs) -> String {
    format!("{}.{:09}", at.0 / 1_000_000_000, at.0 % 1_000_000_000)
}
