//! Checks that `docs/why/hard-cases.md` has every row of its list, and that the named tests exist.

use crate::workspace::root;

#[test]
fn every_hard_case_has_its_row_and_its_test() {
    let read =
        |name: &str| std::fs::read_to_string(root().join(name)).unwrap_or_else(|why| panic!("{name}: {why}"));
    let (list, page) = (read("tests/hard_cases/list"), read("docs/why/hard-cases.md"));
    let rows: Vec<Vec<&str>> = page
        .lines()
        .filter(|line| line.starts_with("| ") && line.contains('`'))
        .map(|line| line.trim_matches(['|', ' ']).split('|').map(str::trim).collect())
        .collect();
    let cases: Vec<Vec<&str>> = list
        .lines()
        .filter(|line| line.contains('|') && !line.starts_with("#!"))
        .map(|line| line.split('|').map(str::trim).collect())
        .collect();
    assert_eq!(rows.len(), cases.len(), "tests/hard_cases/run makes docs/why/hard-cases.md anew");
    assert!(cases.len() > 80, "{}", cases.len());
    for (row, case) in rows.iter().zip(&cases) {
        let [name, what, oracle, bound, file, test] = case[..] else { panic!("{case:?}") };
        let told = format!("`{file}` `{test}`");
        assert_eq!(
            [row[0], row[1], row[5]],
            [what, oracle, told.as_str()],
            "tests/hard_cases/run makes the page anew"
        );
        let text = read(file);
        assert!(text.contains(&format!("fn {test}(")), "{what}: no {test} in {file}");
        if name.is_empty() {
            assert!(!bound.is_empty() && row[3] == bound, "{what}: a property without its words");
        } else {
            let error: f64 = row[2].parse().unwrap_or_else(|_| panic!("{what}: {}", row[2]));
            let bound: f64 = row[3].parse().unwrap();
            assert!(error <= bound * 1.5, "{what}: {error:e} of {bound:e}");
        }
    }
}
