//! Capabilities of the terminal behind an output. Only this module reads `NO_COLOR`, `TERM` and the locale.

use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, Ordering};

/// Capabilities of an output stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Terminal {
    /// Whether colours are shown: true on a terminal, unless `NO_COLOR` or `TERM=dumb` is set.
    pub(crate) colour: bool,
    /// Whether a printed line can be overwritten: true on a terminal, unless `TERM=dumb` is set.
    pub(crate) overwrites: bool,
}

/// Escape sequence that returns to the beginning of the line and clears the line.
pub(crate) const CLEAR: &str = "\r\x1b[K";

static QUIET: AtomicBool = AtomicBool::new(false);
static VERBOSE: AtomicBool = AtomicBool::new(false);

/// Detects the capabilities of a stream.
pub(crate) fn of(stream: &impl IsTerminal) -> Terminal {
    let variable = |name: &str| std::env::var(name).ok();
    able(stream.is_terminal(), variable("NO_COLOR").as_deref(), variable("TERM").as_deref())
}

/// Whether `NO_COLOR` and `TERM` allow colours. The function doesn't check whether there is a terminal.
pub(crate) fn allows_colour() -> bool {
    let variable = |name: &str| std::env::var(name).ok();
    able(true, variable("NO_COLOR").as_deref(), variable("TERM").as_deref()).colour
}

/// Whether the locale allows characters beyond ASCII.
///
/// Source: POSIX, the order of `LC_ALL`, `LC_CTYPE` and `LANG`.
pub(crate) fn has_unicode() -> bool {
    let set = |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty());
    let locale = ["LC_ALL", "LC_CTYPE", "LANG"].into_iter().find_map(set).unwrap_or_default().to_lowercase();
    locale.contains("utf-8") || locale.contains("utf8")
}

/// Capabilities of an output, from the values of `NO_COLOR` and `TERM`. An empty `NO_COLOR` doesn't count.
/// Source: no-color.org.
fn able(is_terminal: bool, no_color: Option<&str>, term: Option<&str>) -> Terminal {
    let overwrites = is_terminal && term != Some("dumb");
    Terminal { colour: overwrites && no_color.is_none_or(str::is_empty), overwrites }
}

/// Sets whether only results and errors are shown, as with `-q`.
pub(crate) fn be_quiet(quiet: bool) {
    QUIET.store(quiet, Ordering::Relaxed);
}

/// Whether only results and errors are shown, as with `-q`.
pub(crate) fn is_quiet() -> bool {
    QUIET.load(Ordering::Relaxed)
}

/// Whether stdout is a terminal on which more than results and errors are shown.
pub(crate) fn is_watched() -> bool {
    std::io::stdout().is_terminal() && !is_quiet()
}

/// Sets whether the summary has the figures for engineers, as with `-v`.
pub(crate) fn be_verbose(verbose: bool) {
    VERBOSE.store(verbose, Ordering::Relaxed);
}

/// Whether the summary has the figures for engineers, as with `-v`.
pub(crate) fn is_verbose() -> bool {
    VERBOSE.load(Ordering::Relaxed)
}

/// Whether the terminal's last line is transient, such as progress or the dive's state. A transient line has no line
/// end, and a log message of any thread first clears it.
static TRANSIENT: AtomicBool = AtomicBool::new(false);

/// Sets the flag that the last line is transient.
pub(crate) fn note_transient() {
    TRANSIENT.store(true, Ordering::Relaxed);
}

/// Returns whether a transient line is shown, and resets the flag.
pub(crate) fn take_transient() -> bool {
    TRANSIENT.swap(false, Ordering::Relaxed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_need_a_terminal_that_allows_them() {
        let shows = |is_terminal, no_color, term| {
            let Terminal { colour, overwrites } = able(is_terminal, no_color, term);
            (colour, overwrites)
        };
        assert_eq!(shows(true, None, Some("xterm")), (true, true));
        assert_eq!(shows(true, None, None), (true, true));
        assert_eq!(shows(true, Some(""), Some("xterm")), (true, true));
        assert_eq!(shows(true, Some("1"), Some("xterm")), (false, true));
        assert_eq!(shows(true, None, Some("dumb")), (false, false));
        assert_eq!(shows(false, None, Some("xterm")), (false, false));
    }
}
