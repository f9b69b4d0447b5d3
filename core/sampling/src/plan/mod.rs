//! Planning before a dive: coverage by heads, modes, layout and speed in a tunnel, without measurements.

mod answer;
mod briefing;
mod mounts;
mod planner;
mod started;
mod wall;

pub use answer::{Answer, Question, Spacing};
pub use briefing::{Briefing, Heard, Hidden, HullAdvice, Start, ThinStrip};
pub use mounts::InLine;
pub use planner::{HELD_SHARE, Inspection, PlannedMode, Planner};
pub use wall::{PatternSample, WallPlace};
