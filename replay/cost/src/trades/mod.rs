//! The trades: each a file with a function `measure`, listed here.

use crate::error::CostError;
use crate::point::Trade;
use crate::scene::Inputs;

mod judging;
pub mod live;
pub mod navigation;
pub mod simulation;

/// Measures a trade; what is being done is told to the second argument.
pub type Measure = fn(&Inputs<'_>, &mut dyn FnMut(&str)) -> Result<Trade, CostError>;

/// All trades by name, in the order of the page.
pub const TRADES: [(&str, Measure); 3] =
    [("navigation", navigation::measure), ("simulation", simulation::measure), ("live", live::measure)];
