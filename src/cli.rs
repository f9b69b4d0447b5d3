//! The command line.

mod value_parsers;

use std::path::PathBuf;

use clap::{ArgAction, Args, Parser, Subcommand};
use headrace_geometry::time::DurNs;
use headrace_import::FileKind;
use headrace_replay::log::Every;
use headrace_sampling::layout::HeadLayout;
use headrace_sensor::connect::Connect;
use tracing::level_filters::LevelFilter;

pub(crate) use value_parsers::{Speed, speed, time};
use value_parsers::{
    address, chainage, chainage_range, drift, file_kind, hours, layout, length, place, rotation, seconds,
    seconds_range, section, sound_speed, source_line, speed_mps, target, yaw,
};

/// What `replay --interactive` understands.
pub(crate) const COMMANDS: &str =
    "pause, go, step [TICKS], seek TIME, ahead TIME, back TIME, speed N|max, end";

/// On-board coverage monitor for sonar inspection of flooded hydroelectric tunnels.
#[derive(Debug, Parser)]
#[command(version, arg_required_else_help = true)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
    #[command(flatten)]
    pub(crate) verbosity: Verbosity,
}

/// How much is logged on stderr.
#[derive(Debug, Args)]
#[command(next_help_heading = "Log messages, on stderr")]
pub(crate) struct Verbosity {
    /// Log ports, files, phases and their durations too; -vv logs everything.
    ///
    /// Without it only warnings and errors are logged. RUST_LOG sets the level (error, warn, info, debug, trace, off) by
    /// crate or module: RUST_LOG=headrace_ports=debug,headrace_replay::log=trace.
    #[arg(short, long, action = ArgAction::Count, global = true)]
    verbose: u8,
    /// Log errors only.
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    quiet: bool,
}

