//! Checks the archive that `deploy/blueos-image` makes for BlueOS, and the wheel that `deploy/wheel` makes for pip.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use headrace_replay::log::files_digest;
use headrace_tests::Folder;
use serde_json::Value;

use super::workspace::root;

/// Header of an ELF program for 64-bit Arm that needs no dynamic linker.
fn program() -> Vec<u8> {
    let mut bytes = vec![0; 64];
    bytes[..6].copy_from_slice(b"\x7fELF\x02\x01");
    bytes[18..20].copy_from_slice(&183_u16.to_le_bytes());
    bytes
}

/// Runs the script `deploy/blueos-image`; `None` if Python is missing.
fn made(program: &Path, folder: &Path) -> Option<Output> {
    let script = root().join("deploy/blueos-image");
    Command::new("python3").arg(script).args([program, folder]).current_dir(root()).output().ok()
}

fn digest(path: PathBuf) -> String {
    files_digest(&[path]).unwrap()
}

fn json(path: PathBuf) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// Every file in the image is named by the digest of its content. The image states its processor, and has the labels
/// that BlueOS reads.
#[test]
fn blueos_image_contains_the_program() {
    let folder = Folder::new();
    let at = |name: &str| folder.path(name);
    std::fs::write(at("program"), program()).unwrap();
    let Some(output) = made(&at("program"), &folder.path("")) else {
        return headrace_tests::skipped("python3 is not there");
    };
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let name = format!("headrace-{}-arm64.tar", env!("CARGO_PKG_VERSION"));
    assert_eq!(String::from_utf8(output.stdout).unwrap().trim_end(), at(&name).display().to_string());
    let first = digest(at(&name));
    made(&at("program"), &folder.path(""));
    assert_eq!(digest(at(&name)), first, "the same bytes");

    let unpacked = |archive: &Path| {
        let done = Command::new("tar").arg("-xf").arg(archive).current_dir(folder.path("")).status().unwrap();
        assert!(done.success());
    };
    unpacked(&at(&name));
    let manifest = json(at("manifest.json"));
    let config_name = manifest[0]["Config"].as_str().unwrap();
    assert_eq!(config_name, format!("{}.json", digest(at(config_name))));
    let config = json(at(config_name));
    assert_eq!(config["architecture"], "arm64");
    let layer = manifest[0]["Layers"][0].as_str().unwrap();
    assert_eq!(config["rootfs"]["diff_ids"], serde_json::json!([format!("sha256:{}", digest(at(layer)))]));
    unpacked(&at(layer));
    assert_eq!(std::fs::read(at("headrace")).unwrap(), program());

    let labels = &config["config"]["Labels"];
    for label in ["version", "type", "readme", "requirements"] {
        assert!(labels[label].is_string(), "{label}");
    }
    let read = |label: &str| serde_json::from_str::<Value>(labels[label].as_str().unwrap()).unwrap();
    assert!(read("authors")[0]["name"].is_string() && read("company")["name"].is_string());
    assert_eq!(read("permissions")["HostConfig"]["NetworkMode"], "host");
}

/// The wheel's list of files states the digest of each file.
#[test]
fn wheel_contains_the_program() {
    let folder = Folder::new();
    let at = |name: &str| folder.path(name);
    std::fs::write(at("program"), program()).unwrap();
    let make = || {
        let mut command = Command::new("python3");
        command.arg(root().join("deploy/wheel")).arg(at("program")).args(["1.2.3", "aarch64"]);
        command.arg(at("")).env("SOURCE_DATE_EPOCH", "1800000000").output().ok()
    };
    let Some(output) = make() else { return headrace_tests::skipped("python3 is not there") };
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let name = "headrace_program-1.2.3-py3-none-manylinux2014_aarch64.musllinux_1_1_aarch64.whl";
    let first = digest(at(name));
    make();
    assert_eq!(digest(at(name)), first, "the same bytes");
    let read = "import csv, sys, zipfile, hashlib, base64
wheel = zipfile.ZipFile(sys.argv[1])
for name, digest, size in csv.reader(wheel.read('headrace_program-1.2.3.dist-info/RECORD').decode().splitlines()):
    content = wheel.read(name)
    found = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).decode().rstrip('=')
    assert name.endswith('/RECORD') or (digest, size) == ('sha256=' + found, str(len(content))), name
assert wheel.read('headrace_program-1.2.3.data/scripts/headrace') == open(sys.argv[2], 'rb').read()";
    let read = Command::new("python3").args(["-c", read]).args([at(name), at("program")]).output().unwrap();
    assert!(read.status.success(), "{}", String::from_utf8_lossy(&read.stderr));
}

/// The image contains no libraries. The script therefore refuses programs that need a library. It also refuses files
/// that aren't programs.
#[test]
fn blueos_image_refuses_programs_that_cannot_start() {
    let folder = Folder::new();
    let text = folder.path("text");
    std::fs::write(&text, "no program").unwrap();
    let refused = |program: &Path, why: &str| {
        let Some(output) = made(program, &folder.path("")) else {
            return headrace_tests::skipped("python3 is not there");
        };
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && said.contains(why), "{said}");
    };
    refused(&std::env::current_exe().unwrap(), "needs shared libraries");
    refused(&text, "isn't a program");
}
