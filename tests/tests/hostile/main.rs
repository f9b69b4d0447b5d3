//! Hostile and broken input: every command ends, uses bounded memory, and reports the parts that it couldn't read.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a failed step ends the test")]

mod bomb_files;
mod bomb_logs;
mod bombs;
mod escapes;
mod records;
mod run;
mod seeks;
mod times;
