//! Measures the time saved by simulating only the effects that a scene calls for, instead of all effects.
//!
//! `headrace simulate --explain=worth` measures the influence of effects.

use headrace_simulator::{Scene, Simulation};
use headrace_tests::scenes;

use crate::workload::{EFFECTS, best, simulate};

/// Shipped scenes that the bench simulates. Their dives last some minutes each.
const SCENES: [&str; 6] = ["rehearsal", "steel", "collapse", "drop-outs", "leak-current", "small-pipe"];
/// Effects that simulate broken devices. The bench never adds them to a scene.
const FAULTS: [&str; 2] = ["stuck_range", "device_faults"];

/// Prints a row of the table for each scene.
pub(crate) fn called() {
    println!(
        "\n| scene | effects called | ms for a second of diving | all that it can have | ms | saved |\n|---|---|---|---|---|---|"
    );
    for name in SCENES {
        let text = text(name);
        against_all(name, &text, &scene(&text, None));
    }
}

/// A shipped scene with the effects that it calls for.
fn text(name: &str) -> String {
    let path = headrace_tests::root().join(format!("deploy/scenes/{name}.toml"));
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.contains("\n[effects]\n"), "{name} has no table of effects");
    text.replace("\n[effects]\n", "\n[effects]\ntake = \"called\"\n")
}

fn scene(text: &str, seed: Option<u64>) -> Scene {
    let folder = headrace_tests::root().join("deploy/scenes");
    let load = |name: &str| std::fs::read(folder.join(name)).map_err(|error| error.to_string());
    scenes::seeded(text, &load, seed)
}

/// Compares the time to simulate the effects that a scene calls for with the time for every effect. The effects that
/// the scene doesn't call for get the parameters in this bench's own list.
fn against_all(name: &str, text: &str, called: &Scene) {
    let mut all = text.to_owned();
    let mut count = called.simulated().len();
    let others =
        EFFECTS.iter().filter(|(name, _)| !FAULTS.contains(name) && !called.simulated().contains(name));
    for (name, keys) in others {
        // Keys that name sensors of another vehicle are dropped. The effect then acts on all sensors that it supports.
        let keys: Vec<&str> = keys.lines().filter(|line| !line.starts_with("sensors")).collect();
        let with = format!("{all}\n[effects.{name}]\n{}\n", keys.join("\n"));
        // The bench leaves out effects that are impossible in this scene.
        if Scene::parse(
            headrace_config::Document::new("scene.toml", &with),
            &headrace_devices::KINDS,
            &|name| {
                let folder = headrace_tests::root().join("deploy/scenes");
                std::fs::read(folder.join(name)).map_err(|error| error.to_string())
            },
            None,
        )
        .is_ok_and(|scene| Simulation::new(&scene).is_ok())
        {
            all = with;
            count += 1;
        }
    }
    let every = scene(&all, None);
    let duration_s =
        |scene: &Scene| Simulation::new(scene).map_or(f64::NAN, |simulation| simulation.duration_s());
    let [called_s, every_s] = best(5, [&mut || simulate(called), &mut || simulate(&every)]);
    let (called_s, every_s) = (called_s / duration_s(called), every_s / duration_s(&every));
    println!(
        "| {name} | {} | {:.2} | {count} | {:.2} | {:.0} % |",
        called.simulated().len(),
        called_s * 1e3,
        every_s * 1e3,
        (1.0 - called_s / every_s) * 100.0
    );
}
