//! What accuracy costs: headrace's errors against its time, setting by setting.
//!
//! A trade is a question ("what does a finer target cost?"), answered by points: a setting, its error against independent values, and
//! its cost. Errors are told in what is decided by: the hole D of a section, and metres falsely passed. `trades/` has a file for each.
//! The independent values, and the simulated dives that both are found on, are those of `headrace_oracle`.

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
