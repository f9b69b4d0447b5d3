//! Hostile and broken input: every command ends, in bounded memory, and tells what it couldn't take.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test stops at what it can't do")]

mod bomb_files;
mod bomb_logs;
mod bombs;
mod escapes;
mod jumps;
mod records;
mod run;
mod times;
