//! The workspace's packages and sources.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

pub(crate) use headrace_tests::root;

pub(crate) struct Package {
    /// Folder of the package, relative to the root.
    pub(crate) place: PathBuf,
    /// Packages of this workspace on which the package depends, except packages that only its tests need.
    pub(crate) needs: Vec<String>,
    /// Root files of the package's libraries, programs, tests and benches.
    pub(crate) targets: Vec<PathBuf>,
}

impl Package {
    pub(crate) fn folder(&self) -> PathBuf {
        root().join(&self.place)
    }
}

/// The workspace's packages. The key is the package's name.
pub(crate) fn workspace() -> BTreeMap<String, Package> {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--no-deps", "--offline"])
        .current_dir(root())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    let package = |package: &Value| {
        let folder = PathBuf::from(text(&package["manifest_path"])).parent().unwrap().to_owned();
        let dependencies = package["dependencies"].as_array().unwrap().iter();
        let built = dependencies.filter(|d| d["kind"] != "dev" && !d["path"].is_null());
        let targets = package["targets"].as_array().unwrap().iter();
        Package {
            place: folder.strip_prefix(root()).unwrap().to_owned(),
            needs: built.map(|d| text(&d["name"])).collect(),
            targets: targets.map(|target| PathBuf::from(text(&target["src_path"]))).collect(),
        }
    };
    let packages = metadata["packages"].as_array().unwrap().iter();
    packages.map(|p| (text(&p["name"]), package(p))).collect()
}

/// All Rust sources below a folder, each with its text.
pub(crate) fn sources(folder: &Path) -> Vec<(PathBuf, String)> {
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
