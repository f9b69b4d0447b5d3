//! Writes results as files: a page in Markdown, JSON, and a CSV and a picture for each trade.
//!
//! All files are made from [`Results`] alone, so a test can detect a page that does not match its data.

mod csv;
mod markdown;
mod table;

use serde::{Deserialize, Serialize};

use crate::draw;
use crate::point::{Given, Trade};

pub use table::table;

/// Version of the format of `cost.json`.
pub const COST_VERSION: u32 = 1;

/// Kind of bounds that are stated for each cost: quartiles or a 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Bars {
    /// Quartiles of nine rounds. Files that don't state a kind have these bounds.
    #[default]
    Quartiles,
    /// The 95 % interval of the median.
    Median,
}

impl Bars {
    /// Describes a cost and its bounds for the page method.md.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Quartiles => {
                "median over nine rounds, each of which measures every setting once. Its bounds are the quartiles"
            }
            Self::Median => {
                "median over nine rounds (three with `--quick`), each of which measures every setting once. Its bounds are the 95 % interval by the sign test"
            }
        }
    }
}

/// All results of `headrace cost`: the trades, and the machine on which they were measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Results {
    /// Version of this format.
    pub cost_version: u32,
    /// Name and version of the program that made the measurements.
    pub program: String,
    /// The machine: processor, cores, debug or release.
    pub machine: String,
    /// The command that reproduces the results.
    pub command: String,
    /// Kind of bounds that are stated for each cost: quartiles or a 95 % interval.
    #[serde(default)]
    pub bars: Bars,
    /// The trades.
    pub trades: Vec<Trade>,
    /// Tables of the costs of properties that are not a choice, such as determinism.
    pub given: Vec<Given>,
}

impl Results {
    /// All files, each with its name and content.
    ///
    /// Errors: a figure that JSON can't represent.
    pub fn files(&self) -> Result<Vec<(String, String)>, serde_json::Error> {
        let mut files = vec![
            ("README.md".to_owned(), markdown::advice(self)),
            ("method.md".to_owned(), markdown::method(self)),
            ("cost.json".to_owned(), serde_json::to_string_pretty(self)? + "\n"),
        ];
        for trade in &self.trades {
            files.push((format!("{}.csv", trade.name), csv::csv(trade)));
            files.push((format!("{}.svg", trade.name), draw::svg(trade)));
        }
        Ok(files)
    }
}
