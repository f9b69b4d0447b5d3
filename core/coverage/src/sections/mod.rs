//! All sections of the tunnel: statistics, hole, verdict and flag of each.

mod due;
mod section_table;

pub(crate) use section_table::verdict;
pub use section_table::{Ended, Judging, Request, Sections, back_to_m};
