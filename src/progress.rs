//! How far a command has come, on stderr, once it has taken over a second and where a person may be looking.

use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

const AFTER: Duration = Duration::from_secs(1);
const EVERY: Duration = Duration::from_millis(200);
/// Calls between two looks at the clock.
const CALLS: u32 = 1000;

/// Shows progress as a line that overwrites itself, and removes it at the end.
pub(crate) struct Progress {
    terminal: bool,
    started: Instant,
    shown: Option<Instant>,
    calls: u32,
}

impl Progress {
    #[expect(clippy::disallowed_methods, reason = "progress is for people; no result depends on it")]
    pub(crate) fn start() -> Self {
        Self { terminal: std::io::stderr().is_terminal(), started: Instant::now(), shown: None, calls: 0 }
    }

    /// `words` is called only when the line is due.
    pub(crate) fn at(&mut self, words: impl FnOnce() -> String) {
        self.calls += 1;
        if !self.terminal || !self.calls.is_multiple_of(CALLS) || self.started.elapsed() < AFTER {
            return;
        }
        if self.shown.is_some_and(|shown| shown.elapsed() < EVERY) {
            return;
        }
        self.show(&words());
    }

    /// Shows the next of a few long steps.
    pub(crate) fn step(&mut self, words: &str) {
        if self.terminal {
            self.show(words);
        }
    }

    fn show(&mut self, words: &str) {
        eprint!("\r\x1b[K{words}");
        if std::io::stderr().flush().is_err() {
            self.terminal = false;
        }
        self.shown = Some(self.started + self.started.elapsed());
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if self.shown.is_some() {
            eprint!("\r\x1b[K");
        }
    }
}
