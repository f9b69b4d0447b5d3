//! Dives with the true hole D_true of each section: wrappers of `headrace_oracle` for tests.

use headrace_monitor::run::Loop;
use headrace_simulator::Scene;
use headrace_vehicle::VehicleConfig;

pub use headrace_oracle::dive::{JudgedDive, JudgedSection, Recorded};
pub use headrace_oracle::truth::{REPLACING, TrueSample, Truth};

/// Simulates a scene and replays it with the scene's own vehicle file.
pub fn dive(scene: &Scene) -> JudgedDive {
    dive_believing(scene, &scene.vehicle)
}

/// Simulates a scene and replays it with another vehicle file, with sensors that send the same bytes.
pub fn dive_believing(scene: &Scene, believed: &VehicleConfig) -> JudgedDive {
    dive_noting(scene, believed, &mut |_| {})
}

/// As [`dive_believing`], but calls `note` with the loop after each tick.
pub fn dive_noting(scene: &Scene, believed: &VehicleConfig, note: &mut dyn FnMut(&Loop)) -> JudgedDive {
    let recorded = Recorded::of(scene, believed).unwrap_or_else(|why| panic!("{why}"));
    recorded.judged_with(believed, believed.navigation(), note).unwrap()
}
