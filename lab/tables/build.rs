//! Computes the program's version for caches. The version consists of the package's version and a digest of the sources
//! that decide a dive's results.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

/// Folders and files whose content affects results, relative to this package's folder.
const SOURCES: [&str; 6] =
    ["../../core", "../../replay/player", "../../plugins", "../../Cargo.toml", "src", "../Cargo.toml"];

fn main() -> std::io::Result<()> {
    let mut files = Vec::new();
    for source in SOURCES {
        println!("cargo:rerun-if-changed={source}");
        collect(Path::new(source), &mut files)?;
    }
    files.sort();
    let mut hasher = Sha256::new();
    for file in files {
        let content = std::fs::read(&file)?;
        hasher.update(file.to_string_lossy().replace('\\', "/").as_bytes());
        hasher.update((content.len() as u64).to_le_bytes());
        hasher.update(&content);
    }
    let mut digest = String::new();
    for byte in hasher.finalize().iter().take(6) {
        // Writing to a string can't fail.
        if write!(digest, "{byte:02x}").is_err() {
            break;
        }
    }
    println!("cargo:rustc-env=HEADRACE_SOURCES={digest}");
    Ok(())
}

/// Rust sources and manifests below a path.
fn collect(path: &Path, files: &mut Vec<PathBuf>) -> std::io::Result<()> {
    if path.is_dir() {
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        // Tests and the page don't change results.
        if matches!(name.as_str(), "tests" | "node_modules" | "page" | "target") {
            return Ok(());
        }
        for entry in std::fs::read_dir(path)? {
            collect(&entry?.path(), files)?;
        }
    } else if path.extension().is_some_and(|extension| extension == "rs" || extension == "toml") {
        files.push(path.to_owned());
    }
    Ok(())
}
