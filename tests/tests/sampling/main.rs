//! Sampling theory, plans and advice: the equations against independent values, and simulated dives against what they promise.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test stops at what it can't do")]

mod advice;
mod calm;
mod ideal_table;
mod interleave;
mod oracle;
mod phase;
mod plan_holes;
mod survey;
