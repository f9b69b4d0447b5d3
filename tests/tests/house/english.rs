//! Checks the language of the project: links between documents, lengths of documents, and patterns that slow readers
//! down.

use std::collections::BTreeSet;
use std::path::{Component, Path, PathBuf};

use crate::workspace::root;

/// Largest number of words in all documents together.
const ALL_WORDS: usize = 50_000;
/// Largest number of words in README, about one and a half screens.
const README_WORDS: usize = 900;
/// Largest number of lines in CHANGELOG.
const CHANGELOG_LINES: usize = 60;

/// Folders with built or fetched content.
const NOT_OURS: [&str; 4] = ["target", "node_modules", ".git", "dist"];

/// All files below the root with one of these extensions, sorted, as paths relative to the root.
fn files(extensions: &[&str]) -> BTreeSet<PathBuf> {
    fn walk(folder: &Path, extensions: &[&str], found: &mut BTreeSet<PathBuf>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if path.is_dir() && !NOT_OURS.contains(&name.as_str()) {
                walk(&path, extensions, found);
            } else if path.extension().is_some_and(|of| extensions.iter().any(|extension| of == *extension)) {
                found.insert(path.strip_prefix(root()).unwrap().to_owned());
            }
        }
    }
    let mut found = BTreeSet::new();
    walk(root(), extensions, &mut found);
    found
}

fn read(file: &Path) -> String {
    std::fs::read_to_string(root().join(file)).unwrap_or_else(|why| panic!("{}: {why}", file.display()))
}

/// Targets of the Markdown links in a text. A link has the form `[text](target)`.
fn links(text: &str) -> impl Iterator<Item = &str> {
    text.split("](").skip(1).filter_map(|rest| rest.split(')').next())
}

/// The anchor of a heading, as GitHub makes it.
fn anchor(heading: &str) -> String {
    let kept = heading.trim().chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
    kept.flat_map(char::to_lowercase).map(|c| if c == ' ' { '-' } else { c }).collect()
}

/// A path in which `.` and `..` are resolved.
fn normal(path: &Path) -> PathBuf {
    let mut normal = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir => {
                normal.pop();
            }
            Component::CurDir => {}
            other => normal.push(other),
        }
    }
    normal
}

/// Describes the fault of a link in a document; `None` if the link's target exists.
fn fault(from: &Path, link: &str) -> Option<String> {
    if link.contains("://") || link.starts_with("mailto:") {
        return None;
    }
    let (path, wanted) = link.split_once('#').map_or((link, None), |(path, wanted)| (path, Some(wanted)));
    let to = if path.is_empty() { from.to_owned() } else { normal(&from.parent().unwrap().join(path)) };
    if !root().join(&to).exists() {
        return Some(format!("{}: {link}: no such file", from.display()));
    }
    let has = |wanted: &str| {
        read(&to)
            .lines()
            .filter(|line| line.starts_with('#'))
            .any(|line| anchor(line.trim_start_matches('#')) == wanted)
    };
    wanted
        .filter(|wanted| to.extension().is_some_and(|of| of == "md") && !has(wanted))
        .map(|_| format!("{}: {link}: no such heading", from.display()))
}

#[test]
fn links_between_documents_lead_to_files_and_headings() {
    let mut faults = Vec::new();
    let mut seen = 0;
    for file in files(&["md"]) {
        let text = read(&file);
        seen += links(&text).count();
        faults.extend(links(&text).filter_map(|link| fault(&file, link)));
    }
    assert!(seen > 100, "{seen}");
    assert!(faults.is_empty(), "{faults:#?}");
}

#[test]
fn broken_links_are_found() {
    let readme = Path::new("README.md");
    assert_eq!(links("[a](b.x) and [c](d.x#e)").collect::<Vec<_>>(), ["b.x", "d.x#e"]);
    assert_eq!(anchor(" What it's for: 2 heads"), "what-its-for-2-heads");
    assert!(fault(readme, "docs/README.md").is_none());
    assert!(fault(readme, "docs/nowhere").is_some());
    assert!(fault(Path::new("docs/README.md"), "../README.md#no-such-heading").is_some());
}

#[test]
fn documents_stay_within_their_length_limits() {
    let words = |file: &Path| read(file).split_whitespace().count();
    let all: usize = files(&["md"]).iter().map(|file| words(file)).sum();
    assert!(all <= ALL_WORDS, "{all} words in all documents; at most {ALL_WORDS}");
    let readme = words(Path::new("README.md"));
    assert!(readme <= README_WORDS, "{readme} words in README; at most {README_WORDS}");
    let changelog = read(Path::new("CHANGELOG.md")).lines().count();
    assert!(changelog <= CHANGELOG_LINES, "{changelog} lines in CHANGELOG; at most {CHANGELOG_LINES}");
}

/// Words that aren't English, or that once had a meaning in this project only.
const PRIVATE: [&str; 4] = ["meaned", "surer", "give or take", "overmuch"];

