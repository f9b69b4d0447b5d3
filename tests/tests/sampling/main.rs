//! Sampling theory, plans and advice. Equations are compared with independent values, and promises with simulated
//! dives.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a failed step ends the test")]

mod advice;
mod calm;
mod head_return;
mod ideal_table;
mod interleave;
mod oracle;
mod phase;
mod plan_holes;
mod survey;
mod swinging;
