//! Dive logs: recorded, replayed, verified, recovered and trimmed. Includes damaged, foreign and odd logs.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a failed step ends the test")]

mod alerts;
mod determinism;
mod dive_time;
#[cfg(target_os = "linux")]
mod faults;
mod foreign_log;
mod golden;
mod odd_logs;
mod playback;
mod recover;
mod resume;
mod rotation;
mod snapshots;
mod threads;
mod trim;
mod verify;
