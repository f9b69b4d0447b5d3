//! Checks that crates use only crates of allowed layers, that the core has no I/O and no locks, and the metadata of
//! each crate.

use std::path::{Path, PathBuf};

use crate::workspace::{Package, root, sources, workspace};

/// Crates of the core, from bottom to top. Each crate may use only the crates listed before it.
const CORE: [&str; 8] =
    ["config", "geometry", "sampling", "sensor", "fusion", "coverage", "vehicle", "monitor"];

/// Crates of the core that the crate of a device may use.
const FOR_DEVICES: [&str; 1] = ["sensor"];

/// Crates of the core that the ports crate may use. The ports crate connects devices with the loop.
const FOR_PORTS: [&str; 3] = ["sensor", "geometry", "monitor"];

/// Each crate in `replay/`, with the crates of `replay/` and the plugins that it may use in addition to the core.
const FOR_REPLAY: [(&str, &[&str]); 4] = [
    ("replay/deliver", &[]),
    ("replay/simulator", &[]),
    ("replay/player", &["replay/simulator"]),
    (
        "replay/import",
        &[
            "replay/player",
            "plugins/a50",
            "plugins/imagenex881",
            "plugins/imu_can",
            "plugins/mavlink",
            "plugins/ping1d",
        ],
    ),
];

/// Rust paths and names that the core may not use: time, randomness, files, ports, threads, environment, locks and
/// unbounded queues.
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

/// The crate that lists all device kinds. It may use the crates of all devices, and the crates of the core that device
/// crates may use.
const DEVICES: &str = "plugins/devices";

/// Rust packages in the workspace `lab`.
const LAB: [&str; 4] = ["lab/cost", "lab/engine", "lab/experiments", "lab/tables"];

/// The operator's page, a plugin that isn't a device.
const PAGE: &str = "plugins/dashboard";

/// Whether the package in the folder `place` may depend on the package in the folder `needed`.
fn may_need(place: &Path, needed: &Path) -> bool {
    let core = |needed: &Path| CORE.iter().position(|name| needed == Path::new("core").join(name));
    let one_of = |names: &[&str]| names.iter().any(|name| needed == Path::new("core").join(name));
    let kind = place.iter().next().and_then(|name| name.to_str()).unwrap_or_default();
    match kind {
        "core" => core(needed).zip(core(place)).is_some_and(|(needed, place)| needed < place),
        "plugins" if place == Path::new("plugins/ports") => one_of(&FOR_PORTS),
        // The page shows the loop's results, so it may use every crate of the core.
        "plugins" if place == Path::new(PAGE) => core(needed).is_some(),
        "plugins" if place == Path::new(DEVICES) => {
            let aside = ["plugins/ports", PAGE, DEVICES].map(Path::new);
            one_of(&FOR_DEVICES) || needed.starts_with("plugins") && !aside.contains(&needed)
        }
        "plugins" => one_of(&FOR_DEVICES),
        "replay" => {
            let others =
                FOR_REPLAY.iter().find(|(name, _)| place == Path::new(name)).map(|(_, others)| *others);
            let others = others.unwrap_or_else(|| panic!("{} has no layer", place.display()));
            core(needed).is_some() || others.iter().any(|other| needed == Path::new(other))
        }
        // The headrace program may use every library, but no package for tests.
        "" => !needed.starts_with("tests"),
        "tests" => true,
        _ => panic!("{} has no layer", place.display()),
    }
}

