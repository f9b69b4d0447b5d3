//! An open line, and read helpers shared by sockets and serial ports.

use std::io;
use std::time::Duration;

use std::net::SocketAddr;

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::driver::Strangers;

/// Maximum bytes of one read.
pub const READ_BYTES: usize = 2048;

/// Senders on a line that accepts any sender. The value survives a reopening of the line.
#[derive(Default)]
pub struct Senders {
    /// Accepted sender, which is the device.
    pub believed: Option<SocketAddr>,
    /// Rejected senders.
    pub strangers: Strangers,
}

/// Returns whether bytes hold a message of a device on the line.
pub type IsValid<'a> = &'a dyn Fn(&[u8]) -> bool;

/// An open line.
pub trait Line: Send {
    /// Waits up to `wait` for bytes; returns the first one's receive time and the count. `None` on timeout.
    ///
    /// Errors: the connection is lost.
    fn read(&mut self, wait: Duration, into: &mut [u8; READ_BYTES]) -> io::Result<Option<(MonoNs, usize)>>;

    /// As [`Line::read`] on a line that accepts any sender: returns only bytes of one sender, the first valid one.
    ///
    /// Errors: the connection is lost.
    fn read_device(
        &mut self,
        wait: Duration,
        into: &mut [u8; READ_BYTES],
        _: &mut Senders,
        _: IsValid<'_>,
    ) -> io::Result<Option<(MonoNs, usize)>> {
        self.read(wait, into)
    }

    /// Sends bytes; on a message carrier they form one message.
    ///
    /// Errors: the connection is lost.
    fn write(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Exchanges a transaction on a bus: writes, waits `settle`, and reads.
    ///
    /// Returns the bytes written and then the bytes read, with the time at which the read began. `None` if the answer
    /// comes as a message. Errors: the connection is lost; the line is no bus.
    fn exchange(
        &mut self,
        write: &[u8],
        settle: DurNs,
        read_bytes: usize,
    ) -> io::Result<Option<(MonoNs, Vec<u8>)>> {
        let _ = (write, settle, read_bytes);
        Err(io::Error::new(io::ErrorKind::Unsupported, "only an I2C bus, or UDP in its place, exchanges"))
    }

    /// Reason why no data can come at present, with its fix, if the line can detect one.
    fn complaint(&self) -> Option<String> {
        None
    }

    /// Number of messages dropped unread since the last call, as far as the carrier reports them.
    fn dropped(&mut self) -> u64 {
        0
    }

    /// Keep-alive, called about once a second on an idle line, for carriers that forget silent clients.
    ///
    /// Errors: the connection is lost.
    fn knock(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Performs [`Line::exchange`] on an emulated bus.
///
/// It sends a datagram of the bytes to write and the read length; the answer, which arrives as a message, is the
/// transaction.
pub(super) fn exchange_by_datagram(
    line: &mut impl Line,
    write: &[u8],
    read_bytes: usize,
) -> io::Result<Option<(MonoNs, Vec<u8>)>> {
    let count = u8::try_from(read_bytes).unwrap_or(u8::MAX);
    line.write(&[write, &[count]].concat())?;
    Ok(None)
}

/// A socket's read timeout, which is set only when it changes: most waits are as long as the last.
#[derive(Default)]
pub(super) struct ReadTimeout(Duration);

impl ReadTimeout {
    /// Sets the timeout of the next read.
    pub(super) fn set(
        &mut self,
        wait: Duration,
        tell: impl FnOnce(Duration) -> io::Result<()>,
    ) -> io::Result<()> {
        // A timeout of zero would mean none.
        let wait = wait.max(Duration::from_micros(1));
        if self.0 != wait {
            tell(wait)?;
            self.0 = wait;
        }
        Ok(())
    }
}

/// Result of a read with a timeout; a timeout gives `None`, not an error.
pub(super) fn waited(read: io::Result<usize>) -> io::Result<Option<usize>> {
    match read {
        Ok(count) => Ok(Some(count)),
        Err(error) => match error.kind() {
            io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted => Ok(None),
            _ => Err(error),
        },
    }
}
