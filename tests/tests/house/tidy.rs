//! Layers, a core without I/O and locks, short files, and what each crate states about itself.

use std::path::Path;

use crate::workspace::{Package, root, sources, workspace};

const LONGEST_FILE: usize = 600;

/// Crates of the core, bottom up: each needs only some before it.
const CORE: [&str; 9] =
    ["snapshot", "config", "geometry", "sampling", "sensor", "fusion", "coverage", "vehicle", "monitor"];

/// All that a device's crate needs of the core.
const FOR_DEVICES: [&str; 1] = ["sensor"];

/// What the ports need, which connect devices with the loop.
const FOR_PORTS: [&str; 3] = ["sensor", "geometry", "monitor"];

/// What crates of `replay/` need of one another and of the plugins, besides the core.
const FOR_REPLAY: [(&str, &[&str]); 5] = [
    ("replay/simulator", &[]),
    ("replay/player", &["replay/simulator"]),
    ("replay/calibration", &["replay/player"]),
    ("replay/cost", &["replay/simulator", "replay/player", "pictures"]),
    (
        "replay/import",
        &["replay/player", "plugins/imagenex881", "plugins/imu_can", "plugins/mavlink", "plugins/ping1d"],
    ),
];

/// What the core may not name: time, randomness, files, ports, threads, the environment, locks and unbounded queues.
const BARRED_FROM_CORE: [&str; 13] = [
    "std::fs",
    "std::net",
    "std::io",
    "std::env",
    "std::process",
    "std::thread",
    "std::time",
    "Instant",
    "SystemTime",
    "rand::",
    "Mutex",
    "RwLock",
    "mpsc",
];

/// The operator's page: no device.
const PAGE: &str = "plugins/dashboard";

/// Whether a package in a folder may need one in another.
fn may_need(place: &Path, needed: &Path) -> bool {
    let core = |needed: &Path| CORE.iter().position(|name| needed == Path::new("core").join(name));
    let one_of = |names: &[&str]| names.iter().any(|name| needed == Path::new("core").join(name));
    let kind = place.iter().next().and_then(|name| name.to_str()).unwrap_or_default();
    match kind {
        "core" => core(needed).zip(core(place)).is_some_and(|(needed, place)| needed < place),
        "plugins" if place == Path::new("plugins/ports") => one_of(&FOR_PORTS),
        // It shows what the loop has found.
        "plugins" if place == Path::new(PAGE) => core(needed).is_some(),
        "plugins" => one_of(&FOR_DEVICES),
        "replay" => {
            let others =
                FOR_REPLAY.iter().find(|(name, _)| place == Path::new(name)).map(|(_, others)| *others);
            let others = others.unwrap_or_else(|| panic!("{} has no layer", place.display()));
            core(needed).is_some() || others.iter().any(|other| needed == Path::new(other))
        }
        "pictures" => core(needed).is_some(),
        // The two programs may use every library; neither uses the other.
        "" => needed != Path::new("experiments"),
        "experiments" => needed != Path::new(""),
        "tests" | "benches" => true,
        _ => panic!("{} has no layer", place.display()),
    }
}

#[test]
fn dependencies_point_one_way() {
    let packages = workspace();
    for name in CORE {
        let folder = Path::new("core").join(name);
        assert!(packages.values().any(|package| package.place == folder), "no crate in {}", folder.display());
    }
    for (name, Package { place, needs, .. }) in &packages {
        for need in needs {
            assert!(may_need(place, &packages[need].place), "{name} in {} needs {need}", place.display());
        }
    }
}

