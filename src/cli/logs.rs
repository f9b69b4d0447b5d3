//! Options of commands that split or convert logs.

use std::path::PathBuf;

use clap::Args;
use headrace_geometry::time::DurNs;
use headrace_import::FileKind;

use super::common_options::{Overwrite, Threads};
use super::value_parsers::{chainage_range, file_kind, length, source_line, time};

#[derive(Debug, Args)]
pub(crate) struct Export {
    /// Log to export, or the parts of a recording.
    #[arg(required = true, value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
    /// Page to write.
    #[arg(long, value_name = "OUT.html")]
    pub(crate) html: PathBuf,
    /// Vehicle file, overriding the one attached to the log.
    #[arg(long, value_name = "FILE")]
    pub(crate) vehicle: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) overwrite: Overwrite,
}

#[derive(Debug, Args)]
pub(crate) struct Deliver {
    /// Log of the dive, or the parts of a recording.
    #[arg(required = true, value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
    /// Folder to write. It must be empty or absent.
    #[arg(short, long, value_name = "FOLDER")]
    pub(crate) output: PathBuf,
    /// File with the facts for the cover: plant, tunnel, client, date, and crew (a list).
    #[arg(long, value_name = "FILE.toml")]
    pub(crate) about: Option<PathBuf>,
    /// Name of the plant. This and the following options override the file.
    #[arg(long, value_name = "NAME")]
    pub(crate) plant: Option<String>,
    /// Name of the tunnel.
    #[arg(long, value_name = "NAME")]
    pub(crate) tunnel: Option<String>,
    /// Client of the inspection.
    #[arg(long, value_name = "NAME")]
    pub(crate) client: Option<String>,
    /// Date of the dive.
    #[arg(long, value_name = "DATE")]
    pub(crate) date: Option<String>,
    /// Member of the crew. Give it once per member.
    #[arg(long, value_name = "NAME")]
    pub(crate) crew: Vec<String>,
    /// Distance between the report's cross-sections, metres. The default gives at most 24 of them; at most 2,000 are allowed.
    #[arg(long, value_name = "METRES", value_parser = length)]
    pub(crate) every: Option<f64>,
    /// Vehicle file, overriding the one attached to the log.
    #[arg(long, value_name = "FILE")]
    pub(crate) vehicle: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) threads: Threads,
    #[command(flatten)]
    pub(crate) overwrite: Overwrite,
}

#[derive(Debug, Args)]
pub(crate) struct Notes {
    /// Log to read, or the parts of a recording.
    #[arg(required = true, value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
    /// Folder for the recordings of voice notes: note-3.webm, in the browser's format (.webm, .ogg or .m4a).
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) overwrite: Overwrite,
}

#[derive(Debug, Args)]
pub(crate) struct Dives {
    /// Folder of recordings and their reports.
    #[arg(default_value = ".", value_name = "FOLDER")]
    pub(crate) folder: PathBuf,
    /// Print JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Verify {
    /// Log to verify, or the parts of a recording.
    #[arg(required = true, value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
    /// Vehicle file, overriding the one attached to the log.
    #[arg(long, value_name = "FILE")]
    pub(crate) vehicle: Option<PathBuf>,
    /// Tick length, milliseconds. Results don't depend on it.
    #[arg(long, value_name = "MS", default_value = "20", value_parser = clap::value_parser!(u32).range(1..=60_000))]
    pub(crate) tick_ms: u32,
    #[command(flatten)]
    pub(crate) threads: Threads,
    /// Print JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Recover {
    /// Log to recover, or the parts of a recording, which become one log. The input isn't modified.
    #[arg(required = true, value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
    /// Log to write.
    #[arg(short, long, value_name = "FIXED.mcap")]
    pub(crate) output: PathBuf,
    /// Print the summary as JSON.
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) overwrite: Overwrite,
}

#[derive(Debug, Args)]
pub(crate) struct Trim {
    /// Log to trim, or the parts of a recording. The input isn't modified.
    #[arg(required = true, value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
    /// Log to write.
    #[arg(short, long, value_name = "TRIMMED.mcap")]
    pub(crate) output: PathBuf,
    /// Start, as dive time: 90s, 10min, 1.5h.
    #[arg(long, value_name = "TIME", value_parser = time, conflicts_with = "chainage")]
    pub(crate) from: Option<DurNs>,
    /// End, as dive time.
    #[arg(long, value_name = "TIME", value_parser = time, conflicts_with = "chainage")]
    pub(crate) to: Option<DurNs>,
    /// Keep the times at which the vehicle was in this range of chainage, metres. The log is replayed to find
    /// them.
    #[arg(long, value_name = "FROM..TO", value_parser = chainage_range, allow_hyphen_values = true)]
    pub(crate) chainage: Option<[f64; 2]>,
    /// Drop echo data if a device's messages also contain the range. Replays give the same results.
    #[arg(long)]
    pub(crate) drop_echoes: bool,
    /// Remove names, comments, addresses, serial numbers, time of day and geographic positions. Lists items
    /// that can't be removed.
    #[arg(long)]
    pub(crate) anonymise: bool,
    /// Vehicle file for --chainage and --drop-echoes, overriding the one attached to the log.
    #[arg(long, value_name = "FILE", conflicts_with = "anonymise")]
    pub(crate) vehicle: Option<PathBuf>,
    /// Print the summary as JSON.
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) overwrite: Overwrite,
}

#[derive(Debug, Args)]
pub(crate) struct Import {
    /// Log to import.
    pub(crate) file: PathBuf,
    /// Log to write.
    #[arg(short, long, value_name = "LOG.mcap")]
    pub(crate) output: PathBuf,
    /// Vehicle file with the sensors that the messages come from.
    #[arg(long, value_name = "VEHICLE.toml")]
    pub(crate) vehicle: Option<PathBuf>,
    /// Sensor, and the stream of the log that it receives (mavlink, imagenex, ping, a50, or a CAN interface).
    /// Give it once per sensor; it replaces the assignment by the vehicle file.
    #[arg(long, value_name = "ID=STREAM", value_parser = source_line)]
    pub(crate) source: Vec<(String, String)>,
    /// Mapping file. For CSV it maps columns to quantities of sensors, and to their confidence, validity, status
    /// or variance; for ROS, topics to sensors if they are ambiguous.
    #[arg(long, value_name = "MAPPING.toml")]
    pub(crate) map: Option<PathBuf>,
    /// Format of the file, if its extension doesn't show it.
    #[arg(long, value_parser = file_kind())]
    pub(crate) format: Option<FileKind>,
    /// Print a summary as JSON.
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) overwrite: Overwrite,
}
