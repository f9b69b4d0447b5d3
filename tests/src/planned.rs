//! Planned speed of a vehicle, as `headrace plan` computes it.

use headrace_geometry::math;
use headrace_sampling::plan::Planner;
use headrace_simulator::position_error_model;
use headrace_vehicle::VehicleConfig;

/// Planned speed of a vehicle in a mode, m/s. The plan assumes that the vehicle drives in the middle of the tunnel,
/// with its own position errors.
pub fn planned_mps(vehicle: &VehicleConfig, text: &str, mode: &str) -> f64 {
    let load = |_: &str| Ok(text.as_bytes().to_vec());
    let errors =
        position_error_model::expected_errors(vehicle, "vehicle.toml", &headrace_devices::KINDS, &load)
            .unwrap();
    let planner = Planner::new(vehicle.inspection().unwrap()).unwrap().with_errors(errors);
    let number = planner.modes().iter().position(|planned| planned.mode.name == mode).unwrap();
    // Like `plan`, rounds the speed down to whole millimetres per second.
    math::floor_to_i64(planner.v_max_mps(number, vehicle.target.max_hole_m).unwrap_or(0.0) * 1e3) as f64
        * 1e-3
}
