//! Checks that every test named in `docs/why/promises.md` or `docs/reference/recorder.md` exists.

use crate::workspace::root;

/// Checks that each test exists that a row of the page names. Returns the number of rows that name tests.
fn count_named_tests(page: &str) -> usize {
    let page = std::fs::read_to_string(root().join(page)).unwrap();
    assert!(page.lines().count() < 150);
    let mut named = 0;
    for row in page.lines().filter(|line| line.starts_with("| ") && line.contains('`')) {
        let quoted: Vec<&str> = row.split('`').skip(1).step_by(2).collect();
        let place = quoted.iter().position(|word| word.contains(".rs")).unwrap_or_else(|| panic!("{row}"));
        let text = std::fs::read_to_string(root().join(quoted[place])).unwrap();
        if let Some(name) = quoted.get(place + 1) {
            let lines: Vec<&str> = text.lines().map(str::trim).collect();
            let test = format!("fn {name}() {{");
            assert!(lines.windows(2).any(|pair| pair == ["#[test]", test.as_str()]), "{row}");
        }
        named += 1;
    }
    named
}

#[test]
fn every_promise_names_an_existing_test() {
    for page in ["docs/why/promises.md", "docs/reference/recorder.md"] {
        let named = count_named_tests(page);
        assert!(named > 20, "{page}: {named}");
    }
}

#[test]
fn every_listed_mutation_matches_exactly_one_line() {
    let list = std::fs::read_to_string(root().join("tests/mutants/listed")).unwrap();
    let mut found = 0;
    for line in list.lines().filter(|line| !line.starts_with('#')) {
        let line = line.replace("\\|", "\u{1}");
        let fields: Vec<String> = line.split('|').map(|field| field.replace('\u{1}', "|")).collect();
        let [name, file, from, to, _] = fields.as_slice() else { panic!("{line}") };
        let text = std::fs::read_to_string(root().join(file)).unwrap_or_else(|_| panic!("{name}: no {file}"));
        assert_eq!(text.lines().filter(|line| line.contains(from)).count(), 1, "{name}: {from:?} in {file}");
        assert_ne!(from, to, "{name}");
        found += 1;
    }
    assert!(found > 15, "{found}");
}
