//! Serial ports, opened by path or by the identity of their USB adapter.

use std::io::{self, Read as _, Write as _};
use std::time::Duration;

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::connect::{SerialPort, UsbIdentity};
use rustix::fs::{FlockOperation, Mode, OFlags, flock};
use rustix::io::Errno;
use serialport::{SerialPort as _, SerialPortType, TTYPort};

use super::line::{Line, READ_BYTES, waited};
use crate::clock;
use crate::diagnosis;
use crate::open_error::OpenError;

/// Bits per byte on the line: a start bit, eight data bits and a stop bit.
const BITS_A_BYTE: i64 = 10;
/// Timeout of a write to the port.
const WRITE_TIME: Duration = Duration::from_millis(500);

struct Serial {
    port: TTYPort,
    byte_time: DurNs,
    /// Time at which the port was most recently found empty.
    emptied: MonoNs,
}

pub(super) fn open(port: &SerialPort, baud: u32) -> Result<Box<dyn Line>, OpenError> {
    let path = match port {
        SerialPort::Path(path) => path.clone(),
        SerialPort::Usb(identity) => path_of(identity)?,
    };
    let builder = serialport::new(&path, baud).timeout(WRITE_TIME);
    let port = TTYPort::open(&builder).map_err(|error| diagnosis::opening(&path, &cause(&path, error)))?;
    port.clear(serialport::ClearBuffer::All).map_err(|error| diagnosis::opening(&path, &error.into()))?;
    let byte_time = DurNs(BITS_A_BYTE * 1_000_000_000 / i64::from(baud.max(1)));
    Ok(Box::new(Serial { port, byte_time, emptied: clock::now() }))
}

/// Corrects an error of the serial crate: the crate reports a port as absent if another program has locked it.
fn cause(path: &str, error: serialport::Error) -> io::Error {
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    let opened = rustix::fs::open(path, flags, Mode::empty());
    let locked = opened.and_then(|file| flock(file, FlockOperation::NonBlockingLockExclusive));
    match locked {
        Err(Errno::BUSY | Errno::AGAIN) => io::ErrorKind::ResourceBusy.into(),
        _ => error.into(),
    }
}

/// Returns the current path of a USB adapter's port.
pub(super) fn path_of(identity: &UsbIdentity) -> Result<String, OpenError> {
    let what = format!("serial:usb:{identity}");
    let ports = serialport::available_ports().map_err(|error| diagnosis::opening(&what, &error.into()))?;
    let is_it = |kind: &SerialPortType| match kind {
        SerialPortType::UsbPort(usb) => {
            (usb.vid, usb.pid) == (identity.vendor, identity.product)
                && identity.serial.as_ref().is_none_or(|serial| usb.serial_number.as_ref() == Some(serial))
        }
        _ => false,
    };
    let mut fitting = ports.into_iter().filter(|port| is_it(&port.port_type)).map(|port| port.port_name);
    let Some(path) = fitting.next() else { return Err(OpenError::not_plugged_in(&what)) };
    match fitting.next() {
        None => Ok(path),
        Some(other) => Err(OpenError::ambiguous(&what, &[path, other])),
    }
}

impl Line for Serial {
    fn read(&mut self, wait: Duration, into: &mut [u8; READ_BYTES]) -> io::Result<Option<(MonoNs, usize)>> {
        self.port.set_timeout(wait)?;
        let Some(count) = waited(self.port.read(into))? else { return Ok(None) };
        if count == 0 {
            return Err(io::Error::new(io::ErrorKind::BrokenPipe, "the port is gone"));
        }
        let now = clock::now();
        // The time of the first byte is `now` minus the transmission time of all bytes, but not before the port was
        // last found empty.
        let ago = DurNs(self.byte_time.0.saturating_mul(i64::try_from(count).unwrap_or(0)));
        let first = (now - ago).max(self.emptied).min(now);
        if count < into.len() {
            self.emptied = now;
        }
        Ok(Some((first, count)))
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.port.set_timeout(WRITE_TIME)?;
        self.port.write_all(bytes)
    }
}
