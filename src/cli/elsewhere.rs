//! Arguments of commands that other programs provide.

use std::ffi::OsString;

use clap::Args;

/// Help on the program for campaigns.
pub(super) const CAMPAIGN: &str = "Done by the program headrace-campaign; it is built in lab/: cargo build --release -p headrace_campaign. \
docs/how-to/replay-many-dives.md is its manual, --help lists its options.";
/// Help on the program for costs.
pub(super) const COST: &str = "Done by the program headrace-cost; it is built in lab/: cargo build --release -p headrace_cost. docs/why/cost shows \
what it finds, --help lists its options.";

#[derive(Debug, Args)]
pub(crate) struct Elsewhere {
    /// Arguments passed to that program.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "ARGUMENTS")]
    pub(crate) arguments: Vec<OsString>,
}
