//! Progress of a command on stderr, if that is a terminal and the command takes over a second.

use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

use crate::transient;

const AFTER: Duration = Duration::from_secs(1);
const EVERY: Duration = Duration::from_millis(200);
/// Calls between two reads of the clock.
const CALLS: u32 = 1000;

/// Progress is logged at this interval at most.
const LOG_EVERY: Duration = Duration::from_secs(5);

/// Shows progress as a line that overwrites itself, and removes it at the end; and logs it.
pub(crate) struct Progress {
    terminal: bool,
    started: Instant,
    shown: Option<Instant>,
    logged: Duration,
    calls: u32,
}

impl Progress {
    #[expect(clippy::disallowed_methods, reason = "progress is for people; no result depends on it")]
    pub(crate) fn start() -> Self {
        Self {
            terminal: std::io::stderr().is_terminal(),
            started: Instant::now(),
            shown: None,
            logged: Duration::ZERO,
            calls: 0,
        }
    }

    /// Shows progress when an update is due; only then is `words` called.
    pub(crate) fn at(&mut self, words: impl FnOnce() -> String) {
        self.calls += 1;
        if !self.calls.is_multiple_of(CALLS) {
            return;
        }
        let elapsed = self.started.elapsed();
        let logs =
            elapsed.saturating_sub(self.logged) >= LOG_EVERY && tracing::enabled!(tracing::Level::DEBUG);
        let shows =
            self.terminal && elapsed >= AFTER && self.shown.is_none_or(|shown| shown.elapsed() >= EVERY);
        if !logs && !shows {
            return;
        }
        let words = words();
        if logs {
            self.logged = elapsed;
            tracing::debug!("{words}");
        }
        if shows {
            self.show(&words);
        }
    }

    /// Shows the start of a long step.
    pub(crate) fn step(&mut self, words: &str) {
        tracing::info!("{words}");
        if self.terminal {
            self.show(words);
        }
    }

    fn show(&mut self, words: &str) {
        let mut stderr = std::io::stderr().lock();
        let written = stderr.write_all(transient::CLEAR).and_then(|()| stderr.write_all(words.as_bytes()));
        if written.and_then(|()| stderr.flush()).is_err() {
            self.terminal = false;
        }
        transient::shown();
        self.shown = Some(self.started + self.started.elapsed());
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if self.shown.is_some() && transient::take() {
            // A closed terminal needs no clearing.
            std::io::stderr().write_all(transient::CLEAR).ok();
        }
    }
}
