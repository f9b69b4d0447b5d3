//! Arguments of commands that another program does.

use std::ffi::OsString;

use clap::Args;

/// Where the program of campaigns is, and what it takes.
pub(super) const CAMPAIGN: &str = "Done by the program headrace-campaign; it is built in lab/: cargo build --release -p headrace_campaign. \
docs/how-to/replay-many-dives.md is its manual, --help lists its options.";
/// The same of costs.
pub(super) const COST: &str = "Done by the program headrace-cost; it is built in lab/: cargo build --release -p headrace_cost. docs/why/cost shows \
what it finds, --help lists its options.";

#[derive(Debug, Args)]
pub(crate) struct Elsewhere {
    /// What that program takes.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "ARGUMENTS")]
    pub(crate) arguments: Vec<OsString>,
}
