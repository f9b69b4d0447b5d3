//! Output on stdout. A closed terminal ends neither a dive nor its recording.

use std::fmt::{self, Write as _};
use std::io::{BufWriter, Write};

use headrace_monitor::report::Report;

use crate::failure::Failure;
use crate::terminal;
use crate::transient;

/// Writes `text`. Errors are only logged: a closed pipe or a lost session doesn't end a dive.
pub(crate) fn put(text: &str) {
    let mut stdout = std::io::stdout().lock();
    if let Err(error) = stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        tracing::debug!(%error, "stdout is closed");
    }
}

/// Writes a line.
pub(crate) fn say(text: &str) {
    put(&format!("{text}\n"));
}

/// Writes a line in place of a transient one, from any thread.
pub(crate) fn aside(text: &str) {
    let clear = if transient::take() { terminal::CLEAR } else { "" };
    put(&format!("{clear}{text}\n"));
}

/// Writes output for another program, and a line end.
///
/// Errors: stdout is closed or the write is short.
pub(crate) fn deliver(text: &str) -> Result<(), Failure> {
    let mut stdout = std::io::stdout().lock();
    stdout
        .write_all(text.as_bytes())
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
    let mut stdout = BufWriter::new(std::io::stdout().lock());
    serde_json::to_writer_pretty(&mut stdout, report).map_err(|error| failed(error.into()))?;
    stdout.write_all(b"\n").and_then(|()| stdout.flush()).map_err(failed)
}

/// Appends formatted text.
pub(crate) fn append(text: &mut String, arguments: fmt::Arguments<'_>) {
    // Writing to a String can't fail.
    let _written = text.write_fmt(arguments);
}
