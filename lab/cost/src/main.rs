//! `headrace-cost`, which `headrace cost` starts: its command line, the folder of results, and exit codes.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::{fs, io};

use clap::builder::PossibleValuesParser;
use clap::{Args, Parser};
use headrace_config::{ConfigErrors, Document};
use headrace_cost::effort::Effort;
use headrace_cost::error::CostError;
use headrace_cost::page::{Bars, COST_VERSION, Results, table};
use headrace_cost::scene::Inputs;
use headrace_cost::trades::{GIVEN, TRADES};
use headrace_devices::KINDS;
use headrace_vehicle::VehicleConfig;

/// Last line of a picture. The line marks the picture as written by this program.
const MARK: &str = "<!-- headrace cost -->\n";
/// Beginning of a table. The text marks the table as written by this program.
const TABLE: &str = "scene,method,knob,";

/// Measure the cost of accuracy: errors against independent values, setting by setting, next to CPU time or hours.
///
/// Simulates dives, replays them with other settings, and prints a table and a sentence of advice for each trade; --out writes
/// the page, JSON, CSV and pictures that docs/why/cost has. Times are CPU time of one thread.
#[derive(Debug, Parser)]
#[command(
    name = "headrace cost",
    version,
    after_help = "Example:\n  headrace cost --quick\n  headrace cost --only survey --vehicle deploy/vehicles/vita2-4.toml\n  headrace cost --out docs/why/cost"
)]
struct Cost {
    /// Measure in under a minute, with few settings, few seeds and short dives.
    #[arg(long)]
    quick: bool,
    /// Measure only these trades.
    #[arg(long, value_name = "TRADE,..", value_delimiter = ',', value_parser = PossibleValuesParser::new(TRADES.map(|(name, _)| name)))]
    only: Vec<String>,
    /// Vehicle file for the trade Survey, instead of the shipped files. The other trades use the shipped files.
    #[arg(long, value_name = "FILE")]
    vehicle: Option<PathBuf>,
    /// Output folder for page, JSON, tables and charts.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Also overwrite files that headrace cost has not written.
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    verbosity: Verbosity,
}

/// Amount of output besides the results.
#[derive(Debug, Args)]
struct Verbosity {
    /// Print the progress on stderr.
    #[arg(short, long, conflicts_with = "quiet")]
    verbose: bool,
    /// Show only results and errors, as without --verbose.
    #[arg(short, long)]
    quiet: bool,
}

