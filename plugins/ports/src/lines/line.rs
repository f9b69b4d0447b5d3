//! The interface of an open line, and read helpers for sockets and serial ports.

use std::io;
use std::time::Duration;

use std::net::SocketAddr;

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::driver::IgnoredSenders;

/// Maximum number of bytes returned by one read.
pub const READ_BYTES: usize = 2048;

/// Accepted and rejected senders of a line to which any machine may send. The senders are kept when the line is
/// reopened.
#[derive(Default)]
pub struct Senders {
    /// The accepted sender, which is taken to be the device.
    pub believed: Option<SocketAddr>,
    /// Senders that were rejected.
    pub strangers: IgnoredSenders,
}

/// Function that checks whether bytes contain a message of a device on the line.
pub type IsValid<'a> = &'a dyn Fn(&[u8]) -> bool;

/// An open line, which is a connection to one or several devices.
pub trait Line: Send {
    /// Waits up to `wait` for bytes. Returns the receive time of the first byte, and the count; `None` on timeout.
    ///
    /// Errors: the connection is lost.
    fn read(&mut self, wait: Duration, into: &mut [u8; READ_BYTES]) -> io::Result<Option<(MonoNs, usize)>>;

    /// Reads as [`Line::read`] does. On a line to which any machine may send, returns only bytes of the accepted
    /// sender.
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

    /// Sends bytes. On a carrier that transfers messages, the bytes form one message.
    ///
    /// Errors: the connection is lost.
    fn write(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Performs a transaction on a bus: writes, waits `settle`, and reads.
    ///
    /// Returns the time at which the read began, and the bytes written followed by the bytes read. Returns `None` if
    /// the answer comes later as a message.
    ///
    /// Errors: the connection is lost; the line is no bus.
    fn exchange(
        &mut self,
        write: &[u8],
        settle: DurNs,
        read_bytes: usize,
    ) -> io::Result<Option<(MonoNs, Vec<u8>)>> {
        let _ = (write, settle, read_bytes);
        Err(io::Error::new(
            io::ErrorKind::Unsupported,
            "only an I2C bus, or UDP in place of a bus, supports transactions",
        ))
    }

    /// Returns the reason why no data can arrive at present, with its fix, if the line can detect one.
    fn complaint(&self) -> Option<String> {
        None
    }

    /// Returns the number of messages dropped unread since the previous call, as far as the carrier reports them.
    fn dropped(&mut self) -> u64 {
        0
    }

    /// Sends a keep-alive, for carriers that forget silent clients. Called about once a second on an idle line.
    ///
    /// Errors: the connection is lost.
    fn knock(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Performs [`Line::exchange`] on an emulated bus.
///
/// Sends a datagram with the bytes to write and the read length. The device answers with a message that contains the
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

/// Read timeout of a socket. The timeout is set only when it changes, because most waits are as long as the
/// previous one.
#[derive(Default)]
pub(super) struct ReadTimeout(Duration);

impl ReadTimeout {
    /// Sets the timeout of the socket's next read.
    pub(super) fn set(
        &mut self,
        wait: Duration,
        tell: impl FnOnce(Duration) -> io::Result<()>,
    ) -> io::Result<()> {
        // A timeout of zero would mean no timeout.
        let wait = wait.max(Duration::from_micros(1));
        if self.0 != wait {
            tell(wait)?;
            self.0 = wait;
        }
        Ok(())
    }
}

/// Converts the result of a read with a timeout. A timeout becomes `None` instead of an error.
pub(super) fn waited(read: io::Result<usize>) -> io::Result<Option<usize>> {
    match read {
        Ok(count) => Ok(Some(count)),
        Err(error) => match error.kind() {
            io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted => Ok(None),
            _ => Err(error),
        },
    }
}
