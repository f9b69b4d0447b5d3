//! The command line.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};

/// On-board coverage monitor for sonar inspection of flooded hydroelectric tunnels.
#[derive(Debug, Parser)]
#[command(version, arg_required_else_help = true)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Show a simulated dive: no hardware, no arguments; it ends by itself.
    ///
    /// VITA 2 with four heads in the Ceran tunnel, most of the way at a speed that is right and for a stretch too fast.
    #[command(after_help = "Example:\n  headrace demo --speed max --out /tmp/demo")]
    Demo(Demo),
    /// The dive itself. In this version it is fed by a recorded log in place of the ports.
    #[command(
        after_help = "Example:\n  headrace run deploy/vehicles/vita2-4.toml --source dive.mcap --record again.mcap"
    )]
    Run(Run),
    /// Run a recorded dive through the very same loop.
    #[command(after_help = "Example:\n  headrace replay dive.mcap --target 0.6 --report report.json")]
    Replay(Replay),
    /// Turn a scene into a log of the bytes that its devices would send.
    #[command(after_help = "Example:\n  headrace simulate deploy/scenes/demo.toml -o dive.mcap")]
    Simulate(Simulate),
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
    /// Log whose messages take the place of the ports'.
    #[arg(long, value_name = "LOG.mcap")]
    pub(crate) source: Option<PathBuf>,
    /// Log to write.
    #[arg(long, value_name = "LOG.mcap")]
    pub(crate) record: Option<PathBuf>,
    #[arg(long, value_name = "max|Nx", default_value = "1x", value_parser = speed, help = SPEED_HELP)]
    pub(crate) speed: Speed,
    #[command(flatten)]
    pub(crate) output: Output,
}

#[derive(Debug, Args)]
pub(crate) struct Replay {
    /// Log to replay.
    pub(crate) log: PathBuf,
    /// Vehicle file, in place of the one attached to the log.
    #[arg(long, value_name = "FILE")]
    pub(crate) vehicle: Option<PathBuf>,
    /// Target T in metres, in place of the vehicle file's.
    #[arg(long, value_name = "METRES", value_parser = target)]
    pub(crate) target: Option<f64>,
    #[arg(long, value_name = "max|Nx", default_value = "max", value_parser = speed, help = SPEED_HELP)]
    pub(crate) speed: Speed,
    /// Length of a tick in milliseconds; no result depends on it.
    #[arg(long, value_name = "MS", default_value = "20", value_parser = clap::value_parser!(u32).range(1..=60_000))]
    pub(crate) tick_ms: u32,
    /// Report to compare with; exit code 1 when verdicts, holes or the digest differ.
    #[arg(long, value_name = "GOLDEN.json")]
    pub(crate) expect: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) output: Output,
}

#[derive(Debug, Args)]
pub(crate) struct Simulate {
    /// Scene file.
    pub(crate) scene: PathBuf,
    /// Log to write.
    #[arg(short, long, value_name = "LOG.mcap")]
    pub(crate) output: PathBuf,
    /// Print a summary as JSON.
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

/// How fast a dive is played; `None` is as fast as it can.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Speed(pub(crate) Option<f64>);

fn speed(text: &str) -> Result<Speed, String> {
    if text == "max" {
        return Ok(Speed(None));
    }
    let number = text.strip_suffix('x').unwrap_or(text).parse::<f64>().ok();
    number
        .filter(|factor| (0.01..=10_000.0).contains(factor))
        .map(|factor| Speed(Some(factor)))
        .ok_or_else(|| "wanted is max, or a number from 0.01x to 10000x".to_owned())
}

fn target(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|metres| (0.01..=20.0).contains(metres));
    number.ok_or_else(|| "wanted is a number of metres from 0.01 to 20".to_owned())
}
