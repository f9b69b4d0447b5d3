//! Files and recordings of others become dive logs.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test stops at what it can't do")]

mod import;
mod recordings;
mod ros_dive;
mod ros_import;