#[test]
fn crates_depend_only_on_allowed_crates() {
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
fn layer_rule_rejects_forbidden_dependencies() {
    let pairs = [
        ("core/sampling", "core/geometry", true),
        ("core/geometry", "core/sampling", false),
        ("core/monitor", "replay/player", false),
        ("plugins/bar100", "core/sensor", true),
        ("plugins/bar100", "core/geometry", false),
        ("plugins/bar100", "plugins/ping1d", false),
        ("plugins/bar100", "plugins/devices", false),
        ("plugins/devices", "plugins/bar100", true),
        ("plugins/devices", "plugins/ports", false),
        ("plugins/devices", "core/monitor", false),
        ("plugins/ports", "core/monitor", true),
        ("plugins/ports", "core/coverage", false),
        ("replay/simulator", "core/monitor", true),
        ("replay/simulator", "replay/player", false),
        ("replay/player", "replay/simulator", true),
        ("replay/import", "replay/simulator", false),
        ("replay/import", "plugins/mavlink", true),
        ("replay/import", "plugins/ports", false),
        ("replay/import", "plugins/devices", false),
        ("replay/deliver", "replay/player", false),
        ("", "plugins/mavlink", true),
        ("", "tests/oracle", false),
        ("tests", "", true),
    ];
    for (place, needed, may) in pairs {
        assert_eq!(may_need(Path::new(place), Path::new(needed)), may, "{place} on {needed}");
    }
}

#[test]
fn core_has_no_io_and_no_locks() {
    let mut said = Vec::new();
    let sources: Vec<_> =
        CORE.iter().flat_map(|name| sources(&root().join("core").join(name).join("src"))).collect();
    assert!(sources.len() > 20, "{} files", sources.len());
    for (path, text) in sources {
        for (number, line) in text.lines().enumerate() {
            // Comments in the core may mention the forbidden names.
            let code = line.split("//").next().unwrap_or_default();
            for barred in BARRED_FROM_CORE.iter().filter(|barred| code.contains(**barred)) {
                said.push(format!("{}:{}: {barred}", path.display(), number + 1));
            }
        }
    }
    assert!(said.is_empty(), "{said:#?}");
}

/// A test must not report with `println!` that it was skipped. Cargo hides the output of passing tests, so
/// `.ci/count-skipped` misses such a report.
#[test]
fn skipped_tests_are_reported_only_by_the_helper() {
    // The searched text is split here, so that the search doesn't find this file itself.
    let printed = ["println!(\"", "skipped: "].concat();
    for folder in ["src", "core", "plugins", "replay", "tests"].into_iter().chain(LAB) {
        for (path, text) in sources(&root().join(folder)) {
            assert!(!text.contains(&printed), "{}: use headrace_support::skipped", path.display());
        }
    }
}

#[test]
fn every_crate_has_a_description() {
    for (name, package) in workspace() {
        for target in package.targets {
            let text = std::fs::read_to_string(&target).unwrap();
            assert!(
                text.starts_with("//! "),
                "{name}: the first line of {} doesn't describe the crate",
                target.display()
            );
        }
    }
    for (name, package) in workspace().iter().filter(|(_, package)| package.place.starts_with("plugins")) {
        if [PAGE, DEVICES].map(Path::new).contains(&package.place.as_path()) {
            continue;
        }
        let readme = std::fs::read_to_string(package.folder().join("README.md"));
        let readme = readme.unwrap_or_else(|error| panic!("{name}: README.md: {error}"));
        assert!(readme.contains("[[sensors]]"), "{name}: README.md has no example of a sensor's table");
    }
}

#[test]
fn versions_and_lints_are_only_in_the_root_manifest() {
    for (name, package) in workspace() {
        let text = std::fs::read_to_string(package.folder().join("Cargo.toml")).unwrap();
        assert!(text.contains("[lints]\nworkspace = true"), "{name}: doesn't use the workspace's lints");
        if package.place != Path::new("") {
            let versions: Vec<_> = text.lines().filter(|line| line.contains("version =")).collect();
            assert!(versions.is_empty(), "{name}: {versions:?}; versions belong in the root's Cargo.toml");
        }
    }
}

/// Names of documents in a text: words with a document's file extension.
fn documents_in(text: &str) -> impl Iterator<Item = &str> {
    let is_part = |c: char| c.is_ascii_alphanumeric() || "_-./".contains(c);
    text.split(move |c: char| !is_part(c)).map(|word| word.trim_end_matches('.')).filter(|word| {
        // The extension is split here, so that the text of this file doesn't seem to name a document.
        word.strip_suffix(["m", "d"].concat().as_str())
            .and_then(|stem| stem.strip_suffix('.'))
            .is_some_and(|stem| !stem.is_empty())
    })
}

/// Adds all files below a folder that people read or edit. Build output doesn't belong to them.
fn readable(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display())) {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_dir() {
            if !["target", "node_modules", ".git"].contains(&name.as_str()) {
                readable(&path, found);
            }
        } else if ["rs", "md", "toml", "ts", "py"]
            .iter()
            .any(|end| path.extension().is_some_and(|e| e == *end))
        {
            found.push(path);
        }
    }
}

/// Every document that a file mentions must exist.
#[test]
fn named_documents_exist() {
    let mut files = Vec::new();
    readable(root(), &mut files);
    let names: Vec<String> =
        files.iter().map(|file| file.strip_prefix(root()).unwrap().to_string_lossy().into_owned()).collect();
    let exists = |named: &str| {
        let named = named.trim_start_matches("../").trim_start_matches("./").trim_start_matches('/');
        names.iter().any(|name| name == named || name.ends_with(&format!("/{named}")))
    };
    let (mut said, mut seen) = (Vec::new(), 0);
    for (file, name) in files.iter().zip(&names) {
        // The change log may name files that no longer exist.
        if name == "CHANGELOG.md" {
            continue;
        }
        let text = std::fs::read_to_string(file).unwrap();
        for (number, line) in text.lines().enumerate() {
            seen += documents_in(line).count();
            let missing = documents_in(line).filter(|named| !exists(named));
            said.extend(missing.map(|named| format!("{name}:{}: {named}", number + 1)));
        }
    }
    assert!(seen > 100, "{seen}");
    assert!(said.is_empty(), "documents that don't exist: {said:#?}");
}

#[test]
fn document_names_are_found_in_text() {
    let name = |stem: &str| [stem, ".m", "d"].concat();
    let text = format!(
        "/// see `{}`, ({}#ways), and {}. No md, no .mdx.",
        name("docs/a-b"),
        name("../c"),
        name("d_1")
    );
    assert_eq!(documents_in(&text).collect::<Vec<_>>(), [name("docs/a-b"), name("../c"), name("d_1")]);
}