impl Verbosity {
    /// The level of this program's crates; `None` where nothing is asked for.
    pub(crate) fn level(&self) -> Option<LevelFilter> {
        match (self.quiet, self.verbose) {
            (true, _) => Some(LevelFilter::ERROR),
            (false, 0) => None,
            (false, 1) => Some(LevelFilter::DEBUG),
            (false, _) => Some(LevelFilter::TRACE),
        }
    }
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Show a simulated dive: no hardware, no arguments; it ends by itself.
    ///
    /// VITA 2 with four heads in the Ceran tunnel, most of the way at a speed that is right and for a stretch too fast.
    #[command(after_help = "Example:\n  headrace demo --speed max --out /tmp/demo")]
    Demo(Demo),
    /// The dive itself: every sensor on its own port, recorded, until it is interrupted.
    ///
    /// A sensor that isn't there is tried for ever, and the dive goes on with the others, unless --require names it. With
    /// --source a recorded dive takes the ports' place.
    #[command(
        after_help = "Example:\n  headrace run vehicle.toml --record dive.mcap --require imu,sonar_0\n  headrace run vehicle.toml --record dive.mcap --rotate 1GiB\n  headrace run vehicle.toml --source dive.mcap --record again.mcap"
    )]
    Run(Run),
    /// Run a recorded dive through the very same loop.
    ///
    /// With --smooth twice: once as it was, and once along the track that all sensors agree on over the whole dive.
    #[command(
        after_help = "Example:\n  headrace replay dive.mcap --target 0.6 --report report.json\n  headrace replay dive.mcap --target 0.3,0.6,1.0 --section 0.25,1\n  headrace replay dive.mcap --smooth --report certificate.json\n  headrace replay dive.part*.mcap\n  headrace replay dive.mcap --expect golden.json --bless"
    )]
    Replay(Replay),
    /// Replay a dive and hold it against what it published live: the same, or where they first part.
    ///
    /// Names the tick, the sensor, the field and both values down to the bit. Exit code 4 when they part, 3 when they don't but
    /// the log has lost data.
    #[command(after_help = "Example:\n  headrace verify dive.mcap")]
    Verify(Verify),
    /// Rewrite what reads of a damaged log into an orderly one, and say what is lost.
    ///
    /// The new log replays to the same digest, and says itself what is missing, so that its reports do, too. Exit code 3
    /// when something is.
    #[command(after_help = "Example:\n  headrace recover dive.mcap -o recovered.mcap")]
    Recover(Recover),
    /// Cut a log down to what is to be handed on: some minutes, some metres, without echoes, without what tells whose it is.
    ///
    /// The new log says what was cut out of it, as a loss, and holds no results of the dive then; with nothing cut it replays to
    /// the same digest. Exit code 3 when the log itself has lost data.
    #[command(
        after_help = "Example:\n  headrace trim dive.mcap -o part.mcap --from 10min --to 20min\n  headrace trim dive.mcap -o bend.mcap --chainage 120..340 --drop-echoes\n  headrace trim dive.mcap -o public.mcap --anonymise"
    )]
    Trim(Trim),
    /// Turn a scene into a log of the bytes that its devices would send.
    ///
    /// Only the effects that the scene names are simulated; --explain lists what that comes to.
    #[command(after_help = SIMULATE_EXAMPLES)]
    Simulate(Simulate),
    /// Turn a foreign log into one of ours: telemetry of MAVLink, candump, files of Imagenex, logs of Ping Viewer, CSV.
    ///
    /// Each message goes to the sensors of the vehicle file that would have heard it; the vehicle file is attached to the log.
    /// Exit code 3 when something of the file was lost, 1 when no sensor takes anything of it.
    #[command(after_help = IMPORT_EXAMPLES)]
    Import(Import),
    /// Plan an inspection: spacing, speed and hours for a tunnel, modes, heads, layout and target.
    ///
    /// A target asks how fast one may go; a speed or the hours ask which target they allow. Exit code 1 when no mode
    /// gives what is asked.
    #[command(after_help = PLAN_EXAMPLES)]
    Plan(Plan),
    /// Find from a log how sensors sit, where they count from and how late they are: values for the vehicle file.
    ///
    /// Heads by a turn or more while the vehicle stands still beside the tunnel's middle; the surface by --at-surface; cable
    /// counters by --chainage; time offsets by a dive that turns and rolls. What the log can't tell is said, and why. Exit
    /// code 1 when nothing can be told.
    #[command(after_help = CALIBRATE_EXAMPLES)]
    Calibrate(Calibrate),
    /// Put a scene's devices on real ports, at real speed, for a rehearsal of the dive.
    ///
    /// Prints a vehicle file that `headrace run` takes. The vehicle stands until all its sensors are called, and then a while;
    /// the command ends when the way has.
    #[command(
        after_help = "Example:\n  headrace emulate deploy/scenes/demo.toml --out /tmp/rehearsal\n  headrace run /tmp/rehearsal/vehicle.toml"
    )]
    Emulate(Emulate),
    /// Show what is plugged in, who may open it, and what is missing, each with the line that mends it.
    ///
    /// Nothing is opened, unless --probe or --address asks for it: then 881 heads and Ping devices say what they are, with
    /// one short ping and no movement. Not while a dive runs; and other devices on serial ports get bytes that aren't for
    /// them. With --vehicle exit code 1 when a sensor's port isn't there or may not be opened.
    #[command(
        after_help = "Example:\n  headrace devices\n  headrace devices --probe --address tcp:192.168.0.5:4040\n  headrace devices --vehicle vehicle.toml"
    )]
    Devices(Devices),
    /// Say what is wrong with a vehicle file, or what it describes.
    #[command(after_help = "Example:\n  headrace check deploy/vehicles/vita2-4.toml")]
    Check(Check),
}

#[derive(Debug, Args)]
pub(crate) struct Demo {
    /// Folder for the report and the log of the dive.
    #[arg(long, value_name = "DIR", default_value = "headrace-demo")]
    pub(crate) out: PathBuf,
    #[arg(long, value_name = "max|Nx", default_value = "20x", value_parser = speed, help = SPEED_HELP)]
    pub(crate) speed: Speed,
}

