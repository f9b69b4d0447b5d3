//! Checks that `docs/why/hard-cases.csv` has a row for each case in `tests/hard_cases/list`, and that the named tests
//! exist.

use headrace_support::hard_cases::cells;

use crate::workspace::root;

#[test]
fn every_hard_case_has_its_row_and_its_test() {
    let read =
        |name: &str| std::fs::read_to_string(root().join(name)).unwrap_or_else(|why| panic!("{name}: {why}"));
    let (list, table) = (read("tests/hard_cases/list"), read("docs/why/hard-cases.csv"));
    let rows: Vec<Vec<String>> = table.lines().skip(1).map(cells).collect();
    let cases: Vec<Vec<&str>> = list
        .lines()
        .filter(|line| line.contains('|') && !line.starts_with("#!"))
        .map(|line| line.split('|').map(str::trim).collect())
        .collect();
    assert_eq!(rows.len(), cases.len(), "renew docs/why/hard-cases.csv with tests/hard_cases/run");
    assert!(cases.len() > 80, "{}", cases.len());
    for (row, case) in rows.iter().zip(&cases) {
        let [name, what, oracle, bound, file, test] = case[..] else { panic!("{case:?}") };
        assert_eq!(
            [&row[1], &row[2], &row[6], &row[7]],
            [what, oracle, file, test],
            "renew docs/why/hard-cases.csv with tests/hard_cases/run"
        );
        let text = read(file);
        assert!(text.contains(&format!("fn {test}(")), "{what}: no {test} in {file}");
        if name.is_empty() {
            assert!(!bound.is_empty() && row[4] == bound, "{what}: a property without its words");
        } else {
            let error: f64 = row[3].parse().unwrap_or_else(|_| panic!("{what}: {}", row[3]));
            let bound: f64 = row[4].parse().unwrap();
            assert!(error <= bound * 1.5, "{what}: {error:e} of {bound:e}");
        }
    }
}
