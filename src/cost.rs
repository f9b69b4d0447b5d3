//! `headrace cost`: what accuracy costs in time.

use std::path::{Path, PathBuf};

use headrace_cost::effort::Effort;
use headrace_cost::page::{Bars, COST_VERSION, Results, table};
use headrace_cost::scene::Inputs;
use headrace_cost::trades::{GIVEN, TRADES};

use crate::cli::Cost;
use crate::devices::KINDS;
use crate::failure::{self, Failure};
use crate::files;
use crate::output::{say, show};
use crate::outputs::{self, COST, Claims, Kind};
use crate::vehicle_file;

/// `headrace cost`.
pub(crate) fn cost(args: &Cost) -> Result<u8, Failure> {
    let own = args.vehicle.as_deref().map(vehicle_file::read).transpose()?;
    if let Some(folder) = &args.out {
        let own = args.vehicle.as_deref().zip(own.as_ref());
        let inputs = own.map(|(path, (_, vehicle))| vehicle_file::files(path, vehicle));
        claim(folder, args, inputs.unwrap_or_default())?;
    }
    let inputs = Inputs {
        effort: if args.quick { Effort::Quick } else { Effort::Full },
        kinds: &KINDS,
        vehicle: own.as_ref().map(|(text, vehicle)| (vehicle.name.as_str(), text.as_str())),
    };
    let progress = &mut |words: &str| tracing::info!("{words}");
    let mut trades = Vec::new();
    for (name, measure) in TRADES {
        if args.only.is_empty() || args.only.iter().any(|only| only == name) {
            let trade = measure(&inputs, progress)?;
            show(&table(&trade));
            trades.push(trade);
        }
    }
    let mut given = Vec::new();
    for tabulate in GIVEN.iter().filter(|_| args.only.is_empty()) {
        given.push(tabulate(&inputs, progress)?);
    }
    let Some(folder) = &args.out else { return Ok(failure::OK) };
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
        let is_picture = Path::new(&name).extension().is_some_and(|extension| extension == "svg");
        let end = if is_picture { COST } else { "" };
        let path = folder.join(name);
        files::write(&path, (content + end).as_bytes())?;
        say(&format!("wrote {}", path.display()));
    }
    Ok(failure::OK)
}

/// Checks, before the work, that all files can be written.
fn claim(folder: &Path, args: &Cost, inputs: Vec<PathBuf>) -> Result<(), Failure> {
    outputs::folder(folder)?;
    let names = TRADES.iter().flat_map(|(name, _)| [format!("{name}.csv"), format!("{name}.svg")]);
    let mut claims = Claims::reading(inputs, &args.overwrite);
    for name in names.chain(["README.md".to_owned(), "cost.json".to_owned()]) {
        claims.claim("--out", &folder.join(name), Kind::Cost)?;
    }
    Ok(())
}

/// The command that was given, but for where its files go.
fn command(args: &Cost) -> String {
    let quick = if args.quick { " --quick" } else { "" };
    let only = if args.only.is_empty() { String::new() } else { format!(" --only {}", args.only.join(",")) };
    let vehicle =
        args.vehicle.as_ref().map(|file| format!(" --vehicle {}", file.display())).unwrap_or_default();
    format!("headrace cost{quick}{only}{vehicle}")
}

/// The processor and how the program was built, as the system tells it.
fn machine() -> String {
    let known = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = known.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    let model = model.map_or("a processor that the system doesn't name", |(_, name)| name.trim());
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let built = if cfg!(debug_assertions) { "debug" } else { "release" };
    format!("{model}, {cores} cores, {built} build")
}