#[derive(Debug, Args)]
pub(crate) struct Run {
    /// Vehicle file.
    pub(crate) vehicle: PathBuf,
    /// Log whose messages take the place of the ports'; or the folder of a recording in parts.
    #[arg(long, value_name = "LOG.mcap", conflicts_with_all = ["require", "require_within", "duration", "no_record"])]
    pub(crate) source: Option<PathBuf>,
    /// Log to write; on ports it is dive-SECONDS.mcap in this folder unless said otherwise.
    #[arg(long, value_name = "LOG.mcap")]
    pub(crate) record: Option<PathBuf>,
    /// Record in parts, each a log of its own (dive.part001.mcap for dive.mcap): a new one once there are so many bytes (1GiB,
    /// 500MB) or so much time (30min, 2h) in the last.
    #[arg(long, value_name = "1GiB|30min", value_parser = rotation, conflicts_with = "no_record")]
    pub(crate) rotate: Option<Every>,
    /// Write no log.
    #[arg(long, conflicts_with = "record")]
    pub(crate) no_record: bool,
    /// Sensors without which the dive ends, by their ids, or all.
    #[arg(long, value_name = "ID,..", value_delimiter = ',')]
    pub(crate) require: Vec<String>,
    /// Seconds that a required sensor has until it runs.
    #[arg(long, value_name = "SECONDS", default_value = "30", value_parser = seconds, requires = "require")]
    pub(crate) require_within: f64,
    /// End the dive after so many seconds.
    #[arg(long = "for", value_name = "SECONDS", value_parser = seconds)]
    pub(crate) duration: Option<f64>,
    #[arg(long, value_name = "max|Nx", default_value = "1x", value_parser = speed, help = SPEED_HELP)]
    pub(crate) speed: Speed,
    #[command(flatten)]
    pub(crate) output: Output,
}

#[derive(Debug, Args)]
pub(crate) struct Emulate {
    /// Scene file.
    pub(crate) scene: PathBuf,
    /// Folder for the vehicle file of the rehearsal.
    #[arg(long, value_name = "DIR", default_value = "headrace-rehearsal")]
    pub(crate) out: PathBuf,
    /// Seed of the random numbers, in place of the scene's.
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// Address on which the devices of the network listen.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1")]
    pub(crate) listen: std::net::IpAddr,
    /// Seconds for which the vehicle stands once all sensors are called: heads find their places.
    #[arg(long, value_name = "SECONDS", default_value = "8", value_parser = seconds)]
    pub(crate) stand: f64,
    /// Seconds for which the devices go on once the way has ended.
    #[arg(long, value_name = "SECONDS", default_value = "5", value_parser = seconds)]
    pub(crate) linger: f64,
}

#[derive(Debug, Args)]
pub(crate) struct Replay {
    /// Log to replay, or the parts of a recording: their files, their folder, or the name that --record was given.
    #[arg(required = true, value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
    /// Vehicle file, in place of the one attached to the log.
    #[arg(long, value_name = "FILE")]
    pub(crate) vehicle: Option<PathBuf>,
    /// Target T in metres, in place of the vehicle file's; with several, what the others would have said is told too.
    #[arg(long, value_name = "METRES,..", value_parser = target, value_delimiter = ',')]
    pub(crate) target: Vec<f64>,
    /// Length of a section in metres, in place of the vehicle file's; with several, as for targets.
    #[arg(long, value_name = "METRES,..", value_parser = section, value_delimiter = ',')]
    pub(crate) section: Vec<f64>,
    /// Speed of sound in the tunnel's water in metres a second, in place of the vehicle file's.
    #[arg(long, value_name = "M/S", value_parser = sound_speed)]
    pub(crate) sound_speed: Option<f64>,
    #[arg(long, value_name = "max|Nx", default_value = "max", value_parser = speed, help = SPEED_HELP)]
    pub(crate) speed: Speed,
    /// Length of a tick in milliseconds; no result depends on it.
    #[arg(long, value_name = "MS", default_value = "20", value_parser = clap::value_parser!(u32).range(1..=60_000))]
    pub(crate) tick_ms: u32,
    /// Show the dive from this time on (90s, 1h20min, 1:23:45). What came before is played as fast as possible and counts
    /// all the same.
    #[arg(long, value_name = "TIME", value_parser = time, conflicts_with = "smooth")]
    pub(crate) from: Option<DurNs>,
    #[arg(short, long, conflicts_with = "smooth", help = format!("Take lines from standard input while it plays: {COMMANDS}"))]
    pub(crate) interactive: bool,
    /// Judge by the smoothed track: what was learnt later corrects where the vehicle was before. Says what that changed.
    #[arg(long, conflicts_with = "speed")]
    pub(crate) smooth: bool,
    /// Report to compare with; exit code 1 when verdicts, holes or the digest differ.
    #[arg(long, value_name = "GOLDEN.json")]
    pub(crate) expect: Option<PathBuf>,
    /// Say what has changed against the golden report, and make this one the golden one.
    #[arg(long, requires = "expect")]
    pub(crate) bless: bool,
    #[command(flatten)]
    pub(crate) output: Output,
}

