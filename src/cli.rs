//! The command line.

mod common_options;
mod logs;
mod page;
mod setup;
mod value_parsers;

use std::ffi::OsString;
use std::path::PathBuf;

use clap::builder::{PathBufValueParser, TypedValueParser as _};
use clap::{ArgAction, Args, Parser, Subcommand, ValueEnum};
use headrace_geometry::time::DurNs;
use headrace_replay::log::Every;
use headrace_sampling::layout::HeadLayout;
use headrace_sensor::connect::Connect;
use tracing::level_filters::LevelFilter;

use crate::watch::Show;

use value_parsers::{
    address, chainage, drift, hours, layout, place, rotation, seconds, seconds_range, section, sound_speed,
    speed_mps, test_seconds, udp_address, yaw,
};

pub(crate) use common_options::{Completions, Man, Overwrite, Threads};
pub(crate) use logs::{Deliver, Dives, Export, Import, Notes, Recover, Trim, Verify};
pub(crate) use page::PageArgs;
pub(crate) use setup::{GivenPort, Setup, mount};
pub(crate) use value_parsers::{Speed, length, speed, target, time};

/// Value of the option `--resume` of `run` if no path is given.
pub(crate) const LAST: &str = "last";
/// Commands of `replay --interactive`.
pub(crate) const COMMANDS: &str =
    "pause, go, step [TICKS], seek TIME, ahead TIME, back TIME, speed N|max, end or quit";
/// Keys of `replay --interactive`.
pub(crate) const KEYS: &str =
    "space pause or continue, left and right 10 s, up and down 1 min, + - speed, . one tick, q quit";

/// Commands of `emulate`.
pub(crate) const FAULT_COMMANDS: &str = "unplug ID, plug ID, stall ID, resume ID, delay ID TIME, restart ID, freeze, \
     release, hold TIME, end or quit";
/// Keys of `emulate`.
pub(crate) const FAULT_KEYS: &str = "up and down choose a device, u unplug, s stall, d delay, r restart, f freeze the \
     cable count, b hold back all data for 1.3 s, q quit";

fn emulate_help() -> String {
    format!(
        "Faults during the rehearsal:\n  keys in a terminal: {FAULT_KEYS}; the same key ends a fault\n  lines on \
         standard input otherwise: {FAULT_COMMANDS}\n\nExample:\n  headrace emulate deploy/scenes/rehearsal.toml --out /tmp/rehearsal\n  \
         headrace run /tmp/rehearsal/vehicle.toml"
    )
}

fn interactive_help() -> String {
    format!("Keys in a terminal: {KEYS}; otherwise commands by lines on standard input: {COMMANDS}")
}

/// On-board coverage monitor for sonar inspection of flooded hydroelectric tunnels.
#[derive(Debug, Parser)]
// Help uses the program's name, whatever its file is called.
#[command(bin_name = "headrace", version, arg_required_else_help = true)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
    #[command(flatten)]
    pub(crate) verbosity: Verbosity,
}

/// Verbosity of the log messages on stderr.
#[derive(Debug, Args)]
#[command(next_help_heading = "Log messages, on stderr")]
pub(crate) struct Verbosity {
    /// Add confidence, spacing and digest to the summary, and log ports, files, phases and durations (-vv: everything).
    ///
    /// RUST_LOG=debug,headrace_ports=trace sets the log level by crate.
    #[arg(short, long, action = ArgAction::Count, global = true)]
    verbose: u8,
    /// Show only results and errors: no log messages, no progress, and nothing of a dive while it runs.
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    quiet: bool,
}

impl Verbosity {
    /// Whether only results and errors are shown.
    pub(crate) fn is_quiet(&self) -> bool {
        self.quiet
    }

    /// Whether the summary has an engineer's figures.
    pub(crate) fn is_verbose(&self) -> bool {
        self.verbose > 0
    }

