//! Log messages: events of the crate tracing on stderr, filtered by `-v`, `-q` and `RUST_LOG`.

use std::io::{self, IsTerminal as _, Write};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread;
use std::time::Duration;

use crossbeam::channel::{Sender, bounded};
use crossbeam::queue::ArrayQueue;
use headrace_config::plain::one_line;
use tracing::level_filters::LevelFilter;
use tracing::{Level, Metadata};
use tracing_subscriber::filter::Targets;
use tracing_subscriber::fmt::{self, MakeWriter};
use tracing_subscriber::prelude::*;

use crate::cli::Verbosity;
use crate::terminal;

/// Environment variable that filters by crate or module.
const VARIABLE: &str = "RUST_LOG";
/// Prefix of the tracing targets of this program's crates.
const OURS: &str = "headrace";

/// Starts to write log messages to stderr.
///
/// If a caller of this library has installed its own subscriber, that subscriber stays.
pub(crate) fn start(verbosity: &Verbosity) {
    let (filter, error) = filter(verbosity.level(), std::env::var(VARIABLE).ok().as_deref());
    let layer = fmt::layer().with_ansi(terminal::of(&io::stderr()).colour).with_writer(Stderr);
    if tracing_subscriber::registry().with(layer.with_filter(filter)).try_init().is_err() {
        return;
    }
    if let Some(error) = error {
        tracing::warn!("{error}");
    }
}

/// Filter for log messages. Also returns an error text if `RUST_LOG` is invalid and therefore ignored.
///
/// The filter passes warnings of all crates, `level` for this program's crates, and the levels of the targets
/// named in `RUST_LOG`.
fn filter(level: Option<LevelFilter>, variable: Option<&str>) -> (Targets, Option<String>) {
    let parsed = match variable.filter(|text| !text.trim().is_empty()) {
        Some(text) => text.parse::<Targets>().map_err(|error| {
            format!(
                "{VARIABLE} = {text:?}: {error}; expected LEVEL or CRATE=LEVEL, separated by commas; ignored"
            )
        }),
        None => Ok(Targets::new()),
    };
    let (mut filter, error) = match parsed {
        Ok(filter) => (filter, None),
        Err(error) => (Targets::new(), Some(error)),
    };
    if filter.default_level().is_none() {
        filter = filter.with_default(LevelFilter::WARN);
    }
    if let Some(level) = level {
        filter = filter.with_target(OURS, level);
    }
    (filter, error)
}

/// Maximum number of log lines that wait to be written to stderr.
const WAITING: usize = 1 << 10;
/// Longest wait at the end of a dive until the queued lines are written to stderr.
const ENDS_WITHIN: Duration = Duration::from_secs(2);

/// Writer of stderr on a separate thread.
struct Background {
    lines: Sender<Line>,
    /// Number of log lines dropped because the queue was full.
    dropped: AtomicU64,
}

enum Line {
    Text(Vec<u8>),
    /// Marks a place in the queue. When all earlier lines have been written, the writing thread drops the mark. The
    /// mark's channel is then disconnected.
    Mark(Sender<()>),
}

static BACKGROUND: OnceLock<Background> = OnceLock::new();

/// From now on no thread waits for stderr, so a dive and its recorder continue if nobody reads stderr.
///
/// Lines that find no room in the queue are dropped and counted.
pub(crate) fn never_wait() {
    let (lines, queue) = bounded(WAITING);
    // If the thread can't be started, all lines are dropped as soon as the queue is full.
    let thread = thread::Builder::new().name("stderr".to_owned()).spawn(move || {
        for line in queue {
            match line {
                Line::Text(text) => write_now(&text),
                Line::Mark(mark) => drop(mark),
            }
        }
    });
    if thread.is_ok() {
        BACKGROUND.get_or_init(|| Background { lines, dropped: AtomicU64::new(0) });
    }
}

/// Log lines kept while `--tui` uses the terminal. The oldest lines are dropped and counted.
struct Held {
    is_on: AtomicBool,
    /// Lines to be written to stderr when the terminal is released.
    kept: ArrayQueue<Vec<u8>>,
    dropped: AtomicU64,
    /// Log lines that the screen of `--tui` is to show.
    shown: ArrayQueue<String>,
}

const MOST_HELD: usize = 1 << 8;
const MOST_SHOWN: usize = 16;

