//! `headrace import`: converts a foreign log to a headrace log.

use std::cell::Cell;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::iter;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use headrace_config::Document;
use headrace_import::csv::Csv;
use headrace_import::ros::bag::Bag;
use headrace_import::ros::mcap::Mcap;
use headrace_import::ros::{Feeds, MatchError, Topic};
use headrace_import::{
    BEGIN, FileKind, Format, Import, ImportError, Imported, Input, Source, Taker, detect, routing,
};
use headrace_replay::atomic_file::AtomicFile;
use headrace_replay::log::{LogError, LogHeader, LogWriter};
use headrace_vehicle::VehicleConfig;
use serde_json::json;

use crate::cli;
use crate::dive::log_header;
use crate::failure::{self, Failure};
use crate::files;
use crate::logging::complain;
use crate::output::{deliver, say};
use crate::outputs::{Claims, IMPORTED, Kind};
use crate::progress::Progress;
use crate::vehicle_file;

/// Imports a foreign log.
pub(crate) fn import(args: &cli::Import) -> Result<u8, Failure> {
    let kind = match args.format {
        Some(kind) => kind,
        None => kind_of(&args.file)?,
    };
    let vehicle = args.vehicle.as_deref().map(vehicle_file::read).transpose()?;
    let mut inputs: Vec<PathBuf> = iter::once(&args.file).chain(&args.map).cloned().collect();
    if let (Some(path), Some((_, vehicle))) = (&args.vehicle, &vehicle) {
        inputs.extend(vehicle_file::files(path, vehicle));
    }
    let mut header = match &vehicle {
        Some((text, vehicle)) => log_header(vehicle, text, false),
        None => LogHeader {
            metadata: [("version".to_owned(), env!("CARGO_PKG_VERSION").to_owned())].into(),
            ..LogHeader::default()
        },
    };
    let mut takers = routing::takers(kind, vehicle.as_ref().map(|(_, vehicle)| vehicle), &args.source)?;
    if vehicle.is_none() {
        header.sources = routing::sources(kind, &args.source);
    }
    Claims::reading(inputs, &args.overwrite).claim("-o", &args.output, Kind::Import)?;
    let name = args.file.display().to_string();
    let file = files::open(&args.file)?;
    let read = Rc::new(Cell::new(0));
    let file = Counted { file, read: Rc::clone(&read) };
    let vehicle = vehicle.as_ref().map(|(_, vehicle)| vehicle);
    if kind == FileKind::Mcap {
        let recording = Mcap::open(&name, file).map_err(|error| unusable(&args.file, error))?;
        let feeds = feeds(args, vehicle, &recording.topics())?;
        return write(args, kind, recording.feeding(feeds), header, &mut takers, &read);
    }
    let format = format(kind, args, vehicle)?;
    write(args, kind, Input::new(&name, file, format), header, &mut takers, &read)
}

/// A file that counts the bytes read from it.
struct Counted {
    file: File,
    read: Rc<Cell<u64>>,
}

impl Read for Counted {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let count = self.file.read(into)?;
        self.read.set(self.read.get() + count as u64);
        Ok(count)
    }
}

