//! The README shows what the program shows.

use headrace_tests::{Folder, root};

/// Begins what the README shows of the demonstration; what follows is indented by four.
const BEGIN: &str = "leaves a report and a log in `headrace-demo/`:\n\n";
/// Stands for lines left out.
const LEFT_OUT: &str = "    [...]";
/// Tells this test to write the README anew.
const RENEW: &str = "HEADRACE_RENEW_README";

/// Of the demonstration's output in a pipe: from the state before the flag to the first that is good again, from the state before it
/// is cleared to that, and the summary of the way. Nothing within these is left out.
fn excerpt(stdout: &str) -> String {
    let lines: Vec<&str> = stdout.lines().collect();
    let first = lines.iter().position(|line| line.contains("MISSED: ")).unwrap() - 1;
    let last = first + 2 + lines[first + 2..].iter().position(|line| line.contains("  ok up to ")).unwrap();
    let cleared = lines.iter().rposition(|line| line.contains("CLEARED until ")).unwrap();
    let summary = lines.iter().position(|line| line.contains(" samples, target ")).unwrap();
    let end = lines.iter().position(|line| line.starts_with("  largest hole")).unwrap();
    assert!(first < last && last < cleared && cleared < summary && summary < end, "{stdout}");
    let shown = |lines: &[&str]| -> String { format!("    {}\n", lines.join("\n    ")) };
    let parts = [(first, last), (cleared - 1, cleared), (summary, end)];
    let parts = parts.map(|(from, to)| shown(&lines[from..=to]));
    parts.join(&format!("{LEFT_OUT}\n"))
}

/// `HEADRACE_RENEW_README=1 cargo test -p headrace_tests --test command_line readme` renews it.
#[test]
fn the_readme_shows_the_demonstration_as_it_is() {
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
