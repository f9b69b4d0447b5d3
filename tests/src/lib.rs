//! Fixtures of tests and benches: the program in its own folder, scenes, instrumented dives, independent models to
//! compare with, and devices on real ports.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a failed step ends the test")]

pub mod advised;
#[cfg(unix)]
mod drops;
#[cfg(unix)]
pub mod faulty;
pub mod field;
pub mod field_table;
pub mod flags;
mod folder;
#[cfg(unix)]
pub mod garbling;
pub mod instrumented;
pub mod interventions;
pub mod json_schema;
mod log_files;
#[cfg(unix)]
pub mod page_client;
pub mod passable;
#[cfg(unix)]
mod patient;
pub mod planned;
#[cfg(unix)]
pub mod pty;
pub mod random;
pub mod random_dives;
mod repository;
#[cfg(unix)]
pub mod rig;
pub mod scenes;
#[cfg(unix)]
pub mod screen;
mod short_dive;
pub mod spacings;
pub mod tracking;
pub mod truth;
#[cfg(unix)]
pub mod world;

pub use headrace_support::{recordings, skipped};

pub use folder::{Answer, Folder, program};
pub use log_files::{raw_messages, write_log};
pub use repository::root;
pub use short_dive::{SCENE, VEHICLE, other_vehicle};
