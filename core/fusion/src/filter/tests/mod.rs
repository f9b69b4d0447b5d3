//! The filter against oracles of 100 digits, against textbook forms, and on hard cases.

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
