//! Options and commands that any program of its kind has.

use std::path::PathBuf;

use clap::Args;
use clap_complete::Shell;

/// What happens to files that are there already.
#[derive(Debug, Args)]
pub(crate) struct Overwrite {
    /// Overwrite files that aren't earlier outputs of the same kind.
    #[arg(long)]
    pub(crate) force: bool,
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