    /// Level for this program's crates; `None` by default.
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
    /// Run a simulated dive, without hardware or arguments.
    ///
    /// VITA 2 with four heads inspects the Ceran tunnel, mostly at a suitable speed and for one stretch too
    /// fast.
    #[command(after_help = "Example:\n  headrace demo --speed max --out /tmp/demo")]
    Demo(Demo),
    /// Run a dive on the vehicle's ports and record it, until interrupted (Ctrl-C).
    ///
    /// Missing sensors are retried indefinitely while the dive continues with the others. --require ends the
    /// dive if a sensor is missing. --source takes the packets of a log instead of the ports. The exit code
    /// doesn't depend on the verdicts: the summary and the report list metres that were missed or have no
    /// verdict. It is 3 if data was lost or the recording failed, even if it resumed. SIGINT and SIGTERM end
    /// the dive with its report; closing the terminal doesn't.
    #[command(
        after_help = "Example:\n  headrace run vehicle.toml --record dive.mcap --require imu,sonar_0\n  headrace run vehicle.toml --record dive.mcap --record /media/stick/dive.mcap\n  headrace run vehicle.toml --record dive.mcap --rotate 1GiB\n  headrace run vehicle.toml --source dive.mcap --record again.mcap"
    )]
    Run(Run),
    /// Replay a recorded dive through the same processing as a live one.
    ///
    /// With --smooth it is replayed twice: once with the filter, and once along the smoothed trajectory. The
    /// exit code doesn't depend on the verdicts: the summary and the report list metres that were missed or
    /// have no verdict.
    #[command(
        after_help = "Example:\n  headrace replay dive.mcap --target 0.6 --report report.json\n  headrace replay dive.mcap --target 0.3,0.6,1.0 --section 0.25,1\n  headrace replay dive.mcap --smooth --report certificate.json\n  headrace replay dive.part*.mcap\n  headrace replay dive.mcap --expect golden.json --bless"
    )]
    Replay(Replay),
    /// Write a recorded dive as one HTML page that opens from disk, without a network.
    ///
    /// The log is replayed through the same processing. The page is that of a live dive, with the whole dive
    /// inside (docs/how-to/read-the-page.md). Exit codes are those of replay.
    #[command(after_help = "Example:\n  headrace export dive.mcap --html dive.html")]
    Export(Export),
    /// Write a recorded dive's report for the owner of the plant (HTML, PDF, JSON), and files for other programs.
    ///
    /// The log is replayed through the same processing. The report states what was inspected, what was
    /// missed and what is not known. Points, sections, profile, map, track and wall are files for CAD and
    /// point cloud programs. Two runs write identical bytes. Exit codes are those of replay.
    #[command(
        after_help = "Example:\n  headrace deliver dive.mcap -o report --about about.toml\n  headrace deliver dive.mcap -o report --plant Ceran --crew 'A. Berg' --every 5"
    )]
    Deliver(Deliver),
    /// List the dives that are recorded in a folder, with the metres by verdict of their reports.
    ///
    /// Logs aren't replayed. Interrupted dives and dives without a report are named, with the command that
    /// continues the dive or makes the report. Exit code 3 if a log can't be read or data is missing.
    #[command(after_help = "Example:\n  headrace dives\n  headrace dives /var/lib/headrace --json")]
    Dives(Dives),
    /// List the notes of a recorded dive, and write the recordings of its voice notes as files.
    ///
    /// The log isn't replayed: places are those that the dive published. Exit code 3 if a part of the log or
    /// of a recording is lost.
    #[command(after_help = "Example:\n  headrace notes dive.mcap\n  headrace notes dive.mcap --out voices")]
    Notes(Notes),
    /// Compare a replay with the results that the dive published live.
    ///
    /// Reports the first difference of each result stream: tick, sensor, field and both values with their
    /// bits. Exit code 4 if they differ; 3 if they don't differ but the log has lost data.
    #[command(after_help = "Example:\n  headrace verify dive.mcap")]
    Verify(Verify),
    /// Write the readable part of a damaged log as a valid log, and list the losses.
    ///
    /// The new log replays to the same digest. It and its reports state the missing parts. Exit code 3 if
    /// data is missing.
    #[command(after_help = "Example:\n  headrace recover dive.mcap -o recovered.mcap")]
    Recover(Recover),
    /// Extract part of a log: a time span, a range of chainage, without echo data, or anonymised.
    ///
    /// The new log states the removed parts as losses and then contains no live results. If nothing is
    /// removed, it replays to the same digest. Exit code 3 if the source log has lost data.
    #[command(
        after_help = "Example:\n  headrace trim dive.mcap -o part.mcap --from 10min --to 20min\n  headrace trim dive.mcap -o bend.mcap --chainage 120..340 --drop-echoes\n  headrace trim dive.mcap -o public.mcap --anonymise"
    )]
    Trim(Trim),
    /// Simulate a scene and write the bytes that its devices would send as a log.
    ///
    /// By default only the effects named in the scene are simulated. With --take called, or the same setting in
    /// the scene, those that the scene calls for are added. --explain lists them.
    #[command(after_help = SIMULATE_EXAMPLES)]
    Simulate(Simulate),
    /// Convert a log of another program: MAVLink telemetry, candump, Imagenex, Ping Viewer, A50, CSV, ROS
    /// bags and MCAP.
    ///
    /// Each message goes to the sensors of the vehicle file that would have received it. The vehicle file is
    /// attached to the log. Readings that the file marks as doubtful are withheld if the sensor's messages can't
    /// state the doubt. Exit code 3 if part of the file was lost or withheld, 1 if no sensor receives any message.
    #[command(after_help = IMPORT_EXAMPLES)]
    Import(Import),
    /// Plan an inspection: sample spacing, speed and hours by mode, for a tunnel, heads, layout and target.
    ///
    /// With --target it computes the largest speed; with --speed or --hours the resulting spacing. Exit code
    /// 1 if no mode meets the request.
    #[command(after_help = PLAN_EXAMPLES)]
    Plan(Plan),
    /// Measure the cost of accuracy: errors against independent values, setting by setting, next to CPU time
    /// or hours.
    #[command(disable_help_flag = true, after_help = COST_HELP)]
    Cost(ExternalArguments),
    /// Estimate mounts, zeros and latencies of the sensors from a log, as values for the vehicle file.
    ///
    /// Mounts of heads need a full turn while the vehicle stands still off the tunnel's axis. The surface
    /// pressure needs --at-surface. Zeros of cable counters need --chainage. Latencies need a dive with yaw
    /// and roll. Values that can't be estimated are listed with the reason. Exit code 1 if no value can be
    /// estimated.
    #[command(after_help = CALIBRATE_EXAMPLES)]
    Calibrate(Calibrate),
    /// Emulate a scene's devices on real ports in real time, to rehearse a dive.
    ///
    /// Writes a vehicle file for `headrace run`. The vehicle waits until all its sensors are connected, and
    /// --stand seconds more. The command ends at the end of the trajectory.
    #[command(after_help = emulate_help())]
    Emulate(Emulate),
    /// List attached devices, permissions and missing ports, with the command that fixes each problem.
    ///
    /// No port is opened without --probe or --address. Probing identifies 881 heads and Ping devices with one
    /// short ping and no movement. Don't probe during a dive: other devices on serial ports receive the
    /// probes, too. With --vehicle, the exit code is 1 if a sensor's port is missing or may not be opened.
    #[command(
        after_help = "Example:\n  headrace devices\n  headrace devices --probe --address tcp:192.168.0.5:4040\n  headrace devices --vehicle vehicle.toml"
    )]
    Devices(Devices),
    /// Write a vehicle file for the attached devices: find them, ask for tunnel, target and mounts, and check the
    /// file.
    ///
    /// Serial ports and the ports given without a plugin are probed, as by devices --probe, so don't use it
    /// during a dive. Every question has an option. Without a terminal, a missing answer is an error. Exit codes
    /// are those of check; 1 if no device is found.
    #[command(
        after_help = "Example:\n  headrace setup\n  headrace setup --tunnel circle,radius_m=2 --length 400 --target 0.5 --port tcp:192.168.0.5:4040 --mount sonar_0=0.3,0,0,ahead"
    )]
    Setup(Setup),
    /// Check a vehicle or scene file: list all errors and warnings, and the resulting plan.
    ///
    /// Exit code 2 with errors. Warnings don't affect it. With --devices it is 1 if the vehicle isn't ready to
    /// dive.
    #[command(
        after_help = "Example:\n  headrace check deploy/vehicles/vita2-4.toml\n  headrace check deploy/scenes/demo.toml\n  headrace check vehicle.toml --devices --folder /var/lib/headrace"
    )]
    Check(Check),
    /// Query hundreds of dives in SQL, each replayed once.
    #[command(disable_help_flag = true, after_help = CAMPAIGN_HELP)]
    Campaign(ExternalArguments),
    /// Replay a share of a folder's dives and keep their tables as Parquet, for Slurm, Nextflow or CI
    /// matrices.
    #[command(disable_help_flag = true, after_help = CAMPAIGN_HELP)]
    Batch(ExternalArguments),
    /// Write the shell completions of this command line to stdout.
    #[command(
        after_help = "Example:\n  headrace completions bash > ~/.local/share/bash-completion/completions/headrace\n  headrace completions zsh > \"${fpath[1]}/_headrace\""
    )]
    Completions(Completions),
    /// Write manual pages: the program's page to stdout, or all pages into a folder.
    #[command(after_help = "Example:\n  headrace man | man -l -\n  headrace man ~/.local/share/man/man1")]
    Man(Man),
}

