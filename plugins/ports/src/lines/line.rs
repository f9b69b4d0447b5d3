//! An open line, and what sockets and serial ports share in reading.

use std::io;
use std::time::Duration;

use headrace_geometry::time::{DurNs, MonoNs};

/// The most bytes that one read gives.
pub(crate) const READ_BYTES: usize = 2048;

/// An open line.
pub(crate) trait Line {
    /// Waits up to `wait` for bytes; gives when the first of them came, and how many. `None` when none came.
    fn read(&mut self, wait: Duration, into: &mut [u8; READ_BYTES]) -> io::Result<Option<(MonoNs, usize)>>;

    /// Puts bytes on the line; on a carrier of messages they are one.
    fn write(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// On a bus: writes, waits `settle`, reads, and gives the transaction, the bytes written and then those read, with the
    /// moment at which the read began. `None` where the answer comes as a message.
    fn exchange(
        &mut self,
        write: &[u8],
        settle: DurNs,
        read_bytes: usize,
    ) -> io::Result<Option<(MonoNs, Vec<u8>)>> {
        let _ = (write, settle, read_bytes);
        Err(io::Error::new(io::ErrorKind::Unsupported, "only an I2C bus, or UDP in its place, exchanges"))
    }

    /// Why nothing can come for now, with what would mend it, where the line itself knows.
    fn complaint(&self) -> Option<String> {
        None
    }

    /// Called about once a second while nothing has come, for carriers on which those who are silent are forgotten.
    fn knock(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// A socket's read timeout, told to the system when it changes: most waits are as long as the last.
#[derive(Default)]
pub(super) struct ReadTimeout(Duration);

impl ReadTimeout {
    /// Has the next read wait so long.
    pub(super) fn set(
        &mut self,
        wait: Duration,
        tell: impl FnOnce(Duration) -> io::Result<()>,
    ) -> io::Result<()> {
        // One of zero would be none.
        let wait = wait.max(Duration::from_micros(1));
        if self.0 != wait {
            tell(wait)?;
            self.0 = wait;
        }
        Ok(())
    }
}

/// What a read with a timeout gave; a timeout is no error.
pub(super) fn waited(read: io::Result<usize>) -> io::Result<Option<usize>> {
    match read {
        Ok(count) => Ok(Some(count)),
        Err(error) => match error.kind() {
            io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted => Ok(None),
            _ => Err(error),
        },
    }
}
