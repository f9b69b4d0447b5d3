//! Coverage of the wall: holes, verdicts, flags and causes, compared with independent computations.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a failed step ends the test")]

mod cable;
mod causes;
mod confidence;
mod counters;
mod coverage_extent;
mod dives;
mod faults;
mod field;
mod flags;
mod impossible_walls;
mod interventions;
mod long_dives;
mod memory;
mod metamorphic;
mod observed;
mod oracle;
mod other_wall;
mod settings;
mod stuck_sensors;
mod true_holes;
mod truth;
mod visits;
mod wall_samples;