#[derive(Debug, Args)]
pub(crate) struct Demo {
    /// Output folder for the report and the log.
    #[arg(long, value_name = "DIR", default_value = "headrace-demo")]
    pub(crate) out: PathBuf,
    #[arg(long, value_name = "max|Nx", default_value = "20x", value_parser = speed, help = SPEED_HELP)]
    pub(crate) speed: Speed,
    #[command(flatten)]
    pub(crate) following: Following,
    #[command(flatten)]
    pub(crate) overwrite: Overwrite,
    /// Don't open a browser.
    #[arg(long, help_heading = "Page")]
    pub(crate) no_open: bool,
    /// End after the dive. Without it, in a terminal, the page replays the dive until q is pressed.
    #[arg(long, help_heading = "Page")]
    pub(crate) exit: bool,
    #[command(flatten)]
    pub(crate) page: PageArgs,
}

#[derive(Debug, Args)]
pub(crate) struct Run {
    /// Vehicle file.
    pub(crate) vehicle: PathBuf,
    /// Log, or folder of a recording in parts, that replaces the ports.
    #[arg(long, value_name = "LOG.mcap", conflicts_with_all = ["require", "require_within", "duration", "no_record"])]
    pub(crate) source: Option<PathBuf>,
    /// Log to write. On ports the default is dive-SECONDS.mcap in the current folder. Given twice, the dive
    /// is recorded twice, best on two media: an error of one doesn't affect the other. After an error a
    /// recording resumes in a new part (dive.part002.mcap).
    #[arg(long, value_name = "LOG.mcap")]
    pub(crate) record: Vec<PathBuf>,
    /// Record in parts (dive.part001.mcap, ... for dive.mcap). Each part is a complete log of this size
    /// (1GiB, 500MB) or duration (30min, 2h).
    #[arg(long, value_name = "1GiB|30min", value_parser = rotation, conflicts_with = "no_record")]
    pub(crate) rotate: Option<Every>,
    /// Don't record.
    #[arg(long, conflicts_with = "record")]
    pub(crate) no_record: bool,
    /// Continue the last dive in the folder of the recording, if it did not end in order within the last 12
    /// hours, for instance after a power cut: recording goes on in a further part, and the dive so far is read
    /// again. Otherwise begin a dive. With a path, continue that recording.
    #[arg(long, value_name = "LOG.mcap", num_args = 0..=1, require_equals = true, default_missing_value = LAST, conflicts_with_all = ["no_record", "source"])]
    pub(crate) resume: Option<PathBuf>,
    /// Begin a new dive, although the last one did not end in order.
    #[arg(long, conflicts_with = "resume")]
    pub(crate) new: bool,
    /// Ids of the required sensors, or all. The dive ends if one is missing.
    #[arg(long, value_name = "ID,..", value_delimiter = ',')]
    pub(crate) require: Vec<String>,
    /// Timeout for required sensors to start, seconds.
    #[arg(long, value_name = "SECONDS", default_value = "30", value_parser = seconds, requires = "require")]
    pub(crate) require_within: f64,
    /// End the dive after this many seconds.
    #[arg(long = "for", value_name = "SECONDS", value_parser = seconds)]
    pub(crate) duration: Option<f64>,
    #[arg(long, value_name = "max|Nx", default_value = "1x", value_parser = speed, help = SPEED_HELP)]
    pub(crate) speed: Speed,
    #[command(flatten)]
    pub(crate) following: Following,
    #[command(flatten)]
    pub(crate) output: Output,
    #[command(flatten)]
    pub(crate) page: PageArgs,
}

