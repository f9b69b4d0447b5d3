//! The scenes that are shipped: each can be simulated, and names only what its vehicle has.

use std::path::{Path, PathBuf};

use headrace_simulator::Simulation;
use headrace_tests::scenes;

fn files() -> Vec<PathBuf> {
    let folder = headrace_tests::root().join("deploy/scenes");
    let all = |folder: &Path| std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut scenes: Vec<_> = all(&folder).chain(all(&folder.join("paper"))).collect();
    scenes.retain(|path| path.extension().is_some_and(|extension| extension == "toml"));
    scenes.sort();
    scenes
}

#[test]
fn every_shipped_scene_can_be_simulated() {
    let scenes = files();
    assert_eq!(scenes.len(), 28, "{scenes:?}");
    for path in scenes {
        let folder = path.parent().unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let name = path.display().to_string();
        let load = |name: &str| std::fs::read(folder.join(name)).map_err(|error| error.to_string());
        let scene = scenes::scene_from(&text, &load);
        let mut simulation = Simulation::with_truth(&scene).unwrap_or_else(|why| panic!("{name}: {why}"));
        let (mut heard, mut pings) = (0, 0);
        for _ in 0..20 {
            assert!(simulation.advance(), "{name} ends within 20 s");
            for row in simulation.take_truth() {
                let Some(sounding) = row.sounding else { continue };
                pings += 1;
                heard += usize::from(sounding.measured.range_m.is_some());
            }
        }
        assert!(pings > 500 && heard > pings / 2, "{name}: {heard} of {pings} pings heard");
        let added = simulation.added().len();
        assert!(added > 0 && text.contains("motion_within_turn"), "{name}: {added} effects");
    }
}
