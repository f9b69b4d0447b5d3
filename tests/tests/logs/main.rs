//! Dive logs: recorded, replayed, verified, recovered and trimmed; damaged, foreign and odd ones.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test stops at what it can't do")]

mod alerts;
mod determinism;
#[cfg(target_os = "linux")]
mod faults;
mod foreign_log;
mod golden;
mod odd_logs;
mod playback;
mod recover;
mod rotation;
mod snapshots;
mod threads;
mod trim;
mod verify;