#[derive(Debug, Args)]
pub(crate) struct Emulate {
    /// Scene file.
    pub(crate) scene: PathBuf,
    /// Output folder for the vehicle file.
    #[arg(long, value_name = "DIR", default_value = "headrace-rehearsal")]
    pub(crate) out: PathBuf,
    /// Random seed, overriding the scene's.
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// Address on which network devices listen.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1")]
    pub(crate) listen: std::net::IpAddr,
    /// Time for which the vehicle stands still once all sensors are connected, seconds. Heads reach their
    /// start angles in it.
    #[arg(long, value_name = "SECONDS", default_value = "8", value_parser = seconds)]
    pub(crate) stand: f64,
    /// Time for which the devices keep sending after the end of the trajectory, seconds.
    #[arg(long, value_name = "SECONDS", default_value = "5", value_parser = seconds)]
    pub(crate) linger: f64,
    #[command(flatten)]
    pub(crate) overwrite: Overwrite,
}

#[derive(Debug, Args)]
pub(crate) struct Replay {
    /// Log to replay, or a recording in parts: its files, its folder, or the name given to --record.
    #[arg(required = true, value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
    /// Vehicle file, overriding the one attached to the log.
    #[arg(long, value_name = "FILE")]
    pub(crate) vehicle: Option<PathBuf>,
    /// Target T, metres, overriding the vehicle file's. Each further target is judged in a replay of its own.
    #[arg(long, value_name = "METRES,..", value_parser = target, value_delimiter = ',')]
    pub(crate) target: Vec<f64>,
    /// Section length, metres, overriding the vehicle file's. Each further length is judged in a replay of
    /// its own.
    #[arg(long, value_name = "METRES,..", value_parser = section, value_delimiter = ',')]
    pub(crate) section: Vec<f64>,
    /// Speed of sound in the water, m/s, overriding the vehicle file's.
    #[arg(long, value_name = "M/S", value_parser = sound_speed)]
    pub(crate) sound_speed: Option<f64>,
    /// Playback speed relative to real time, or max. The default is max, or 1x with keys in a terminal.
    #[arg(long, value_name = "max|Nx", value_parser = speed)]
    pub(crate) speed: Option<Speed>,
    /// Tick length, milliseconds. Results don't depend on it.
    #[arg(long, value_name = "MS", default_value = "20", value_parser = clap::value_parser!(u32).range(1..=60_000))]
    pub(crate) tick_ms: u32,
    #[command(flatten)]
    pub(crate) threads: Threads,
    /// Start at this dive time (90s, 1h20min, 1:23:45). The part before it is processed, too.
    #[arg(long, value_name = "TIME", value_parser = time, conflicts_with = "smooth")]
    pub(crate) from: Option<DurNs>,
    #[arg(short, long, conflicts_with = "smooth", help = interactive_help())]
    pub(crate) interactive: bool,
    /// Use the smoothed trajectory, and report its changes.
    #[arg(long, conflicts_with_all = ["speed", "tui", "foxglove"])]
    pub(crate) smooth: bool,
    /// Report to compare with. Exit code 1 if verdicts, holes or the digest differ.
    #[arg(long, value_name = "GOLDEN.json")]
    pub(crate) expect: Option<PathBuf>,
    /// Show the differences to the golden report, and replace it.
    #[arg(long, requires = "expect")]
    pub(crate) bless: bool,
    #[command(flatten)]
    pub(crate) following: Following,
    #[command(flatten)]
    pub(crate) output: Output,
    #[command(flatten)]
    pub(crate) page: PageArgs,
}