static HELD: OnceLock<Held> = OnceLock::new();

fn held() -> &'static Held {
    HELD.get_or_init(|| Held {
        is_on: AtomicBool::new(false),
        kept: ArrayQueue::new(MOST_HELD),
        dropped: AtomicU64::new(0),
        shown: ArrayQueue::new(MOST_SHOWN),
    })
}

/// Keeps log lines from now on, because the screen of `--tui` uses the terminal.
///
/// The screen shows the lines. They aren't written to stderr if stderr is a terminal.
pub(crate) fn hold() {
    held().is_on.store(true, Ordering::Relaxed);
}

/// Next log line that the screen of `--tui` is to show.
pub(crate) fn next_held() -> Option<String> {
    HELD.get().and_then(|held| held.shown.pop())
}

/// Writes the kept log lines to stderr, since the terminal has been released.
pub(crate) fn release() {
    let Some(held) = HELD.get().filter(|held| held.is_on.swap(false, Ordering::Relaxed)) else { return };
    let dropped = held.dropped.swap(0, Ordering::Relaxed);
    if dropped > 0 {
        complain(&format!("headrace: {dropped} earlier lines dropped"));
    }
    while let Some(bytes) = held.kept.pop() {
        pass(&bytes);
    }
}

/// Writes a line to stderr after the lines that are queued. The line may contain text from outside the
/// program.
pub(crate) fn complain(text: &str) {
    pass(format!("{}{}\n", prefix(Level::ERROR), one_line(text)).as_bytes());
}

/// Prefix by which systemd's journal recognises a line's priority; empty if stderr isn't the journal.
///
/// Source: `sd-daemon(3)`.
fn prefix(level: Level) -> &'static str {
    static IS_JOURNAL: OnceLock<bool> = OnceLock::new();
    let is_journal = || {
        let stream = std::env::var("JOURNAL_STREAM").ok();
        rustix::fs::fstat(io::stderr())
            .is_ok_and(|stderr| is_stream(stream.as_deref(), stderr.st_dev, stderr.st_ino))
    };
    match level {
        _ if !*IS_JOURNAL.get_or_init(is_journal) => "",
        Level::ERROR => "<3>",
        Level::WARN => "<4>",
        Level::INFO => "<6>",
        _ => "<7>",
    }
}

/// Whether `JOURNAL_STREAM` names the file with this device and inode. Source: `systemd.exec(5)`.
fn is_stream(variable: Option<&str>, device: u64, inode: u64) -> bool {
    variable == Some(format!("{device}:{inode}").as_str())
}

/// Waits until all lines for stderr are written. In a dive the wait is at most 2 s.
pub(crate) fn end() {
    let Some(background) = BACKGROUND.get() else { return };
    let dropped = background.dropped.swap(0, Ordering::Relaxed);
    if dropped > 0 {
        complain(&format!("headrace: {dropped} lines dropped because stderr was not read"));
    }
    let (mark, written) = bounded::<()>(0);
    if background.lines.send_timeout(Line::Mark(mark), ENDS_WITHIN).is_ok() {
        written.recv_timeout(ENDS_WITHIN).ok();
    }
}

fn pass(bytes: &[u8]) {
    let Some(background) = BACKGROUND.get() else { return write_now(bytes) };
    if background.lines.try_send(Line::Text(bytes.to_vec())).is_err() {
        background.dropped.fetch_add(1, Ordering::Relaxed);
    }
}

/// Writes bytes to stderr at once, unless the screen of `--tui` uses the terminal.
///
/// Other output on stderr may be a line that overwrites itself, such as progress. Failed writes are ignored: a closed
/// stderr must not end a dive.
fn write_now(bytes: &[u8]) {
    if let Some(held) = HELD.get().filter(|held| held.is_on.load(Ordering::Relaxed)) {
        held.shown.force_push(plain(bytes));
        if io::stderr().is_terminal() {
            held.dropped
                .fetch_add(u64::from(held.kept.force_push(bytes.to_vec()).is_some()), Ordering::Relaxed);
            return;
        }
    }
    let mut stderr = io::stderr().lock();
    let cleared = if terminal::of(&stderr).overwrites && terminal::take_transient() {
        stderr.write_all(terminal::CLEAR.as_bytes())
    } else {
        Ok(())
    };
    cleared.and_then(|()| stderr.write_all(bytes)).ok();
}

