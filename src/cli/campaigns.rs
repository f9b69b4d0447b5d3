//! Arguments of commands that another program does.

use std::ffi::OsString;

use clap::Args;

/// Where these commands' program is, and what it takes.
pub(super) const ELSEWHERE: &str = "Done by the program headrace-campaign, beside headrace or on PATH; it is built in campaign/: \
cargo build --release. docs/campaign.md is its manual, --help lists its options.";

#[derive(Debug, Args)]
pub(crate) struct Campaign {
    /// Folder of logs or s3://BUCKET/PREFIX, and options.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "FOLDER")]
    pub(crate) arguments: Vec<OsString>,
}
