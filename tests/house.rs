//! The house's own rules: dependencies point one way, the core does no I/O and takes no lock, files stay short, every
//! crate says what it is.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "clippy.toml's leave for tests doesn't reach their helpers"
)]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

const CORE: &str = "headrace_core";
const PROGRAMS: [&str; 2] = ["headrace", "headrace_experiments"];
const LONGEST_FILE: usize = 600;

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

struct Crate {
    folder: PathBuf,
    /// Packages of this workspace that it needs to be built; what its tests need besides is left out.
    needs: Vec<String>,
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The workspace's packages by name.
fn crates() -> BTreeMap<String, Crate> {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--no-deps", "--offline"])
        .current_dir(root())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    let needs = |package: &Value| {
        let dependencies = package["dependencies"].as_array().unwrap().iter();
        let built = dependencies.filter(|d| d["kind"] != "dev" && !d["path"].is_null());
        built.map(|d| text(&d["name"])).collect()
    };
    let folder = |package: &Value| Path::new(&text(&package["manifest_path"])).parent().unwrap().to_owned();
    packages.iter().map(|p| (text(&p["name"]), Crate { folder: folder(p), needs: needs(p) })).collect()
}

/// All Rust sources below a folder, with their text.
fn sources(folder: &Path) -> Vec<(PathBuf, String)> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display())) {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let text = std::fs::read_to_string(&path).unwrap();
            found.push((path, text));
        }
    }
    found
}

#[test]
fn dependencies_point_one_way() {
    let crates = crates();
    assert!(crates.len() >= 8, "{} packages", crates.len());
    for (name, package) in &crates {
        let needs = |wanted: &[&str]| package.needs.iter().all(|need| wanted.contains(&need.as_str()));
        let good = match package.folder.strip_prefix(root()).unwrap() {
            // The two programs may use every library; neither uses the other.
            place if ["", "experiments"].map(Path::new).contains(&place) => {
                !package.needs.iter().any(|need| PROGRAMS.contains(&need.as_str()))
            }
            place if place == Path::new("core") => needs(&[]),
            place if ["replay", "pictures"].map(Path::new).contains(&place) => needs(&[CORE]),
            place if place.starts_with("plugins") => needs(&[CORE]),
            place => panic!("{name} is in {}, which has no rule", place.display()),
        };
        assert!(good, "{name}: {:?}", package.needs);
    }
}

#[test]
fn the_core_does_no_io_and_takes_no_lock() {
    let mut said = Vec::new();
    let sources = sources(&root().join("core/src"));
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
    for folder in ["src", "core", "plugins", "replay", "pictures", "experiments", "tests", "benches"] {
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
            assert!(!text.contains(&printed), "{}: use tests/common/skipped.rs", path.display());
        }
    }
}

#[test]
fn every_crate_says_what_it_is() {
    for (name, package) in crates() {
        let main = ["src/lib.rs", "src/main.rs"].map(|file| package.folder.join(file));
        let text = main.iter().find_map(|file| std::fs::read_to_string(file).ok()).unwrap();
        assert!(text.starts_with("//! "), "{name}: its first line says nothing of it");
    }
    for (name, package) in
        crates().iter().filter(|(_, package)| package.folder.parent().unwrap().ends_with("plugins"))
    {
        let readme = std::fs::read_to_string(package.folder.join("README.md"));
        let readme = readme.unwrap_or_else(|error| panic!("{name}: README.md: {error}"));
        assert!(readme.contains("[[sensors]]"), "{name}: its README shows no example of a sensor's table");
    }
}

#[test]
fn versions_and_lints_are_stated_in_the_root_alone() {
    for (name, package) in crates() {
        let text = std::fs::read_to_string(package.folder.join("Cargo.toml")).unwrap();
        assert!(text.contains("[lints]\nworkspace = true"), "{name}: does not take the workspace's lints");
        if package.folder != root() {
            let versions: Vec<_> = text.lines().filter(|line| line.contains("version =")).collect();
            assert!(versions.is_empty(), "{name}: {versions:?}; versions belong into the root's Cargo.toml");
        }
    }
}
