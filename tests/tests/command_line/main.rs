//! Tests of the command line: answers, refusals, screens, and written files.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a failed step ends the test")]

mod bad_input;
mod check;
#[cfg(unix)]
mod conventions;
mod deliver;
mod deliver_files;
mod dives;
mod go_back_advice;
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
#[cfg(unix)]
mod tutorial;
mod viewers;
