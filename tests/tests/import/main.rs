//! Foreign files and recordings become dive logs.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a failed step ends the test")]

mod doubt;
mod import;
mod recordings;
mod ros_dive;
mod ros_import;
