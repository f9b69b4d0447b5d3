//! Output on stdout. If the terminal is closed, neither a dive nor its recording ends.

use std::fmt::{self, Write as _};
use std::io::{self, BufWriter, ErrorKind, StdoutLock, Write};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use crossbeam::channel::{Receiver, RecvTimeoutError, SendTimeoutError, Sender, bounded};
use headrace_config::plain::{lines, one_line};
use headrace_monitor::report::Report;
use rustix::event::{PollFd, PollFlags, poll};

use crate::failure::Failure;
use crate::terminal;

/// Longest time for which a live dive waits for a reader of stdout.
pub(crate) const UNREAD_FOR: Duration = Duration::from_secs(2);
/// Length of one write, bytes. Any active reader takes this many bytes within [`UNREAD_FOR`].
const PIECE: usize = 1 << 10;

/// Whether stdout has been given up. Nothing is written to stdout after that.
static GIVEN_UP: AtomicBool = AtomicBool::new(false);
/// Whether stdout is given up if nobody reads it.
static NEVER_WAITS: AtomicBool = AtomicBool::new(false);

/// The first error through which output was lost.
static LOST: OnceLock<io::Error> = OnceLock::new();

/// Stops writing to stdout. A terminal that nobody reads must not keep the program from ending.
pub(crate) fn give_up() {
    GIVEN_UP.store(true, Ordering::Relaxed);
}

/// From now on stdout is given up if nobody has read it for [`UNREAD_FOR`]. A live dive thus ends even
/// without a reader.
pub(crate) fn never_wait() {
    NEVER_WAITS.store(true, Ordering::Relaxed);
}

/// Opens stdout for one output, which is flushed once, at its end. After [`never_wait`], a caller waits for
/// at most [`UNREAD_FOR`].
///
/// Errors: stdout has been given up.
fn stdout() -> io::Result<Box<dyn Write>> {
    match (GIVEN_UP.load(Ordering::Relaxed), NEVER_WAITS.load(Ordering::Relaxed)) {
        (true, _) => Err(unread()),
        (false, true) => Ok(Box::new(Unheld::start()?)),
        (false, false) => Ok(Box::new(Waiting::start())),
    }
}

