//! The trades (comparisons of error and cost): one file for each, with a function `measure`. All are listed here.

mod cells;
mod figures;
pub mod holes;
pub mod live;
pub mod memory;
pub mod navigation;
pub mod simulation;
pub mod sureness;
pub mod survey;

use crate::error::CostError;
use crate::point::{Given, Trade};
use crate::scene::Inputs;

/// Measures a trade; passes status messages to the second argument.
pub type Measure = fn(&Inputs<'_>, &mut dyn FnMut(&str)) -> Result<Trade, CostError>;

/// Makes a table of the costs of properties that are not a choice, such as determinism.
pub type Tabulate = fn(&Inputs<'_>, &mut dyn FnMut(&str)) -> Result<Given, CostError>;

/// All trades by name, in the order of the page.
pub const TRADES: [(&str, Measure); 6] = [
    ("survey", survey::measure),
    ("holes", holes::measure),
    ("navigation", navigation::measure),
    ("sureness", sureness::measure),
    ("simulation", simulation::measure),
    ("live", live::measure),
];

/// Tables of the costs of properties that are not a choice, shown below the trades.
pub const GIVEN: [Tabulate; 1] = [memory::tabulate];
