//! Shows the progress of a command on stderr, with the time left.
//!
//! Progress is shown if stderr is a terminal and the command takes over two seconds.

use std::io::{self, Write};
use std::time::{Duration, Instant};

use headrace_config::plain::one_line;

use crate::terminal;

const AFTER: Duration = Duration::from_secs(2);
const EVERY: Duration = Duration::from_millis(200);
/// Number of calls of [`Progress::at`] between two reads of the clock.
const CALLS: u32 = 1000;
/// Share of the work, 0 to 1, that must be done before the time left is shown.
const TELLING: f64 = 0.01;

/// Minimum interval between log messages on progress.
const LOG_EVERY: Duration = Duration::from_secs(5);

/// Shows progress as a line that overwrites itself and is removed at the end. Also logs the progress.
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
            terminal: terminal::of(&io::stderr()).overwrites && !terminal::is_quiet(),
            started: Instant::now(),
            shown: None,
            logged: Duration::ZERO,
            calls: 0,
        }
    }

    /// Shows progress if an update is due.
    ///
    /// `state` is called only if an update is due. It returns the finished work as text and as a share.
    pub(crate) fn at(&mut self, state: impl FnOnce() -> (String, Option<f64>)) {
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
        let (mut words, share) = state();
        if let Some(left_s) = share.and_then(|share| left_s(elapsed.as_secs_f64(), share)) {
            words = format!("{words}, {} left", duration_text(left_s));
        }
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
        let words = one_line(words);
        let mut stderr = io::stderr().lock();
        let written = write!(stderr, "{}{words}", terminal::CLEAR);
        if written.and_then(|()| stderr.flush()).is_err() {
            self.terminal = false;
        }
        terminal::note_transient();
        self.shown = Some(self.started + self.started.elapsed());
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if self.shown.is_some() && terminal::take_transient() {
            // A closed terminal needs no clearing.
            write!(io::stderr(), "{}", terminal::CLEAR).ok();
        }
    }
}

/// Writer that shows how many of a file's `of_bytes` have been written.
pub(crate) struct Writing<W> {
    to: W,
    progress: Progress,
    written: u64,
    of_bytes: u64,
}

impl<W: Write> Writing<W> {
    pub(crate) fn new(to: W, of_bytes: u64) -> Self {
        Self { to, progress: Progress::start(), written: 0, of_bytes }
    }
}

impl<W: Write> Write for Writing<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.to.write(bytes)?;
        self.written += count as u64;
        let (written, of_bytes) = (self.written, self.of_bytes);
        self.progress.at(|| {
            let mib = |bytes: u64| bytes >> 20;
            let share = written as f64 / of_bytes as f64;
            (format!("{} MiB of about {}", mib(written), mib(of_bytes)), Some(share))
        });
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.to.flush()
    }
}

/// Estimated seconds left if `share` of the work took `elapsed_s`; `None` if it is too early for an estimate, or if the
/// work is finished.
fn left_s(elapsed_s: f64, share: f64) -> Option<f64> {
    (TELLING..1.0).contains(&share).then(|| elapsed_s * (1.0 - share) / share)
}

/// A duration as text with about two digits.
fn duration_text(seconds: f64) -> String {
    let minutes = seconds / 60.0;
    match seconds {
        ..99.5 => format!("{} s", seconds.ceil()),
        ..5970.0 => format!("{minutes:.0} min"),
        _ => format!("{:.1} h", minutes / 60.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_left_is_extrapolated_from_the_work_done() {
        assert_eq!(left_s(3.0, 0.25), Some(9.0));
        assert_eq!((left_s(3.0, 0.0), left_s(3.0, 1.0), left_s(3.0, f64::NAN)), (None, None, None));
        let texts = [0.2, 59.0, 99.0, 100.0, 3600.0, 7200.0].map(duration_text);
        assert_eq!(texts, ["1 s", "59 s", "99 s", "2 min", "60 min", "2.0 h"]);
    }
}
