//! Checks that the README shows the current output of the program.

use headrace_tests::{Folder, root};

/// Text in the README directly before the demonstration's output. The output is indented by four spaces.
const BEGIN: &str = "leaves a report and a log in `headrace-demo/`:\n\n";
/// Line in the README that stands for omitted output lines.
const LEFT_OUT: &str = "    [...]";
/// Environment variable that makes this test rewrite the README.
const RENEW: &str = "HEADRACE_RENEW_README";

/// The part of the demonstration's piped output that the README shows.
///
/// It consists of four parts: the line about the missed section, the line with the state after that, the line that
/// clears the section, and the summary with the length of each verdict.
fn excerpt(stdout: &str) -> String {
    let lines: Vec<&str> = stdout.lines().collect();
    let missed = lines.iter().position(|line| line.contains("MISSED: ")).unwrap();
    let cleared = lines.iter().rposition(|line| line.contains("CLEARED until ")).unwrap();
    let summary = lines.iter().position(|line| line.contains(" samples, target ")).unwrap();
    assert!(missed + 1 < cleared && cleared < summary, "{stdout}");
    let parts = [[missed, missed + 1], [cleared, cleared], [summary, summary + 1]];
    let shown = parts.map(|[from, to]| format!("    {}\n", lines[from..=to].join("\n    ")));
    shown.join(&format!("{LEFT_OUT}\n"))
}

/// To rewrite the output, run `HEADRACE_RENEW_README=1 cargo test -p headrace_tests --test command_line readme`.
#[test]
fn readme_shows_the_current_demonstration_output() {
    let folder = Folder::new();
    let answer = folder.headrace(&["demo", "--speed", "max"]);
    assert_eq!(answer.code, Some(0), "{}", answer.stderr);
    let expected = excerpt(&answer.stdout);
    let path = root().join("README.md");
    let readme = std::fs::read_to_string(&path).unwrap();
    let (before, rest) = readme.split_once(BEGIN).unwrap();
    let shown: String = rest.split_inclusive('\n').take_while(|line| line.starts_with("    ")).collect();
    if std::env::var_os(RENEW).is_some() {
        std::fs::write(&path, format!("{before}{BEGIN}{expected}{}", &rest[shown.len()..])).unwrap();
    } else {
        assert_eq!(shown, expected, "renew it with {RENEW}=1");
    }
}