/// Writer to stdout that waits until stdout accepts more bytes.
///
/// The writer waits even if another process that shares the pipe has made the pipe non-blocking.
struct Waiting(StdoutLock<'static>);

impl Waiting {
    fn start() -> Self {
        Self(io::stdout().lock())
    }

    fn retry<T>(&mut self, write: impl Fn(&mut StdoutLock<'static>) -> io::Result<T>) -> io::Result<T> {
        loop {
            match write(&mut self.0) {
                Err(error) if error.kind() == ErrorKind::WouldBlock => self.wait()?,
                other => return other,
            }
        }
    }

    fn wait(&self) -> io::Result<()> {
        match poll(&mut [PollFd::new(&self.0, PollFlags::OUT)], None) {
            Ok(_) | Err(rustix::io::Errno::INTR) => Ok(()),
            Err(error) => Err(error.into()),
        }
    }
}

impl Write for Waiting {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.retry(|stdout| stdout.write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.retry(Write::flush)
    }
}

fn unread() -> io::Error {
    io::Error::new(io::ErrorKind::TimedOut, "it is not read")
}

/// Writer to stdout through a separate thread. The writer blocks no caller for longer than [`UNREAD_FOR`].
struct Unheld {
    pieces: Option<Sender<Vec<u8>>>,
    done: Receiver<io::Result<()>>,
}

impl Unheld {
    fn start() -> io::Result<Self> {
        // The channel has no buffer, so the thread takes a piece of output only when it has written the previous piece.
        let (pieces, queue) = bounded::<Vec<u8>>(0);
        let (ended, done) = bounded(1);
        let write = move || {
            let mut stdout = Waiting::start();
            let result = queue.iter().try_for_each(|piece| stdout.write_all(&piece));
            drop(queue);
            // The receiver may have stopped waiting for the result, so a failed send is ignored.
            ended.send(result.and_then(|()| stdout.flush())).ok();
        };
        thread::Builder::new().name("stdout".to_owned()).spawn(write)?;
        Ok(Self { pieces: Some(pieces), done })
    }

    /// Waits until the thread has written everything, and returns the result of writing.
    fn end(&mut self) -> io::Result<()> {
        self.pieces = None;
        match self.done.recv_timeout(UNREAD_FOR) {
            Ok(result) => result,
            Err(RecvTimeoutError::Timeout) => {
                give_up();
                Err(unread())
            }
            Err(RecvTimeoutError::Disconnected) => Err(io::Error::other("its thread has ended early")),
        }
    }
}

impl Write for Unheld {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let piece = bytes.get(..PIECE).unwrap_or(bytes);
        let Some(pieces) = &self.pieces else { return Err(unread()) };
        match pieces.send_timeout(piece.to_vec(), UNREAD_FOR) {
            Ok(()) => Ok(piece.len()),
            Err(SendTimeoutError::Timeout(_)) => {
                self.pieces = None;
                give_up();
                Err(unread())
            }
            Err(SendTimeoutError::Disconnected(_)) => self.end().and(Err(io::ErrorKind::BrokenPipe.into())),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.end()
    }
}

/// Writes `text` unchanged, as [`put`] does, but waits as long as the write takes.
///
/// Only for a thread for which no other thread waits.
pub(crate) fn put_waiting(text: &str) {
    if GIVEN_UP.load(Ordering::Relaxed) {
        return;
    }
    let mut stdout = Waiting::start();
    if let Err(error) = stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        note(error);
    }
}

/// Writes `text` unchanged. The text consists of lines that are already printable and of codes for the terminal.
///
/// Errors are only logged and remembered (see [`lost`]). A closed pipe or a lost session doesn't end a dive.
/// Nothing is written after stdout has been given up.
pub(crate) fn put(text: &str) {
    if GIVEN_UP.load(Ordering::Relaxed) {
        return;
    }
    let written = stdout().and_then(|mut stdout| {
        stdout.write_all(text.as_bytes())?;
        stdout.flush()
    });
    match written {
        Err(error) if error.kind() == io::ErrorKind::TimedOut => {
            tracing::warn!("the terminal doesn't read its input; some output is dropped");
        }
        Err(error) => note(error),
        Ok(()) => {}
    }
}

/// Remembers that output was lost. A closed pipe doesn't count, because its reader wants no more.
fn note(error: io::Error) {
    tracing::debug!(%error, "stdout accepts no data");
    if error.kind() != io::ErrorKind::BrokenPipe {
        LOST.get_or_init(|| error);
    }
}

/// First error through which output was lost; `None` if no output was lost.
pub(crate) fn lost() -> Option<String> {
    LOST.get().map(|error| format!("writing standard output: {error}"))
}

/// Writes `text` unchanged, with a line end.
pub(crate) fn put_line(text: &str) {
    put(&format!("{text}\n"));
}

/// Writes lines that may contain text from outside the program, and makes them printable.
pub(crate) fn show(text: &str) {
    put(&lines(text));
}

/// Writes a line that may contain text from outside the program, and makes it printable.
pub(crate) fn say(text: &str) {
    put(&format!("{}\n", one_line(text)));
}

/// Writes a line, and first removes a status line that would be overwritten anyway. May be called from any thread.
pub(crate) fn aside(text: &str) {
    let clear = if terminal::take_transient() { terminal::CLEAR } else { "" };
    put(&format!("{clear}{}\n", one_line(text)));
}

/// Writes output for another program, followed by a line end.
///
/// Errors: the output is incomplete, or in a live dive nobody reads it. A closed pipe is not an error.
pub(crate) fn deliver(text: &str) -> Result<(), Failure> {
    deliver_bytes(format!("{}\n", lines(text)).as_bytes())
}

/// Writes output for another program unchanged.
///
/// Errors: see [`deliver`].
pub(crate) fn deliver_bytes(bytes: &[u8]) -> Result<(), Failure> {
    let write = |mut stdout: Box<dyn Write>| {
        stdout.write_all(bytes)?;
        stdout.flush()
    };
    taken(stdout().and_then(write))
}

/// Writes clap's help text to a terminal or a file.
///
/// Errors: see [`deliver`].
pub(crate) fn deliver_help(help: &clap::Error) -> Result<(), Failure> {
    taken(help.print().and_then(|()| io::stdout().flush()))
}

/// Result of a write. A closed pipe counts as success, because its reader wants no more.
fn taken(written: io::Result<()>) -> Result<(), Failure> {
    match written {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => other.map_err(failed),
    }
}

/// Writes a report to stdout as JSON, without holding the whole text in memory.
///
/// Errors: see [`deliver`].
pub(crate) fn deliver_json(report: &Report) -> Result<(), Failure> {
    let mut stdout = BufWriter::new(Plain(stdout().map_err(failed)?));
    let written = serde_json::to_writer_pretty(&mut stdout, report).map_err(io::Error::from);
    taken(written.and_then(|()| stdout.write_all(b"\n")).and_then(|()| stdout.flush()))
}

fn failed(source: io::Error) -> Failure {
    Failure::Write { path: "standard output".into(), source }
}

/// Writer that replaces control codes in text. The text may come in pieces that are cut anywhere.
struct Plain<W>(W);

impl<W: Write> Write for Plain<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        // The bytes of an incomplete character are not taken, so the caller passes them again together with the next
        // bytes.
        let whole = match str::from_utf8(bytes) {
            Ok(text) => text,
            Err(error) if error.valid_up_to() > 0 => bytes
                .get(..error.valid_up_to())
                .and_then(|text| str::from_utf8(text).ok())
                .unwrap_or_default(),
            Err(error) => return Err(io::Error::new(io::ErrorKind::InvalidData, error)),
        };
        self.0.write_all(lines(whole).as_bytes())?;
        Ok(whole.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

/// Appends formatted text.
pub(crate) fn append(text: &mut String, arguments: fmt::Arguments<'_>) {
    // Writing to a String can't fail.
    let _written = text.write_fmt(arguments);
}