#[test]
fn layers_let_nothing_point_back() {
    let pairs = [
        ("core/geometry", "core/snapshot", true),
        ("core/geometry", "core/sampling", false),
        ("core/monitor", "replay/player", false),
        ("plugins/bar100", "core/sensor", true),
        ("plugins/bar100", "core/geometry", false),
        ("plugins/bar100", "plugins/ping1d", false),
        ("plugins/ports", "core/monitor", true),
        ("plugins/ports", "core/coverage", false),
        ("replay/simulator", "core/monitor", true),
        ("replay/simulator", "replay/player", false),
        ("replay/player", "replay/simulator", true),
        ("replay/import", "replay/simulator", false),
        ("replay/import", "plugins/mavlink", true),
        ("replay/import", "plugins/ports", false),
        ("pictures", "replay/player", false),
        ("replay/cost", "pictures", true),
        ("replay/player", "replay/cost", false),
        ("", "plugins/mavlink", true),
        ("", "experiments", false),
        ("experiments", "", false),
        ("tests", "", true),
    ];
    for (place, needed, may) in pairs {
        assert_eq!(may_need(Path::new(place), Path::new(needed)), may, "{place} on {needed}");
    }
}

#[test]
fn the_core_does_no_io_and_takes_no_lock() {
    let mut said = Vec::new();
    let sources: Vec<_> =
        CORE.iter().flat_map(|name| sources(&root().join("core").join(name).join("src"))).collect();
    assert!(sources.len() > 20, "{} files", sources.len());
    for (path, text) in sources {
        for (number, line) in text.lines().enumerate() {
            // Words about such things, in comments, are no use of them.
            let code = line.split("//").next().unwrap_or_default();
            for barred in BARRED_FROM_CORE.iter().filter(|barred| code.contains(**barred)) {
                said.push(format!("{}:{}: {barred}", path.display(), number + 1));
            }
        }
    }
    assert!(said.is_empty(), "{said:#?}");
}

#[test]
fn no_file_is_long() {
    let folders =
        ["src", "core", "plugins", "replay", "pictures", "experiments", "tests", "benches", "examples"];
    for folder in folders {
        for (path, text) in sources(&root().join(folder)) {
            let lines = text.lines().count();
            assert!(lines <= LONGEST_FILE, "{}: {lines} lines; the most is {LONGEST_FILE}", path.display());
        }
    }
}

/// Of passed tests cargo shows nothing that they print, and `.ci/count-skipped` couldn't count it.
#[test]
fn what_is_skipped_is_said_by_the_one_helper() {
    // In pieces, so that this file isn't found.
    let printed = ["println!(\"", "skipped: "].concat();
    for folder in ["src", "core", "plugins", "replay", "experiments", "tests"] {
        for (path, text) in sources(&root().join(folder)) {
            assert!(!text.contains(&printed), "{}: use headrace_recordings::skipped", path.display());
        }
    }
}

#[test]
fn every_crate_says_what_it_is() {
    for (name, package) in workspace() {
        for target in package.targets {
            let text = std::fs::read_to_string(&target).unwrap();
            assert!(
                text.starts_with("//! "),
                "{name}: the first line of {} says nothing of it",
                target.display()
            );
        }
    }
    for (name, package) in workspace().iter().filter(|(_, package)| package.place.starts_with("plugins")) {
        if package.place == Path::new(PAGE) {
            continue;
        }
        let readme = std::fs::read_to_string(package.folder().join("README.md"));
        let readme = readme.unwrap_or_else(|error| panic!("{name}: README.md: {error}"));
        assert!(readme.contains("[[sensors]]"), "{name}: its README shows no example of a sensor's table");
    }
}

#[test]
fn versions_and_lints_are_stated_in_the_root_alone() {
    for (name, package) in workspace() {
        let text = std::fs::read_to_string(package.folder().join("Cargo.toml")).unwrap();
        assert!(text.contains("[lints]\nworkspace = true"), "{name}: does not take the workspace's lints");
        if package.place != Path::new("") {
            let versions: Vec<_> = text.lines().filter(|line| line.contains("version =")).collect();
            assert!(versions.is_empty(), "{name}: {versions:?}; versions belong into the root's Cargo.toml");
        }
    }
}
