//! Output on stdout. A closed terminal ends neither a dive nor its recording.

use std::fmt::{self, Write as _};
use std::io::{BufWriter, Write};
use std::sync::atomic::{AtomicBool, Ordering};

use headrace_config::plain::{lines, one_line};
use headrace_monitor::report::Report;

use crate::failure::Failure;
use crate::terminal;
use crate::transient;

/// Whether the terminal has been given up: nothing is written to it any more.
static GIVEN_UP: AtomicBool = AtomicBool::new(false);

/// From now on stdout is left alone: a terminal that doesn't read must not keep a program from its end.
pub(crate) fn give_up() {
    GIVEN_UP.store(true, Ordering::Relaxed);
}

/// Writes `text` as it is: lines made fit already, and codes for the terminal. Errors are only logged: a closed pipe or a lost
/// session doesn't end a dive. Nothing is written once the terminal has been given up.
pub(crate) fn put(text: &str) {
    if GIVEN_UP.load(Ordering::Relaxed) {
        return;
    }
    let mut stdout = std::io::stdout().lock();
    if let Err(error) = stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        tracing::debug!(%error, "stdout is closed");
    }
}

/// The same with a line end.
pub(crate) fn put_line(text: &str) {
    put(&format!("{text}\n"));
}

/// Writes lines that may hold text from outside.
pub(crate) fn show(text: &str) {
    put(&lines(text));
}

/// Writes a line that may hold text from outside.
pub(crate) fn say(text: &str) {
    put(&format!("{}\n", one_line(text)));
}

/// Writes a line in place of a transient one, from any thread.
pub(crate) fn aside(text: &str) {
    let clear = if transient::take() { terminal::CLEAR } else { "" };
    put(&format!("{clear}{}\n", one_line(text)));
}

/// Writes output for another program, and a line end.
///
/// Errors: stdout is closed or the write is short.
pub(crate) fn deliver(text: &str) -> Result<(), Failure> {
    let mut stdout = std::io::stdout().lock();
    stdout
        .write_all(lines(text).as_bytes())
        .and_then(|()| stdout.write_all(b"\n"))
        .and_then(|()| stdout.flush())
        .map_err(|source| Failure::Write { path: "standard output".into(), source })
}

/// Writes output for another program as it is.
///
/// Errors: stdout is closed or the write is short.
pub(crate) fn deliver_bytes(bytes: &[u8]) -> Result<(), Failure> {
    let mut stdout = std::io::stdout().lock();
    stdout
        .write_all(bytes)
        .and_then(|()| stdout.flush())
        .map_err(|source| Failure::Write { path: "standard output".into(), source })
}

/// Writes a report as JSON, without holding all of it in memory.
///
/// Errors: stdout is closed or the write is short.
pub(crate) fn deliver_json(report: &Report) -> Result<(), Failure> {
    let failed = |source| Failure::Write { path: "standard output".into(), source };
    let mut stdout = BufWriter::new(Plain(std::io::stdout().lock()));
    serde_json::to_writer_pretty(&mut stdout, report).map_err(|error| failed(error.into()))?;
    stdout.write_all(b"\n").and_then(|()| stdout.flush()).map_err(failed)
}

/// Writes text made fit, whatever pieces it comes in.
struct Plain<W>(W);

impl<W: Write> Write for Plain<W> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        // A character that isn't whole yet comes again with the next bytes.
        let whole = match str::from_utf8(bytes) {
            Ok(text) => text,
            Err(error) if error.valid_up_to() > 0 => bytes
                .get(..error.valid_up_to())
                .and_then(|text| str::from_utf8(text).ok())
                .unwrap_or_default(),
            Err(error) => return Err(std::io::Error::new(std::io::ErrorKind::InvalidData, error)),
        };
        self.0.write_all(lines(whole).as_bytes())?;
        Ok(whole.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.0.flush()
    }
}

/// Appends formatted text.
pub(crate) fn append(text: &mut String, arguments: fmt::Arguments<'_>) {
    // Writing to a String can't fail.
    let _written = text.write_fmt(arguments);
}
