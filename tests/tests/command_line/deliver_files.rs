//! Files for other programs that `headrace deliver` writes: identical bytes, and as many points as the report states.

use headrace_tests::{Folder, root};
use serde_json::Value;

/// A folder with the files of a golden log in `out`.
fn delivered(name: &str) -> Folder {
    let folder = Folder::new();
    folder.write("dive.mcap", std::fs::read(root().join(format!("tests/golden/{name}.mcap"))).unwrap());
    deliver(&folder);
    folder
}

fn deliver(folder: &Folder) {
    let answer =
        folder.headrace(&["deliver", "dive.mcap", "-o", "out", "--force", "--plant", "Žižka \"Süd\""]);
    assert_eq!(answer.code, Some(0), "{}", answer.stderr);
}

/// Names and contents of the delivered files.
fn contents(folder: &Folder) -> Vec<(String, Vec<u8>)> {
    let entries = std::fs::read_dir(folder.path("out")).unwrap();
    let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names.into_iter().map(|name| (name.clone(), folder.read(&format!("out/{name}")))).collect()
}

#[test]
fn two_deliveries_have_the_same_files_for_other_programs() {
    let folder = delivered("too-fast");
    let once = contents(&folder);
    assert!(once.len() > 18 && once.iter().all(|(_, bytes)| !bytes.is_empty()));
    deliver(&folder);
    for ((name, bytes), (_, again)) in once.iter().zip(contents(&folder)) {
        assert!(*bytes == again, "{name}");
    }
}

#[test]
fn points_are_the_samples_and_doubtful_returns_of_the_report() {
    for name in ["too-fast", "steel", "murk"] {
        let folder = delivered(name);
        let report: Value = serde_json::from_slice(&folder.read("out/report.json")).unwrap();
        let dive = &report["dive"];
        let stated = [&dive["samples_valid"], &dive["samples_rejected"]["doubtful_returns"]];
        let text = String::from_utf8(folder.read("out/points.xyz")).unwrap();
        let points: Vec<_> = text.lines().filter(|line| !line.starts_with('#')).collect();
        let count = |doubtful: &str| points.iter().filter(|line| line.ends_with(doubtful)).count() as u64;
        assert_eq!(stated.map(|value| value.as_u64().unwrap()), [count(" 0"), count(" 1")], "{name}");
        assert!(count(" 0") > 900, "{name}");
    }
}
