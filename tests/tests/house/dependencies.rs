//! Limits on dependencies: licences, sources, and libraries in other languages.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use serde_json::Value;

use super::workspace::root;

/// Names (Cargo's key `links`) of the libraries in other languages that packages in the lock file link.
const FOREIGN_LIBRARIES: [&str; 4] = ["hidapi", "lz4", "ring_core_0_17_14_", "zstd"];
/// Crates in the lock file that are never built, because only programs in web pages need them.
const NEVER_BUILT: [&str; 1] = ["wasm_bindgen"];

/// All packages in the lock file that are needed if all features are enabled.
fn packages() -> Vec<Value> {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--locked", "--all-features"])
        .current_dir(root())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    metadata["packages"].as_array().unwrap().clone()
}

/// The packages in a lock file of this repository, each with the crates on which it depends according to that file.
fn locked_dependencies(lock_file: &str) -> BTreeMap<String, BTreeSet<String>> {
    let text = std::fs::read_to_string(root().join(lock_file)).unwrap();
    let lock: toml::Table = toml::from_str(&text).unwrap();
    let ours = lock["package"].as_array().unwrap().iter().filter(|package| package.get("source").is_none());
    // If the lock file has several versions of a dependency, an entry for the dependency is "name version".
    let name = |entry: &toml::Value| entry.as_str().unwrap().split(' ').next().unwrap().to_owned();
    let dependencies = |package: &toml::Value| {
        package.get("dependencies").map_or_else(Vec::new, |list| list.as_array().unwrap().clone())
    };
    ours.map(|package| (name(&package["name"]), dependencies(package).iter().map(name).collect())).collect()
}

/// For each package of the workspace, the crates that its build always needs.
fn built_dependencies() -> BTreeMap<String, BTreeSet<String>> {
    let needs = |package: &Value| {
        let all = package["dependencies"].as_array().unwrap().iter();
        let built = all.filter(|dependency| dependency["kind"] != "dev" && dependency["optional"] == false);
        built.map(|dependency| dependency["name"].as_str().unwrap().to_owned()).collect()
    };
    let ours = packages().into_iter().filter(|package| package["source"].is_null());
    ours.map(|package| (package["name"].as_str().unwrap().to_owned(), needs(&package))).collect()
}

/// Licences allowed by `deny.toml`.
fn allowed() -> BTreeSet<String> {
    let text = std::fs::read_to_string(root().join("deny.toml")).unwrap();
    let list = text.split_once("allow = [").unwrap().1.split_once(']').unwrap().0;
    list.split(',')
        .map(|name| name.trim().trim_matches('"').to_owned())
        .filter(|name| !name.is_empty())
        .collect()
}

/// Whether the allowed licences satisfy a licence expression (SPDX, or with a slash for "or").
fn is_met(expression: &str, allowed: &BTreeSet<String>) -> bool {
    let expression = expression.trim();
    let parts = |separator: &str| split_outside_parentheses(expression, separator);
    for (separator, all) in [(" OR ", false), ("/", false), (" AND ", true)] {
        let parts = parts(separator);
        if parts.len() > 1 {
            let met = |part: &&str| is_met(part, allowed);
            return if all { parts.iter().all(met) } else { parts.iter().any(met) };
        }
    }
    match expression.strip_prefix('(').and_then(|inner| inner.strip_suffix(')')) {
        Some(inner) => is_met(inner, allowed),
        None => allowed.contains(expression),
    }
}

fn split_outside_parentheses<'a>(text: &'a str, separator: &str) -> Vec<&'a str> {
    let (mut parts, mut from, mut depth) = (Vec::new(), 0, 0_usize);
    for (at, letter) in text.char_indices() {
        match letter {
            '(' => depth += 1,
            ')' => depth -= 1,
            _ if depth == 0 && at >= from && text[at..].starts_with(separator) => {
                parts.push(&text[from..at]);
                from = at + separator.len();
            }
            _ => {}
        }
    }
    parts.push(&text[from..]);
    parts
}

#[test]
fn licences_are_allowed() {
    let allowed = allowed();
    assert!(!is_met("GPL-3.0-only", &allowed) && !is_met("(MIT OR Apache-2.0) AND GPL-3.0-only", &allowed));
    assert!(
        is_met("MIT OR GPL-3.0-only", &allowed) && is_met("(MIT/GPL-3.0-only) AND Unicode-3.0", &allowed)
    );
    for package in packages() {
        let licence = package["license"].as_str().unwrap_or("none stated");
        assert!(is_met(licence, &allowed), "{}: {licence}; allowed: {allowed:?}", package["name"]);
    }
}

#[test]
fn crates_come_from_the_registry_or_this_tree() {
    for package in packages() {
        let source = package["source"].as_str();
        let of_the_registry =
            source.is_none_or(|source| source == "registry+https://github.com/rust-lang/crates.io-index");
        assert!(of_the_registry, "{}: {source:?}", package["name"]);
    }
}

/// If the lock file of `lab/` is out of date, builds with `--locked` fail, and builds without this option change the
/// file.
#[test]
fn lock_file_of_the_lab_lists_the_dependencies_of_the_product() {
    let lab = locked_dependencies("lab/Cargo.lock");
    let mut compared = 0;
    for (package, dependencies) in built_dependencies() {
        let Some(locked) = lab.get(&package) else { continue };
        let missing: Vec<&String> = dependencies.difference(locked).collect();
        assert!(
            missing.is_empty(),
            "lab/Cargo.lock: {missing:?} of {package} are missing; `cargo check` in lab/ adds them"
        );
        compared += 1;
    }
    assert!(compared > 10, "{compared} packages are in both lock files");
}

#[test]
fn foreign_libraries_are_listed() {
    let linked: BTreeSet<String> =
        packages().iter().filter_map(|package| package["links"].as_str().map(str::to_owned)).collect();
    let known = FOREIGN_LIBRARIES.iter().chain(&NEVER_BUILT).map(|name| (*name).to_owned());
    assert_eq!(linked, known.collect());
}

/// `deploy/sbom` must list exactly the parts that the program links, and each with its licence and checksum.
#[test]
fn bill_of_materials_lists_exactly_the_linked_crates() {
    let Ok(output) = Command::new("python3").arg(root().join("deploy/sbom")).current_dir(root()).output()
    else {
        return headrace_tests::skipped("python3 is not there");
    };
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let bill: Value = serde_json::from_slice(&output.stdout).unwrap();
    let components = bill["components"].as_array().unwrap();
    let lists = |name: &str| components.iter().any(|part| part["name"] == name);
    let is_linked = ["bevy_ecs", "headrace_coverage", "nalgebra", "serialport", "zstd-sys"];
    let is_not = ["headrace", "headrace_tests", "insta", "proptest", "kiddo"];
    assert_eq!(is_linked.map(lists), [true; 5], "{is_linked:?}");
    assert_eq!(is_not.map(lists), [false; 5], "{is_not:?}");
    for part in components {
        let ours = part["name"].as_str().unwrap().starts_with("headrace");
        let checksum = part["hashes"][0]["content"].as_str().map(str::len);
        assert!(ours || checksum == Some(64), "{part}");
        assert!(part["licenses"][0]["expression"].is_string(), "{part}");
    }
}