/// Effects for --take.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum TakeWhat {
    /// Effects that the scene names.
    Only,
    /// Effects that the scene names, and those that it calls for.
    Called,
}

/// Output of --explain.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Explain {
    /// The effects that would be simulated, with their reasons.
    List,
    /// The list, and the worth of each effect.
    Worth,
}

#[derive(Debug, Args)]
pub(crate) struct Simulate {
    /// Scene file.
    pub(crate) scene: PathBuf,
    /// Log to write.
    #[arg(short, long, value_name = "LOG.mcap")]
    pub(crate) output: Option<PathBuf>,
    /// Random seed, overriding the scene's.
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// CSV file for the ground truth. Each measurement has a row with the vehicle's pose, the point on the
    /// wall, and the contribution of each effect.
    #[arg(long, value_name = "TRUTH.csv")]
    pub(crate) truth: Option<PathBuf>,
    /// Effects to simulate, overriding the scene's choice: only the named ones, or also those that the scene
    /// calls for.
    #[arg(long, value_enum, value_name = "WHAT")]
    pub(crate) take: Option<TakeWhat>,
    /// List the effects that would be simulated, with their reasons, without simulating. With =worth, also
    /// measure over several seeds the cost of each effect, and how this scene's results change without it.
    #[arg(long, value_enum, num_args = 0..=1, require_equals = true, default_missing_value = LAST, default_missing_value = "list", value_name = "WHAT")]
    pub(crate) explain: Option<Explain>,
    /// Number of seeds that --explain=worth simulates, beginning with the scene's.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u16).range(2..=1000))]
    pub(crate) seeds: u16,
    /// Print a summary as JSON.
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) overwrite: Overwrite,
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
  headrace simulate deploy/scenes/vita1-field.toml --take called --explain=worth --seeds 8
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
    /// Vehicle file for heads, layout, tunnel and target. Other options override it.
    #[arg(long, value_name = "FILE")]
    pub(crate) vehicle: Option<PathBuf>,
    /// Tunnel profile by name with dimensions as in a vehicle file (circle,radius_m=3), or a polyline file
    /// (.csv).
    #[arg(long, value_name = "TUNNEL")]
    pub(crate) tunnel: Option<String>,
    /// Length to inspect, metres.
    #[arg(long, value_name = "METRES", value_parser = length)]
    pub(crate) length: Option<f64>,
    /// Position of the vehicle in the cross-section: left of the axis and above the floor, metres.
    #[arg(long, value_name = "Y,Z", value_parser = place, allow_hyphen_values = true)]
    pub(crate) at: Option<[f64; 2]>,
    /// Mode of the heads, or all.
    #[arg(long, value_name = "MODE", default_value = "all")]
    pub(crate) mode: String,
    /// Number of ideal heads, all at the same position, if no vehicle file is given.
    #[arg(long, value_name = "N", default_value = "1", value_parser = clap::value_parser!(u32).range(1..=8), conflicts_with = "vehicle")]
    pub(crate) heads: u32,
    /// Layout of the heads: phase_shift or sector_offset.
    #[arg(long, value_name = "LAYOUT", value_parser = layout)]
    pub(crate) layout: Option<HeadLayout>,
    /// Range setting of the heads, metres; 10 if no vehicle file is given.
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
    /// Largest offset of the vehicle from that position, constant or slowly varying, metres.
    #[arg(long, value_name = "METRES", default_value = "0", value_parser = drift)]
    pub(crate) drift: f64,
    /// Largest constant yaw from the tunnel's axis, degrees.
    #[arg(long, value_name = "DEGREES", default_value = "0", value_parser = yaw)]
    pub(crate) yaw: f64,
    /// Largest yaw rate, degrees/s. Yaw swings the beams along the wall.
    #[arg(long, value_name = "DEGREES", default_value = "0", value_parser = yaw)]
    pub(crate) yaw_rate: f64,
    /// Print JSON.
    #[arg(long, conflicts_with = "csv")]
    pub(crate) json: bool,
    /// Print the modes as CSV.
    #[arg(long)]
    pub(crate) csv: bool,
    /// Print the lines of the vehicle file for the plan's best answer: layout, planned speed and modes.
    #[arg(long, conflicts_with_all = ["json", "csv"])]
    pub(crate) write: bool,
    /// Output folder for SVG charts: perimeter, pattern, speeds and hours (explained in docs/how-to/plan).
    #[arg(long, value_name = "DIR")]
    pub(crate) svg: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) overwrite: Overwrite,
}

