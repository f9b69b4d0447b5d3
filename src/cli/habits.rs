//! Options and commands that most command-line programs have.

use std::path::PathBuf;

use clap::Args;
use clap_complete::Shell;
use headrace_replay::threads::MOST_THREADS;

/// Handling of existing files.
#[derive(Debug, Args)]
pub(crate) struct Overwrite {
    /// Overwrite existing files even if they aren't earlier outputs of the same kind.
    #[arg(long)]
    pub(crate) force: bool,
}

/// Number of threads of a replay.
#[derive(Debug, Args)]
pub(crate) struct Threads {
    /// Threads of the replay. With 2, reading and navigation run on one of them; with 3 or more, advice runs
    /// on another. Results don't depend on it. The default is 3, or 1 on a machine with one core. At a speed
    /// other than max it is always 1.
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
    /// Output folder for all pages. Without it the program's own page goes to stdout.
    #[arg(value_name = "DIR")]
    pub(crate) folder: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) overwrite: Overwrite,
}