#[derive(Debug, Args)]
pub(crate) struct Verify {
    /// Log to verify, or the parts of a recording.
    #[arg(required = true, value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
    /// Vehicle file, in place of the one attached to the log.
    #[arg(long, value_name = "FILE")]
    pub(crate) vehicle: Option<PathBuf>,
    /// Length of a tick in milliseconds; no result depends on it.
    #[arg(long, value_name = "MS", default_value = "20", value_parser = clap::value_parser!(u32).range(1..=60_000))]
    pub(crate) tick_ms: u32,
    /// Print JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Recover {
    /// Log to recover, or the parts of a recording, which become one log; they are only read.
    #[arg(required = true, value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
    /// Log to write; it must not exist.
    #[arg(short, long, value_name = "FIXED.mcap")]
    pub(crate) output: PathBuf,
    /// Print what was kept and what is lost as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Trim {
    /// Log to trim, or the parts of a recording; they are only read.
    #[arg(required = true, value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
    /// Log to write; it must not exist.
    #[arg(short, long, value_name = "TRIMMED.mcap")]
    pub(crate) output: PathBuf,
    /// From here on, counted from the log's first message: 90s, 10min, 1.5h.
    #[arg(long, value_name = "TIME", value_parser = time, conflicts_with = "chainage")]
    pub(crate) from: Option<DurNs>,
    /// Up to here, counted from the log's first message.
    #[arg(long, value_name = "TIME", value_parser = time, conflicts_with = "chainage")]
    pub(crate) to: Option<DurNs>,
    /// While the vehicle was between these places, metres from the portal; the log is replayed to find out when.
    #[arg(long, value_name = "FROM..TO", value_parser = chainage_range, allow_hyphen_values = true)]
    pub(crate) chainage: Option<[f64; 2]>,
    /// Without echo strengths, where a device's messages tell the range beside them; replays give the same results.
    #[arg(long)]
    pub(crate) drop_echoes: bool,
    /// Without names, comments, addresses, serial numbers, time of day and places on Earth; says what it can't take out.
    #[arg(long)]
    pub(crate) anonymise: bool,
    /// Vehicle file for --chainage, --drop-echoes and --anonymise, in place of the one attached to the log.
    #[arg(long, value_name = "FILE", conflicts_with = "anonymise")]
    pub(crate) vehicle: Option<PathBuf>,
    /// Print what was kept and what was done as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Simulate {
    /// Scene file.
    pub(crate) scene: PathBuf,
    /// Log to write.
    #[arg(short, long, value_name = "LOG.mcap")]
    pub(crate) output: Option<PathBuf>,
    /// Where the random numbers begin, in place of the scene's own seed.
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// File for the truth: CSV, a line for each measurement with the vehicle's pose, the place on the wall, and what each
    /// effect did to it.
    #[arg(long, value_name = "TRUTH.csv")]
    pub(crate) truth: Option<PathBuf>,
    /// Say what would be simulated and why, and simulate nothing.
    #[arg(long)]
    pub(crate) explain: bool,
    /// Print a summary as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Import {
    /// Foreign log.
    pub(crate) file: PathBuf,
    /// Log to write.
    #[arg(short, long, value_name = "LOG.mcap")]
    pub(crate) output: PathBuf,
    /// Vehicle file: whose messages these are, and what the log can't know.
    #[arg(long, value_name = "VEHICLE.toml")]
    pub(crate) vehicle: Option<PathBuf>,
    /// A sensor and the line that it listens to (mavlink, imagenex, ping, or a CAN interface), in place of the vehicle file's;
    /// once for each sensor, and then no other listens.
    #[arg(long, value_name = "ID=LINE", value_parser = source_line)]
    pub(crate) source: Vec<(String, String)>,
    /// For CSV, which column is which quantity of which sensor; for ROS, which topic is of which sensor, where there is a choice.
    #[arg(long, value_name = "MAPPING.toml")]
    pub(crate) map: Option<PathBuf>,
    /// Format of the file, where its name doesn't say.
    #[arg(long, value_parser = file_kind())]
    pub(crate) format: Option<FileKind>,
    /// Print a summary as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

const IMPORT_EXAMPLES: &str = "Example:
  headrace import dive.tlog --vehicle vehicle.toml -o dive.mcap
  headrace import candump-2026-05-04.log --vehicle vehicle.toml --source imu=can1 -o dive.mcap
  headrace import sonar.81a --vehicle vehicle.toml --source sonar_0=imagenex -o dive.mcap
  headrace import depth.csv --map mapping.toml --vehicle vehicle.toml -o dive.mcap
  headrace import dive.bag --map topics.toml --vehicle vehicle.toml -o dive.mcap";

const SIMULATE_EXAMPLES: &str = "Example:
  headrace simulate deploy/scenes/demo.toml -o dive.mcap
  headrace simulate deploy/scenes/vita1-field.toml --explain
  headrace simulate deploy/scenes/vita1-field.toml --seed 7 --truth truth.csv -o dive.mcap";

const CALIBRATE_EXAMPLES: &str = "Example:
  headrace calibrate dive.mcap
  headrace calibrate dive.mcap --from 60 --to 180 --chainage 0 --at-surface 5..30
  headrace calibrate dive.mcap --vehicle vehicle.toml --json";

const PLAN_EXAMPLES: &str = "Example:
  headrace plan --vehicle deploy/vehicles/vita2-4.toml --target 0.5
  headrace plan --tunnel ceran --heads 2 --target 0.6 --drift 1.5 --yaw 15 --svg pictures
  headrace plan --tunnel trimmed_circle,radius_m=4,base_m=5 --length 3200 --mode fast --hours 8";

#[derive(Debug, Args)]
pub(crate) struct Plan {
    /// Vehicle file: its heads, layout, tunnel and target; options outweigh it.
    #[arg(long, value_name = "FILE")]
    pub(crate) vehicle: Option<PathBuf>,
    /// Tunnel by name, with its dimensions as in a vehicle file (circle,radius_m=3), or the file of a polyline (.csv).
    #[arg(long, value_name = "TUNNEL")]
    pub(crate) tunnel: Option<String>,
    /// Length to inspect, metres.
    #[arg(long, value_name = "METRES", value_parser = length)]
    pub(crate) length: Option<f64>,
    /// Where the vehicle goes in the cross-section: left of the axis and above the floor, metres.
    #[arg(long, value_name = "Y,Z", value_parser = place, allow_hyphen_values = true)]
    pub(crate) at: Option<[f64; 2]>,
    /// Mode of the heads, or all.
    #[arg(long, value_name = "MODE", default_value = "all")]
    pub(crate) mode: String,
    /// How many ideal heads, all in one place, where no vehicle file is given.
    #[arg(long, value_name = "N", default_value = "1", value_parser = clap::value_parser!(u32).range(1..=8), conflicts_with = "vehicle")]
    pub(crate) heads: u32,
    /// How the heads share the work: phase_shift or sector_offset.
    #[arg(long, value_name = "LAYOUT", value_parser = layout)]
    pub(crate) layout: Option<HeadLayout>,
    /// Range setting of the heads, metres; 10 where no vehicle file is given.
    #[arg(long, value_name = "METRES", value_parser = length)]
    pub(crate) range: Option<f64>,
    /// Target T, metres.
    #[arg(long, value_name = "METRES", value_parser = target)]
    pub(crate) target: Option<f64>,
    /// Speed along the tunnel, m/s.
    #[arg(long, value_name = "MPS", value_parser = speed_mps, conflicts_with = "hours")]
    pub(crate) speed: Option<f64>,
    /// Hours for the whole length, one way.
    #[arg(long, value_name = "HOURS", value_parser = hours)]
    pub(crate) hours: Option<f64>,
    /// How far up, down and sideways the vehicle may be, steadily or drifting slowly, metres.
    #[arg(long, value_name = "METRES", default_value = "0", value_parser = drift)]
    pub(crate) drift: f64,
    /// How far from the tunnel's axis the vehicle may head, steadily, degrees.
    #[arg(long, value_name = "DEGREES", default_value = "0", value_parser = yaw)]
    pub(crate) yaw: f64,
    /// How fast the vehicle may turn about, degrees a second: beams swing along the wall.
    #[arg(long, value_name = "DEGREES", default_value = "0", value_parser = yaw)]
    pub(crate) yaw_rate: f64,
    /// Print JSON.
    #[arg(long, conflicts_with = "csv")]
    pub(crate) json: bool,
    /// Print the modes as CSV.
    #[arg(long)]
    pub(crate) csv: bool,
    /// Folder to draw pictures into: perimeter, pattern, speeds and hours (docs/plan says how to read them).
    #[arg(long, value_name = "DIR")]
    pub(crate) svg: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(crate) struct Calibrate {
    /// Log to calibrate by, or the folder of a recording in parts.
    pub(crate) log: PathBuf,
    /// Vehicle file, in place of the one attached to the log.
    #[arg(long, value_name = "FILE")]
    pub(crate) vehicle: Option<PathBuf>,
    /// From here on, in seconds from the log's first message.
    #[arg(long, value_name = "SECONDS", value_parser = seconds, default_value = "0")]
    pub(crate) from: f64,
    /// Up to here, in seconds from the log's first message; 1200 s at most, and as many without this.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub(crate) to: Option<f64>,
    /// When the depth sensor was at the water's surface or above it, in seconds from the log's first message.
    #[arg(long, value_name = "FROM..TO", value_parser = seconds_range)]
    pub(crate) at_surface: Option<[f64; 2]>,
    /// Where the vehicle truly stood still, metres from the portal.
    #[arg(long, value_name = "METRES", value_parser = chainage, allow_hyphen_values = true)]
    pub(crate) chainage: Option<f64>,
    /// Print JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Devices {
    /// Ask on each serial port that may be opened, at 115200 baud, and at the addresses of the vehicle file.
    #[arg(long)]
    pub(crate) probe: bool,
    /// Address to ask at; may be given several times.
    #[arg(long, value_name = "tcp:HOST:PORT|udp:HOST:PORT", value_parser = address)]
    pub(crate) address: Vec<Connect>,
    /// Vehicle file, of whose sensors is said whether their ports are there.
    #[arg(long, value_name = "FILE")]
    pub(crate) vehicle: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Check {
    /// Vehicle file.
    pub(crate) vehicle: PathBuf,
    /// Print it as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Output {
    /// File for the report.
    #[arg(long, value_name = "R.json")]
    pub(crate) report: Option<PathBuf>,
    /// Print the report as JSON in place of words.
    #[arg(long)]
    pub(crate) json: bool,
}

const SPEED_HELP: &str = "Seconds of the dive for a second of yours, or max";
