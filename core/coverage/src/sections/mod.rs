//! All sections of the tunnel: statistics, hole, verdict and flag of each.

mod due;
mod section_table;
mod suggested_opening;
mod wall_stretches;

pub(crate) use section_table::verdict;
pub use section_table::{Ended, Judging, Request, Sections, back_to_m};
pub use wall_stretches::WallStretch;
