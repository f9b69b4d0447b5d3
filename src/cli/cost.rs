//! Arguments of `headrace cost`.

use std::path::PathBuf;

use clap::Args;
use clap::builder::PossibleValuesParser;
use headrace_cost::trades::TRADES;

use super::Overwrite;

#[derive(Debug, Args)]
pub(crate) struct Cost {
    /// Take under a minute: few settings and seeds, short dives.
    #[arg(long)]
    pub(crate) quick: bool,
    /// Measure these trades only.
    #[arg(long, value_name = "TRADE,..", value_delimiter = ',', value_parser = PossibleValuesParser::new(TRADES.map(|(name, _)| name)))]
    pub(crate) only: Vec<String>,
    /// Vehicle file whose survey is priced in place of the shipped ones'; the other trades are of shipped vehicles.
    #[arg(long, value_name = "FILE")]
    pub(crate) vehicle: Option<PathBuf>,
    /// Folder for page, JSON, tables and pictures.
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) overwrite: Overwrite,
}
