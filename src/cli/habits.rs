//! Options and commands that any program of its kind has.

use std::path::PathBuf;

use clap::Args;
use clap_complete::Shell;
use headrace_replay::threads::MOST_THREADS;

/// What happens to files that are there already.
#[derive(Debug, Args)]
pub(crate) struct Overwrite {
    /// Overwrite files that aren't earlier outputs of the same kind.
    #[arg(long)]
    pub(crate) force: bool,
}

/// On how many threads a log is replayed.
#[derive(Debug, Args)]
pub(crate) struct Threads {
    /// Threads to replay on: 2 read and navigate on one of them, 3 and more advise on another. Results don't depend on it. By
    /// default 3, or 1 on a machine with one core; at another speed than max always 1.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=64))]
    threads: Option<u8>,
}

impl Threads {
    /// Threads of one replay.
    pub(crate) fn of_replay(&self) -> usize {
        let usual = if cores() > 1 { MOST_THREADS } else { 1 };
        self.threads.map_or(usual, usize::from)
    }
}

fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

#[derive(Debug, Args)]
pub(crate) struct Completions {
    /// Shell to write the script for.
    pub(crate) shell: Shell,
}

#[derive(Debug, Args)]
pub(crate) struct Man {
    /// Output folder for all pages; without one the program's own page goes to stdout.
    #[arg(value_name = "DIR")]
    pub(crate) folder: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) overwrite: Overwrite,
}