/// Reason why a sentence of a comment or document needs a second reading; `None` if no rule finds one.
fn awkward(sentence: &str) -> Option<&'static str> {
    let first = sentence.split_whitespace().next().unwrap_or_default();
    if ["Who", "Whose", "Whom", "What"].contains(&first) && !sentence.trim_end().ends_with('?') {
        return Some("begins with a relative clause");
    }
    PRIVATE.into_iter().find(|word| sentence.contains(word))
}

/// Sentences of a text, roughly: the pieces between full stops. A question keeps its question mark.
fn sentences(text: &str) -> impl Iterator<Item = &str> {
    text.split(". ").flat_map(|part| part.split_inclusive('?')).map(str::trim)
}

/// Comments of a source file. Each block is joined into one line, with the number of the block's first line.
fn comments(text: &str) -> Vec<(usize, String)> {
    let mut blocks: Vec<(usize, String)> = Vec::new();
    let mut is_open = false;
    for (number, line) in text.lines().enumerate() {
        let comment =
            line.trim_start().strip_prefix("//").map(|rest| rest.trim_start_matches(['/', '!']).trim());
        match comment {
            Some("") | None => is_open = false,
            Some(words) if is_open => {
                if let Some((_, block)) = blocks.last_mut() {
                    block.push(' ');
                    block.push_str(words);
                }
            }
            Some(words) => {
                blocks.push((number + 1, words.to_owned()));
                is_open = true;
            }
        }
    }
    blocks
}

#[test]
fn comments_and_documents_have_no_awkward_sentence() {
    let mut faults = Vec::new();
    for file in files(&["rs", "ts", "tsx"]) {
        // This file is skipped because it contains the awkward words themselves.
        if file.ends_with("english.rs") {
            continue;
        }
        for (number, block) in comments(&read(&file)) {
            let found = sentences(&block).filter_map(|sentence| Some((awkward(sentence)?, sentence)));
            faults.extend(
                found.map(|(why, sentence)| format!("{}:{number}: {why}: {sentence}", file.display())),
            );
        }
    }
    for file in files(&["md"]) {
        for (number, line) in read(&file).lines().enumerate().filter(|(_, line)| !line.starts_with('#')) {
            let found = sentences(line).filter_map(|sentence| Some((awkward(sentence)?, sentence)));
            faults.extend(
                found.map(|(why, sentence)| format!("{}:{}: {why}: {sentence}", file.display(), number + 1)),
            );
        }
    }
    assert!(faults.is_empty(), "{}: {faults:#?}", faults.len());
}

/// Describes the fault of a test's name; `None` if the name has a subject, a condition and a result.
fn awkward_name(name: &str) -> Option<&'static str> {
    let parts: Vec<&str> = name.split('_').collect();
    if parts.iter().any(|part| ["what", "who", "whose", "whom"].contains(part)) {
        return Some("has a free relative");
    }
    if ["of", "where", "when", "while", "without", "with"].contains(&parts[0]) {
        return Some("begins with no subject");
    }
    // A single `s` after a number is no possessive but the unit seconds, as in 2_s.
    let possessive =
        parts.windows(2).any(|pair| pair[1] == "s" && pair[0].parse::<f64>().is_err() && pair[0] != "per");
    possessive.then_some("has a possessive")
}

#[test]
fn test_names_have_a_subject() {
    let mut faults = Vec::new();
    let mut seen = 0;
    for file in files(&["rs"]) {
        let text = read(&file);
        let lines: Vec<&str> = text.lines().map(str::trim).collect();
        for (number, line) in lines.iter().enumerate() {
            if !line.starts_with("#[test]") {
                continue;
            }
            let named =
                lines[number..].iter().take(6).find_map(|line| line.split_once("fn ")?.1.split_once('('));
            let Some((name, _)) = named else { continue };
            seen += 1;
            faults.extend(
                awkward_name(name).map(|why| format!("{}:{}: {name}: {why}", file.display(), number + 1)),
            );
        }
    }
    assert!(seen > 1_000, "{seen} tests");
    assert!(faults.is_empty(), "{}: {faults:#?}", faults.len());
}

#[test]
fn awkward_sentences_and_names_are_found() {
    assert!(awkward("Who hasn't heard a turn yet is no witness").is_some());
    assert!(awkward("What is the largest hole?").is_none());
    assert!(awkward("A window over which the rate is meaned").is_some());
    assert!(awkward_name("what_is_skipped_is_said").is_some());
    assert!(awkward_name("of_reports_the_first_63_are_kept").is_some());
    assert!(awkward_name("a_head_s_returns_are_rejected").is_some());
    assert!(awkward_name("stuck_cable_is_flagged_within_2_s").is_none());
    assert_eq!(
        comments("/// One\n/// two.\nfn a() {}\n// Three"),
        [(1, "One two.".to_owned()), (4, "Three".to_owned())]
    );
}
