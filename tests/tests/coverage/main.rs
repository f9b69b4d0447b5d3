//! Coverage of the wall: holes, verdicts, flags and causes against independent accounts of them.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test stops at what it can't do")]

mod bad;
mod causes;
mod dives;
mod flags;
mod memory;
mod metamorphic;
mod oracle;
mod wall_samples;