impl Seek for Counted {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

/// Writes the log with the messages that are assigned to sensors.
fn write<S: Source>(
    args: &cli::Import,
    kind: FileKind,
    input: S,
    mut header: LogHeader,
    takers: &mut [Taker],
    read: &Cell<u64>,
) -> Result<u8, Failure> {
    let of_bytes = files::bytes(std::slice::from_ref(&args.file));
    let import = Import::of(input, kind.entries()).map_err(|error| unusable(&args.file, error))?;
    header.metadata.extend(import.clock_metadata());
    header.metadata.insert(IMPORTED.to_owned(), kind.name().to_owned());
    header.metadata.insert("import_file".to_owned(), file_name(&args.file));
    let ids: Vec<String> = header.sources.iter().map(|source| source.id.clone()).collect();
    let failed = |source| Failure::Write { path: args.output.clone(), source };
    let mut log = LogWriter::new(AtomicFile::create(&args.output).map_err(failed)?, &header)
        .map_err(Failure::writing(&args.output))?;
    let mut progress = Progress::start();
    let imported = import.write(&mut log, takers, &mut |entries| {
        let share = read.get() as f64 / of_bytes as f64;
        progress.at(|| (format!("{entries} {}s", kind.entries()), Some(share)));
    })?;
    let (file, _) = log.finish().map_err(Failure::writing(&args.output))?;
    file.complete().map_err(failed)?;
    drop(progress);
    tell(args, kind, &ids, &imported)
}

fn format(
    kind: FileKind,
    args: &cli::Import,
    vehicle: Option<&VehicleConfig>,
) -> Result<Box<dyn Format>, Failure> {
    if args.map.is_some() != (kind == FileKind::Csv) && kind != FileKind::Rosbag {
        let what = "import: --map MAPPING.toml assigns the columns of CSV files and the topics of ROS recordings; CSV requires it; formats \
                    other than CSV and ROS refuse it";
        return Err(Failure::Usage(what.to_owned()));
    }
    if let Some(format) = kind.format(&file_name(&args.file)) {
        return Ok(format);
    }
    if kind != FileKind::Csv {
        let file = files::open(&args.file)?;
        let topics = Bag::topics(&args.file.display().to_string(), file)
            .map_err(|error| unusable(&args.file, error))?;
        return Ok(Box::new(Bag::new(feeds(args, vehicle, &topics)?)));
    }
    let (Some(map), Some(vehicle)) = (&args.map, vehicle) else {
        let what = "import: CSV needs --vehicle VEHICLE.toml, to encode values for its sensors";
        return Err(Failure::Usage(what.to_owned()));
    };
    let (text, name) = (files::read(map)?, map.display().to_string());
    let front = String::from_utf8_lossy(&front_of(&args.file, 1 << 16)?).into_owned();
    Ok(Box::new(Document::new(&name, &text).read(|mapping| Csv::new(mapping, vehicle, &front))?))
}

/// Name of a file without its folder.
fn file_name(path: &Path) -> String {
    path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}

/// Prints a summary; returns the exit code.
fn tell(args: &cli::Import, kind: FileKind, ids: &[String], imported: &Imported) -> Result<u8, Failure> {
    let counts = |id: &usize| imported.messages.get(*id).copied().unwrap_or(0);
    let heard: u64 = imported.messages.iter().sum();
    let seconds = imported.last.since(BEGIN).as_secs_f64();
    if args.json {
        let sources: serde_json::Map<String, serde_json::Value> =
            ids.iter().enumerate().map(|(number, id)| (id.clone(), json!(counts(&number)))).collect();
        let shown = json!({
            "format": kind.name(), "entries": imported.entries, "passed_over": imported.passed_over,
            "duration_s": seconds, "messages": sources, "losses": imported.losses, "remarks": imported.remarks,
        });
        deliver(&shown.to_string())?;
    } else {
        say(&format!(
            "{}: {} {}s in {seconds:.1} s, {heard} messages in {}",
            args.file.display(),
            imported.entries,
            kind.entries(),
            args.output.display()
        ));
        for (number, id) in ids.iter().enumerate() {
            say(&format!("  {id:<12} {} messages", counts(&number)));
        }
        if imported.passed_over > 0 {
            say(&format!(
                "  {} {}s belong to no sensor of the vehicle file",
                imported.passed_over,
                kind.entries()
            ));
        }
    }
    for remark in &imported.remarks {
        complain(&format!("headrace: note: {remark}"));
    }
    for loss in &imported.losses {
        complain(&format!("headrace: lost: {loss}"));
    }
    if heard == 0 {
        complain("headrace: no message of this file belongs to a sensor of the vehicle file");
        return Ok(failure::FAILED);
    }
    Ok(if imported.losses.is_empty() { failure::OK } else { failure::DATA_LOST })
}

/// Kind of a file by its extension.
///
/// Dataflash logs of autopilots have the same extension as Ping Viewer's logs. Dataflash logs are refused before any
/// other check.
fn kind_of(path: &Path) -> Result<FileKind, Failure> {
    let kind = FileKind::of(path);
    if kind == Some(FileKind::Ping)
        && front_of(path, detect::ENOUGH_BYTES as u64)?.starts_with(&detect::DATAFLASH)
    {
        return Err(named(path, &format!("importing {}: not a Ping Viewer log", path.display())));
    }
    kind.map_or_else(
        || {
            let problem = "the file name doesn't show the format; expected .tlog, .log (candump), .852, .81a, .81b, \
                 .81s, .31l (imagenex), .bin (ping), .json, .jsonl (a50), .csv, .bag (rosbag) and .mcap (of ROS); \
                 for another name, give --format tlog|candump|imagenex|ping|a50|csv|rosbag|mcap";
            Err(named(path, &format!("importing {}: {problem}", path.display())))
        },
        Ok,
    )
}

/// Error for a file that can't be imported. The text names the kind that the file seems to be, if this isn't the
/// expected kind.
fn unusable(path: &Path, error: ImportError) -> Failure {
    match error {
        ImportError::Nothing { .. }
        | ImportError::NoBag { .. }
        | ImportError::Log(LogError::NotMcap { .. }) => named(path, &error.to_string()),
        ImportError::DiveLog { .. } => Failure::Usage(error.to_string()),
        error => error.into(),
    }
}

/// Error for a file of the wrong kind. The text names the kind of file that it seems to be.
fn named(path: &Path, problem: &str) -> Failure {
    let front = match front_of(path, detect::ENOUGH_BYTES as u64) {
        Ok(front) => front,
        Err(failure) => return failure,
    };
    let looks = detect::looks_like(&front).map(|words| format!("; its content: {words}"));
    Failure::Usage(format!("{problem}{}", looks.unwrap_or_default()))
}

/// The first bytes of a file, at most `bytes`.
fn front_of(path: &Path, bytes: u64) -> Result<Vec<u8>, Failure> {
    let mut front = Vec::new();
    let mut file = files::open(path)?.take(bytes);
    file.read_to_end(&mut front).map_err(|source| Failure::Read { path: path.to_owned(), source })?;
    Ok(front)
}

/// Assignment of topics to sensors.
///
/// It comes from the mapping file. Without such a file, unambiguous matches are used and listed on stderr.
fn feeds(args: &cli::Import, vehicle: Option<&VehicleConfig>, topics: &[Topic]) -> Result<Feeds, Failure> {
    let Some(vehicle) = vehicle else {
        let what = "import: ROS recordings need --vehicle VEHICLE.toml, to encode values for its sensors";
        return Err(Failure::Usage(what.to_owned()));
    };
    let Some(map) = &args.map else {
        let feeds = Feeds::matching(vehicle, topics).map_err(|error| unmatched(args, error))?;
        for matched in feeds.matched() {
            complain(&format!("headrace: {matched}"));
        }
        return Ok(feeds);
    };
    let (text, name) = (files::read(map)?, map.display().to_string());
    let mapping = Document::new(&name, &text).root()?;
    Feeds::mapped(&mapping, vehicle, topics).map_err(|error| unmatched(args, error))
}

fn unmatched(args: &cli::Import, error: MatchError) -> Failure {
    match error {
        MatchError::Mapping(error) => error.into(),
        error => Failure::Usage(format!("importing {}: {error}", args.file.display())),
    }
}