/// A log line without colours and without its line end.
fn plain(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    let mut parts = text.trim_end().split("\x1b[");
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |line, part| line + part.split_once('m').map_or(part, |(_, rest)| rest))
}

/// A log event as one line. External text is escaped; the formatter's colours are kept.
fn event(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    let (line, end) = text.strip_suffix('\n').map_or((&*text, ""), |line| (line, "\n"));
    let mut fit = String::new();
    let mut parts = line.split('\x1b');
    fit.push_str(&one_line(parts.next().unwrap_or_default()));
    for part in parts {
        let codes = part.trim_start_matches(|c: char| c == '[' || c == ';' || c.is_ascii_digit());
        fit.push_str(if part.starts_with('[') && codes.starts_with('m') { "\x1b" } else { "\\u001b" });
        fit.push_str(&one_line(part));
    }
    fit + end
}

/// Writer of log messages to stderr.
struct Stderr;

impl MakeWriter<'_> for Stderr {
    type Writer = LevelWriter;

    fn make_writer(&self) -> LevelWriter {
        LevelWriter(Level::INFO)
    }

    fn make_writer_for(&self, event: &Metadata<'_>) -> LevelWriter {
        LevelWriter(*event.level())
    }
}

/// Writer of one log message to stderr; the field is the message's level.
struct LevelWriter(Level);

impl Write for LevelWriter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        pass((prefix(self.0).to_owned() + &event(bytes)).as_bytes());
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn enabled(level: Option<LevelFilter>, variable: Option<&str>) -> impl Fn(&str, Level) -> bool {
        let (filter, error) = filter(level, variable);
        assert_eq!(error, None);
        move |target, level| filter.would_enable(target, &level)
    }

    #[test]
    fn log_event_is_one_line_without_control_codes_except_colours() {
        let text = "\x1b[33mWARN\x1b[0m opened a\nb\x1b[2J\x1b]0;t\x07\u{202e}\n";
        let line = "\x1b[33mWARN\x1b[0m opened a\\nb\\u001b[2J\\u001b]0;t\\u0007\\u202e\n";
        assert_eq!(event(text.as_bytes()), line);
    }

    #[test]
    fn stderr_is_the_journal_only_if_both_numbers_agree() {
        assert!(is_stream(Some("9:4711"), 9, 4711));
        assert!(!is_stream(Some("9:4711"), 9, 4712) && !is_stream(Some("8:4711"), 9, 4711));
        assert!(!is_stream(None, 9, 4711) && !is_stream(Some("9"), 9, 4711));
    }

    #[test]
    fn only_warnings_are_shown_by_default() {
        let shows = enabled(None, None);
        assert!(shows("headrace_replay::log", Level::WARN) && shows("other", Level::WARN));
        assert!(!shows("headrace", Level::INFO) && !shows("other", Level::INFO));
        assert!(!enabled(None, Some(""))("headrace", Level::INFO));
    }

    #[test]
    fn verbosity_flags_apply_to_all_crates_of_this_program() {
        let shows = enabled(Some(LevelFilter::DEBUG), None);
        assert!(shows("headrace_ports::service", Level::DEBUG) && shows("headrace", Level::DEBUG));
        assert!(!shows("headrace", Level::TRACE) && !shows("other", Level::INFO));
        assert!(!enabled(Some(LevelFilter::ERROR), None)("headrace_replay", Level::WARN));
    }

    #[test]
    fn rust_log_sets_the_levels_of_named_crates() {
        let shows = enabled(None, Some("headrace_ports=debug"));
        assert!(shows("headrace_ports::service", Level::DEBUG) && shows("headrace_replay", Level::WARN));
        assert!(!shows("headrace_replay", Level::INFO));
        let shows = enabled(Some(LevelFilter::ERROR), Some("debug,headrace_ports=trace"));
        assert!(shows("headrace_ports", Level::TRACE) && shows("other", Level::DEBUG));
        assert!(!shows("headrace_replay", Level::WARN), "-q outweighs the bare level");
    }

    #[test]
    fn invalid_rust_log_is_named_and_ignored() {
        let (filter, error) = filter(None, Some("headrace=loud"));
        assert!(error.unwrap().starts_with("RUST_LOG = \"headrace=loud\": "));
        assert!(
            filter.would_enable("headrace", &Level::WARN) && !filter.would_enable("headrace", &Level::INFO)
        );
    }
}