/// Error: there are no results.
#[derive(Debug, thiserror::Error)]
enum Failure {
    #[error(transparent)]
    Cost(#[from] CostError),
    #[error("the results as JSON: {0}")]
    Results(#[from] serde_json::Error),
    #[error("reading {}: {source}", path.display())]
    Vehicle { path: PathBuf, source: io::Error },
    #[error("{0}")]
    Invalid(#[from] ConfigErrors),
    #[error("writing {}: {source}", path.display())]
    Unwritable { path: PathBuf, source: io::Error },
    #[error("writing to stdout: {0}")]
    Stdout(io::Error),
    #[error("{}: exists and was not written by headrace cost; --force overwrites it", path.display())]
    InTheWay { path: PathBuf },
}

fn main() -> ExitCode {
    match cost(&Cost::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("headrace-cost: {failure}");
            // Exit codes as in headrace: 2 for a wrong request, 1 for a failure.
            let is_asked =
                matches!(failure, Failure::Vehicle { .. } | Failure::Invalid(_) | Failure::InTheWay { .. });
            ExitCode::from(if is_asked { 2 } else { 1 })
        }
    }
}

fn cost(args: &Cost) -> Result<(), Failure> {
    let own = args.vehicle.as_deref().map(vehicle).transpose()?;
    if let Some(folder) = &args.out {
        fs::create_dir_all(folder).map_err(|source| Failure::Unwritable { path: folder.clone(), source })?;
        may_write(folder, args.force)?;
    }
    let inputs = Inputs {
        effort: if args.quick { Effort::Quick } else { Effort::Full },
        kinds: &KINDS,
        vehicle: own.as_ref().map(|(text, vehicle)| (vehicle.name.as_str(), text.as_str())),
    };
    let progress = &mut |words: &str| {
        if args.verbosity.verbose {
            eprintln!("{words}");
        }
    };
    let mut trades = Vec::new();
    for (name, measure) in TRADES {
        if args.only.is_empty() || args.only.iter().any(|only| only == name) {
            let trade = measure(&inputs, progress)?;
            say(&table(&trade))?;
            trades.push(trade);
        }
    }
    let mut given = Vec::new();
    for tabulate in GIVEN.iter().filter(|_| args.only.is_empty()) {
        given.push(tabulate(&inputs, progress)?);
    }
    let Some(folder) = &args.out else { return Ok(()) };
    let results = Results {
        cost_version: COST_VERSION,
        program: format!("headrace {}", env!("CARGO_PKG_VERSION")),
        machine: machine(),
        command: command(args),
        bars: Bars::Median,
        trades,
        given,
    };
    for (name, content) in results.files()? {
        let end = if is_picture(&name) { MARK } else { "" };
        let path = folder.join(name);
        fs::write(&path, content + end)
            .map_err(|source| Failure::Unwritable { path: path.clone(), source })?;
        say(&format!("wrote {}", path.display()))?;
    }
    Ok(())
}

/// Writes lines to stdout; a closed stdout, as with `head`, isn't an error.
fn say(text: &str) -> Result<(), Failure> {
    match writeln!(io::stdout(), "{text}") {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(Failure::Stdout(error)),
        _ => Ok(()),
    }
}

/// Reads a vehicle file: its text, and the parsed vehicle.
fn vehicle(path: &Path) -> Result<(String, VehicleConfig), Failure> {
    let text =
        fs::read_to_string(path).map_err(|source| Failure::Vehicle { path: path.to_owned(), source })?;
    // Definitions of CAN messages are beside the vehicle file.
    let beside =
        |name: &str| fs::read_to_string(path.with_file_name(name)).map_err(|error| error.to_string());
    let name = path.display().to_string();
    let document = Document::new(&name, &text);
    let vehicle = VehicleConfig::parse(document, &KINDS, &beside)?;
    Ok((text, vehicle))
}

/// Checks, before the measurement begins, that existing files in the folder were written by this program.
fn may_write(folder: &Path, force: bool) -> Result<(), Failure> {
    let names = TRADES.iter().flat_map(|(name, _)| [format!("{name}.csv"), format!("{name}.svg")]);
    for name in names.chain(["README.md", "method.md", "cost.json"].map(str::to_owned)) {
        let path = folder.join(&name);
        match fs::read_to_string(&path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            Ok(text) if text.starts_with(TABLE) || text.contains("headrace cost") => {}
            _ if force => {}
            _ => return Err(Failure::InTheWay { path }),
        }
    }
    Ok(())
}

fn is_picture(name: &str) -> bool {
    Path::new(name).extension().is_some_and(|extension| extension == "svg")
}

/// The command line, except for the folder of results.
fn command(args: &Cost) -> String {
    let quick = if args.quick { " --quick" } else { "" };
    let only = if args.only.is_empty() { String::new() } else { format!(" --only {}", args.only.join(",")) };
    let vehicle =
        args.vehicle.as_ref().map(|file| format!(" --vehicle {}", file.display())).unwrap_or_default();
    format!("headrace cost{quick}{only}{vehicle}")
}

/// The processor and how the program was built, as reported by the system.
fn machine() -> String {
    let known = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = known.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    let model = model.map_or("a processor that the system doesn't name", |(_, name)| name.trim());
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let built = if cfg!(debug_assertions) { "debug" } else { "release" };
    format!("{model}, {cores} cores, {built} build")
}
