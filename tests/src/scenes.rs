//! Scenes of the shipped vehicles, for tests and benches within one process.

use headrace_config::Document;
use headrace_monitor::App;
use headrace_monitor::report::Report;
use headrace_replay::SimulationFeed;
use headrace_replay::drive::{Pace, drive};
use headrace_simulator::{FileLoader, Scene, Simulation};

use crate::repository::root;

/// Content of a vehicle file in `deploy/vehicles`.
pub fn vehicle_file(name: &str) -> Result<Vec<u8>, String> {
    let folder = root().join("deploy/vehicles");
    std::fs::read(folder.join(name)).map_err(|error| error.to_string())
}

/// Parses a scene of a shipped vehicle.
pub fn scene(text: &str) -> Scene {
    scene_from(text, &vehicle_file)
}

/// Parses a scene; `load` provides the files that the scene names.
pub fn scene_from(text: &str, load: FileLoader<'_>) -> Scene {
    seeded(text, load, None)
}

/// Parses a scene and replaces its seed, if one is given.
pub fn seeded(text: &str, load: FileLoader<'_>, seed: Option<u64>) -> Scene {
    let scene = Scene::parse(Document::new("scene.toml", text), &headrace_devices::KINDS, load, seed);
    scene.unwrap_or_else(|why| panic!("{why}"))
}

/// Simulates a scene and returns the loop's report.
pub fn report(scene: &Scene) -> Report {
    let vehicle = &scene.vehicle;
    let mut app = App::new(vehicle.mission());
    for sensor in &vehicle.sensors {
        app.add_device(sensor.as_ref()).unwrap();
    }
    let mut dive = app.arm(vehicle.navigation()).unwrap();
    let simulation = Simulation::new(scene).unwrap_or_else(|why| panic!("{why}"));
    drive(&mut dive, &mut SimulationFeed::new(simulation), Pace::default(), &mut |_| {}).unwrap();
    dive.finish(&mut |_, _| {});
    Report::of(&dive)
}
