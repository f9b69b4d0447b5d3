//! Tables and experiments as text for a terminal.

mod experiments;
mod tables;

pub use experiments::words as experiments;
pub use tables::words as tables;
