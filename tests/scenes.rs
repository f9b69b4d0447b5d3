//! The scenes that are shipped: each can be simulated, and names only what its vehicle has.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "clippy.toml's leave for tests doesn't reach their helpers"
)]

use std::path::{Path, PathBuf};

use headrace_core::app::device::DeviceKind;
use headrace_core::config::Document;
use headrace_replay::simulate::{Scene, Simulation};

const KINDS: [&dyn DeviceKind; 5] = [
    &headrace_imagenex881::Kind,
    &headrace_ping1d::Kind,
    &headrace_bar100::Kind,
    &headrace_imu_can::Kind,
    &headrace_tether_hid::Kind,
];

fn shipped() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("deploy/scenes");
    let files = |folder: &Path| std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut scenes: Vec<_> = files(&folder).chain(files(&folder.join("paper"))).collect();
    scenes.retain(|path| path.extension().is_some_and(|extension| extension == "toml"));
    scenes.sort();
    scenes
}

#[test]
fn every_shipped_scene_can_be_simulated() {
    let scenes = shipped();
    assert_eq!(scenes.len(), 26, "{scenes:?}");
    for path in scenes {
        let folder = path.parent().unwrap();
        let load = |name: &str| std::fs::read(folder.join(name)).map_err(|error| error.to_string());
        let text = std::fs::read_to_string(&path).unwrap();
        let name = path.display().to_string();
        let scene = Scene::parse(Document::new(&name, &text), &KINDS, &load, None);
        let scene = scene.unwrap_or_else(|why| panic!("{why}"));
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
