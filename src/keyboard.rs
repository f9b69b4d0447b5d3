//! Single keys of the terminal on standard input, read on a separate thread.

use std::io::{self, IsTerminal as _};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::getpgrp;
use rustix::termios::{
    LocalModes, OptionalActions, SpecialCodeIndex, Termios, tcgetattr, tcgetpgrp, tcsetattr,
};

use crate::failure::Failure;
use crate::interrupt;

/// Byte of Ctrl-C. The reader of keys also gets this byte if standard input is closed, or if the program is to end.
pub(crate) const INTERRUPT: u8 = 0x03;
/// Longest wait for a key, so that the end of the program is noticed.
const WAIT: Timespec = Timespec { tv_sec: 0, tv_nsec: 200_000_000 };

/// Whether standard input is a terminal that this program may read.
///
/// The system stops a background job that reads its terminal or changes the terminal's settings.
pub(crate) fn is_ours() -> bool {
    let stdin = io::stdin();
    // A terminal that doesn't control this process has no foreground job, so reading it stops no process.
    stdin.is_terminal() && tcgetpgrp(&stdin).map_or(true, |group| group == getpgrp())
}

/// Standard input without line buffering and echo. The settings are restored when the value is dropped.
pub(crate) struct Keyboard {
    before: Termios,
    ended: Arc<AtomicBool>,
}

impl Keyboard {
    /// Passes typed bytes to `take`, until it returns false. A terminal sends all bytes of a key at once.
    ///
    /// Errors: the terminal's settings can't be read or changed, or signals can't be handled.
    pub(crate) fn listen(mut take: impl FnMut(&[u8]) -> bool + Send + 'static) -> Result<Self, Failure> {
        let failed = |source: rustix::io::Errno| Failure::System {
            what: "reading keys from the terminal",
            source: source.into(),
        };
        let terminated = interrupt::flag()?;
        let before = tcgetattr(io::stdin()).map_err(failed)?;
        let mut raw = before.clone();
        // Ctrl-C is read as a key, too, so that the terminal is restored before the program ends.
        raw.local_modes.remove(LocalModes::ICANON | LocalModes::ECHO | LocalModes::ISIG);
        raw.special_codes[SpecialCodeIndex::VMIN] = 1;
        raw.special_codes[SpecialCodeIndex::VTIME] = 0;
        tcsetattr(io::stdin(), OptionalActions::Now, &raw).map_err(failed)?;
        let ended = Arc::new(AtomicBool::new(false));
        let keyboard = Self { before, ended: Arc::clone(&ended) };
        std::thread::spawn(move || {
            let mut bytes = [0; 64];
            while !ended.load(Ordering::Relaxed) {
                let is_wanted = match read(&mut bytes) {
                    _ if terminated.load(Ordering::Relaxed) => take(&[INTERRUPT]),
                    Ok(count) => take(bytes.get(..count).unwrap_or_default()),
                    Err(_) => take(&[INTERRUPT]),
                };
                if !is_wanted {
                    return;
                }
            }
        });
        Ok(keyboard)
    }
}

impl Drop for Keyboard {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
        if let Err(error) = tcsetattr(io::stdin(), OptionalActions::Now, &self.before) {
            tracing::warn!(%error, "the terminal's settings could not be restored");
        }
    }
}

/// Reads typed bytes. Returns no bytes after a time without input.
///
/// Errors: standard input is closed.
fn read(bytes: &mut [u8]) -> io::Result<usize> {
    let stdin = io::stdin();
    let mut typed = [PollFd::new(&stdin, PollFlags::IN)];
    match poll(&mut typed, Some(&WAIT)) {
        Ok(0) | Err(rustix::io::Errno::INTR) => return Ok(0),
        other => other?,
    };
    match rustix::io::read(&stdin, bytes)? {
        0 => Err(io::ErrorKind::UnexpectedEof.into()),
        count => Ok(count),
    }
}
