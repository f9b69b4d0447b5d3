//! Planned speeds of a vehicle.

use headrace_geometry::math;
use headrace_sampling::plan::Planner;
use headrace_simulator::calm;
use headrace_vehicle::VehicleConfig;

/// Planned speed of a vehicle in a mode, in the middle of its tunnel, with its own position errors, m/s.
pub fn planned_mps(vehicle: &VehicleConfig, text: &str, mode: &str) -> f64 {
    let load = |_: &str| Ok(text.as_bytes().to_vec());
    let errors = calm::expected_errors(vehicle, "vehicle.toml", &headrace::devices::KINDS, &load).unwrap();
    let planner = Planner::new(vehicle.inspection().unwrap()).unwrap().with_errors(errors);
    let number = planner.modes().iter().position(|planned| planned.mode.name == mode).unwrap();
    // A plan is printed in millimetres per second.
    math::floor_to_i64(planner.v_max_mps(number, vehicle.target_m).unwrap_or(0.0) * 1e3) as f64 * 1e-3
}
