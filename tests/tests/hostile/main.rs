//! Hostile and broken input: every command ends within bounded memory and reports what it couldn't read.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a failed step ends the test")]

mod bomb_files;
mod bomb_logs;
mod bombs;
mod escapes;
mod jumps;
mod records;
mod run;
mod times;
