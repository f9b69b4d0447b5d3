//! Navigation: filter and smoother compared with the truth, calibration, outages, and other vehicles.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a failed step ends the test")]

mod calibration;
mod fusion;
mod hard_cases;
mod imu_truth;
mod other_vehicles;
mod outage;
mod rough_walls;
mod smoothing;
