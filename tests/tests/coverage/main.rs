//! Coverage of the wall: holes, verdicts, flags and causes, compared with independent computations.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a failed step ends the test")]

mod bad;
mod cable;
mod causes;
mod confidence;
mod counters;
mod dives;
mod far_and_long;
mod faults;
mod field;
mod flags;
mod hung;
mod interventions;
mod memory;
mod metamorphic;
mod oracle;
mod settings;
mod true_holes;
mod truth;
mod visits;
mod wall_samples;
mod way;
