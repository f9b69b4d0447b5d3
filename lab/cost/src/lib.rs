//! The cost of accuracy: headrace's errors and computing time, setting by setting.
//!
//! A trade is a question ("what does a finer target cost?") answered by points. A point is a setting with its error
//! against independent values and its cost. Errors are stated in quantities that matter to a survey: the hole diameter
//! D of a section, and the length falsely passed. `trades/` has a file for each trade. `headrace_oracle` provides the
//! independent values and the simulated dives.

pub mod draw;
pub mod effort;
pub mod error;
pub mod measure;
pub mod page;
pub mod point;
pub mod scene;
pub mod trades;
pub mod verdicts;
mod words;
