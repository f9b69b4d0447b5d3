//! The paper's tables and experiments on the terminal, beside recomputed ones: command line, output, exit codes.

use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use headrace_experiments::{ExperimentError, drawings, paper, run, words};

/// Recompute the results of the paper on which headrace's sampling theory is based.
#[derive(Debug, Parser)]
#[command(name = "headrace_experiments", version, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Tables 1 to 5: each printed number next to the recomputed one, with notes on errors in the paper.
    #[command(after_help = "Example:\n  cargo run --release -p headrace_experiments -- tables --json")]
    Tables {
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
    /// The simulated and real experiments (§8 and §9); takes a minute or two.
    #[command(
        after_help = "Example:\n  cargo run --release -p headrace_experiments -- experiments --svg pictures"
    )]
    Experiments {
        /// Print JSON.
        #[arg(long)]
        json: bool,
        /// Output folder for charts like Figures 6, 8, 12, 13 and 15.
        #[arg(long, value_name = "DIR")]
        svg: Option<PathBuf>,
    },
}

/// A failure of a command.
#[derive(Debug, thiserror::Error)]
enum Failure {
    #[error(transparent)]
    Experiment(#[from] ExperimentError),
    #[error("making JSON of the results: {0}")]
    Json(#[from] serde_json::Error),
    #[error("writing {}: {source}", path.display())]
    Write { path: PathBuf, source: std::io::Error },
}

fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Tables { json } => tables(json),
        Command::Experiments { json, svg } => experiments(json, svg.as_deref()),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("headrace_experiments: {failure}");
            ExitCode::FAILURE
        }
    }
}

fn tables(json: bool) -> Result<(), Failure> {
    let tables = paper::tables().map_err(ExperimentError::from)?;
    put(&if json { as_json(&tables)? } else { words::tables(&tables) })
}

fn experiments(json: bool, svg: Option<&Path>) -> Result<(), Failure> {
    let report = run(&progress)?;
    progress("");
    put(&if json { as_json(&report)? } else { words::experiments(&report) })?;
    let Some(folder) = svg else { return Ok(()) };
    let failed = |path: &Path| {
        let path = path.to_owned();
        |source| Failure::Write { path, source }
    };
    std::fs::create_dir_all(folder).map_err(failed(folder))?;
    for (name, svg) in drawings::all(&progress)? {
        let path = folder.join(name);
        std::fs::write(&path, svg).map_err(failed(&path))?;
    }
    progress("");
    if json { Ok(()) } else { put(&format!("\npictures in {}\n", folder.display())) }
}

fn as_json(value: &impl serde::Serialize) -> Result<String, Failure> {
    Ok(format!("{}\n", serde_json::to_string_pretty(value)?))
}

fn put(text: &str) -> Result<(), Failure> {
    let mut stdout = std::io::stdout().lock();
    let written = stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush());
    written.map_err(|source| Failure::Write { path: "standard output".into(), source })
}

/// Shows the status on a line that the next status overwrites, if stderr is a terminal.
fn progress(what: &str) {
    if std::io::stderr().is_terminal() {
        eprint!("\r\x1b[K{what}");
    }
}
