//! What `plan` says of a vehicle.

use headrace_geometry::math;
use headrace_sampling::plan::{Inspection, Planner};
use headrace_simulator::calm;
use headrace_vehicle::VehicleConfig;

/// The plan's speed for a vehicle in a mode, in the middle of its tunnel, with its own errors of position, m/s.
pub fn planned_mps(vehicle: &VehicleConfig, text: &str, mode: &str) -> f64 {
    let load = |_: &str| Ok(text.as_bytes().to_vec());
    let errors = calm::expected_errors(vehicle, "vehicle.toml", &headrace::devices::KINDS, &load).unwrap();
    let heads =
        vehicle.sensors.iter().filter_map(|sensor| Some((sensor.head()?, sensor.modes(None).unwrap())));
    let inspection = Inspection {
        profile: vehicle.tunnel.profile.clone(),
        length_m: vehicle.tunnel.length_m,
        place: vehicle.tunnel.profile.reference(),
        heads: heads.collect(),
        hull: vehicle.hull.clone(),
        layout: vehicle.layout,
        drift_m: 0.0,
        yaw_rad: 0.0,
        yaw_rate_radps: 0.0,
        sound_speed_mps: vehicle.site.sound_speed_mps,
    };
    let planner = Planner::new(inspection).unwrap().with_errors(errors);
    let number = planner.modes().iter().position(|planned| planned.mode.name == mode).unwrap();
    // A plan is printed in millimetres a second.
    math::floor_to_i64(planner.v_max_mps(number, vehicle.target_m).unwrap_or(0.0) * 1e3) as f64 * 1e-3
}
