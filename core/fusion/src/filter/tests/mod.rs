//! Tests of the filter against 100-digit oracles and textbook forms, and on hard cases.

mod faults;
mod hard_cases;
mod jacobians;
mod journal;
mod noise;
mod oracle;
mod properties;
mod rest;
mod rig;
mod wrong_settings;
