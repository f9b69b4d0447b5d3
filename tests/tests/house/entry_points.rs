//! Checks that `tests/tests/fuzz/entry_points` lists every file that interprets external bytes, and how the file is
//! tested.

use std::collections::{BTreeMap, BTreeSet};

use crate::workspace::{root, sources};

const LIST: &str = "tests/tests/fuzz/entry_points";
/// Texts that show that a file interprets external bytes: traits of decoders and file formats, and parsers of text and
/// JSON.
const SIGNS: [&str; 9] = [
    " Decoder for ",
    " Driver for ",
    " Format for ",
    " Framing for ",
    " Source for ",
    "Document::new(",
    "serde_json::from_s",
    "postcard::take_from",
    "from_utf8(",
];
/// Files that needn't be listed, because they interpret only text that this program wrote or that a listed file has
/// read.
const OWN_TEXT: [&str; 14] = [
    "core/sampling/src/advice/answer.rs",
    "plugins/dashboard/src/assets.rs",
    "replay/simulator/src/effects/mod.rs",
    "replay/simulator/src/position_error_model.rs",
    "replay/simulator/src/testing.rs",
    "replay/simulator/src/testing_motion.rs",
    "src/check/cable.rs",
    "src/commands.rs",
    "src/emulate.rs",
    "src/files.rs",
    "src/output.rs",
    "src/simulate.rs",
    "src/trim/anonymous.rs",
    "core/monitor/src/fixtures.rs",
];

/// Whether a file has one of the [`SIGNS`] outside its comments and unit tests.
fn interprets_bytes(text: &str) -> bool {
    let code = text.split("#[cfg(test)]").next().unwrap_or_default();
    let mut lines = code.lines().filter(|line| !line.trim_start().starts_with("//"));
    lines.any(|line| SIGNS.iter().any(|sign| line.contains(sign)))
}

#[test]
fn every_reader_of_external_bytes_is_tested_with_broken_bytes() {
    let mut found = BTreeSet::new();
    for folder in ["core", "plugins", "replay", "src"] {
        for (path, text) in sources(&root().join(folder)) {
            let name = path.strip_prefix(root()).unwrap().to_string_lossy().into_owned();
            let is_test = name.contains("/tests/") || name.ends_with("/tests.rs");
            if !is_test && !OWN_TEXT.contains(&name.as_str()) && interprets_bytes(&text) {
                found.insert(name);
            }
        }
    }
    let list = std::fs::read_to_string(root().join(LIST)).unwrap();
    let rows = list.lines().filter(|line| !line.starts_with('#'));
    let listed: BTreeMap<&str, &str> = rows.map(|row| row.split_once('|').unwrap()).collect();
    let names: BTreeSet<String> = listed.keys().map(|name| (*name).to_owned()).collect();
    assert_eq!(found, names, "files that interpret external bytes, and {LIST}");
    let kinds = std::fs::read_to_string(root().join("tests/tests/fuzz/corpus.rs")).unwrap();
    for (file, how) in listed {
        let is_kind = kinds.contains(&format!(", \"{how}\"),"));
        assert!(is_kind || root().join(how).is_file(), "{file}: {how} is no fuzz kind and no file");
    }
    for file in OWN_TEXT {
        assert!(root().join(file).is_file(), "{file}");
    }
}
