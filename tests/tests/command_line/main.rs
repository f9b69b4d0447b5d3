//! The command line: what it answers, refuses and draws, and the files that it writes for people and programs.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test stops at what it can't do")]

mod bad_input;
mod check;
#[cfg(unix)]
mod habits;
mod logging;
mod mavlink_out;
mod overwriting;
mod plan;
#[cfg(unix)]
mod playback;
mod readme;
mod registration;
mod report_schema;
mod screens;
#[cfg(unix)]
mod tui;
mod viewers;
mod way_back;
