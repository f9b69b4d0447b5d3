//! The shipped scenes. Each scene can be simulated, and names only parts that its vehicle has.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use headrace_simulator::Simulation;
use headrace_tests::{scenes, truth};

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
    assert_eq!(scenes.len(), 29, "{scenes:?}");
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
        assert!(pings > 500 && heard > pings / 2, "{name}: {heard} of {pings} pings with a return");
        let added = simulation.added().len();
        assert!(added > 0 && text.contains("motion_within_turn"), "{name}: {added} effects");
    }
}

/// The page that documents the scenes must state the true lengths of their dives.
#[test]
fn shipped_scenes_match_the_figures_of_their_page() {
    let folder = headrace_tests::root().join("deploy/scenes");
    let page = std::fs::read_to_string(folder.join("README.md")).unwrap();
    let rows: Vec<Vec<&str>> = page
        .lines()
        .filter(|line| line.starts_with("| `"))
        .map(|line| line.split('|').map(|cell| cell.trim().trim_matches('`')).collect())
        .collect();
    let names: BTreeSet<&str> = rows.iter().map(|row| row[1]).collect();
    let shipped = files().into_iter().filter(|path| path.parent() == Some(&folder));
    let shipped: BTreeSet<String> =
        shipped.map(|path| path.file_stem().unwrap().to_string_lossy().into_owned()).collect();
    assert!(shipped.iter().map(String::as_str).eq(names.iter().copied()), "{shipped:?} and {names:?}");
    std::thread::scope(|scope| {
        for half in [0, 1] {
            let (rows, folder) = (&rows, &folder);
            scope.spawn(move || {
                for row in rows.iter().filter(|row| !row[2].is_empty()).skip(half).step_by(2) {
                    let text = std::fs::read_to_string(folder.join(format!("{}.toml", row[1]))).unwrap();
                    let load =
                        |name: &str| std::fs::read(folder.join(name)).map_err(|error| error.to_string());
                    let summary = truth::dive(&scenes::scene_from(&text, &load)).report.summary;
                    let metres = [summary.pass_m, summary.fail_m, summary.cannot_say_m];
                    let metres = metres.map(|metres_m| format!("{}", (100.0 * metres_m).round() / 100.0));
                    assert_eq!(row[2..5], metres, "{}", row[1]);
                }
            });
        }
    });
}
