//! Navigation: the filter and the smoother against the truth, calibration, outages, other vehicles.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test stops at what it can't do")]

mod calibration;
mod fusion;
mod hard_cases;
mod imu_truth;
mod other_vehicles;
mod outage;
mod rough_walls;
mod smoothing;