#[derive(Debug, Args)]
pub(crate) struct Calibrate {
    /// Log, or folder of a recording in parts.
    pub(crate) log: PathBuf,
    /// Vehicle file, overriding the one attached to the log.
    #[arg(long, value_name = "FILE")]
    pub(crate) vehicle: Option<PathBuf>,
    /// Start, seconds of dive time.
    #[arg(long, value_name = "SECONDS", value_parser = seconds, default_value = "0")]
    pub(crate) from: f64,
    /// End, seconds of dive time. The default is 1200 s after the start, which is also the most.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub(crate) to: Option<f64>,
    /// Time span in which the depth sensor was at or above the water surface, seconds of dive time.
    #[arg(long, value_name = "FROM..TO", value_parser = seconds_range)]
    pub(crate) at_surface: Option<[f64; 2]>,
    /// True chainage at which the vehicle stood still, metres.
    #[arg(long, value_name = "METRES", value_parser = chainage, allow_hyphen_values = true)]
    pub(crate) chainage: Option<f64>,
    /// Print JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Devices {
    /// Probe every serial port that may be opened, at 115200 baud, and the addresses in the vehicle file.
    #[arg(long)]
    pub(crate) probe: bool,
    /// Address to probe. May be given several times.
    #[arg(long, value_name = "tcp:HOST:PORT|udp:HOST:PORT", value_parser = address)]
    pub(crate) address: Vec<Connect>,
    /// Vehicle file whose sensors' ports are checked.
    #[arg(long, value_name = "FILE")]
    pub(crate) vehicle: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Check {
    /// Vehicle file, or scene file.
    pub(crate) file: PathBuf,
    /// Also run the vehicle's devices as in a dive, without recording. Compare rate, gaps, noise and clock of
    /// each with the file and data sheets, and test the computer's disk and CPU.
    #[arg(long)]
    pub(crate) devices: bool,
    /// Duration of the devices' test, seconds.
    #[arg(long = "for", value_name = "SECONDS", default_value = "120", value_parser = test_seconds, requires = "devices")]
    pub(crate) duration: f64,
    /// Folder to which dives are recorded. Its disk is tested.
    #[arg(long, value_name = "DIR", default_value = ".", requires = "devices")]
    pub(crate) folder: PathBuf,
    /// Print JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Screens and programs that follow a dive.
#[derive(Debug, Args)]
#[command(next_help_heading = "Screens and programs that follow the dive")]
pub(crate) struct Following {
    /// Show the dive on the whole terminal, for a session over ssh. The key ? lists the keys.
    #[arg(long)]
    pub(crate) tui: bool,
    /// Send heartbeats, figures and alerts over MAVLink to this UDP address, as an onboard computer
    /// (component 191). Use QGroundControl's address, or under BlueOS that of its MAVLink server,
    /// 127.0.0.1:14550.
    #[arg(long, value_name = "HOST:PORT", value_parser = udp_address)]
    pub(crate) mavlink_out: Option<String>,
    /// MAVLink system id of the vehicle.
    #[arg(long, value_name = "ID", default_value = "1", value_parser = clap::value_parser!(u8).range(1..), requires = "mavlink_out")]
    pub(crate) mavlink_system: u8,
    /// Serve the dive to Foxglove or Lichtblick on this machine, by default at 127.0.0.1:8765. They can
    /// control the playback of a replay. Needs a program built with --features foxglove.
    #[arg(long, value_name = "ADDRESS:PORT", num_args = 0..=1, default_missing_value = "127.0.0.1:8765")]
    pub(crate) foxglove: Option<std::net::SocketAddr>,
}

impl Following {
    /// Whether a follower may want to control a replay.
    pub(crate) fn may_command(&self) -> bool {
        self.tui || self.foxglove.is_some()
    }
}

#[derive(Debug, Args)]
pub(crate) struct Output {
    /// Report file to write.
    #[arg(long, value_name = "R.json", value_parser = PathBufValueParser::new().try_map(report_path))]
    pub(crate) report: Option<PathBuf>,
    /// Print the report as JSON.
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) overwrite: Overwrite,
    /// Print JSON objects, one per line, while the dive runs: the state once a second, and the live messages
    /// (docs/reference/live-state.md).
    #[arg(long, conflicts_with_all = ["json", "tui"])]
    pub(crate) json_lines: bool,
}

/// Path of a report. Its extension is .json or none; pipes and devices may have any name.
fn report_path(path: PathBuf) -> Result<PathBuf, String> {
    let is_json = path.extension().is_none_or(|name| name.is_empty() || name.eq_ignore_ascii_case("json"));
    // A pipe or device may have any name, because the name doesn't tell its reader the format.
    let is_special = || path.metadata().is_ok_and(|there| !there.is_file() && !there.is_dir());
    if is_json || is_special() {
        return Ok(path);
    }
    Err("a report is JSON, so its name must end in .json or have no extension; for tables, use headrace campaign DIR \
         --sql SQL --out FILE.csv (docs/how-to/replay-many-dives.md)"
        .to_owned())
}

impl Output {
    /// Kind of display while the dive runs.
    pub(crate) fn show(&self) -> Show {
        match self {
            Self { json_lines: true, .. } => Show::JsonLines,
            Self { json: true, .. } => Show::Nothing,
            _ => Show::Lines,
        }
    }
}

const SPEED_HELP: &str = "Playback speed relative to real time, or max";

/// Help text of `campaign` and `batch`, which another program carries out.
const CAMPAIGN_HELP: &str = "Done by the program headrace-campaign; it is built in lab/: cargo build --release -p headrace_campaign. \
docs/how-to/replay-many-dives.md is its manual, --help lists its options.";
/// Help text of `cost`, which another program carries out.
const COST_HELP: &str = "Done by the program headrace-cost; it is built in lab/: cargo build --release -p headrace_cost. docs/why/cost shows \
what it finds, --help lists its options.";

#[derive(Debug, Args)]
pub(crate) struct ExternalArguments {
    /// Arguments passed to that program.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "ARGUMENTS")]
    pub(crate) arguments: Vec<OsString>,
}
