//! CAN interfaces, read with kernel timestamps.

use std::io;
use std::time::Duration;

use headrace_geometry::time::MonoNs;
use socketcan::{
    CanFrame, CanSocket, EmbeddedFrame as _, ExtendedId, Frame as _, Id, Socket as _, SocketOptions as _,
    StandardId,
};

use super::line::{Line, READ_BYTES, ReadTimeout, waited};
use crate::clock;
use crate::diagnosis;
use crate::discover::{self, Machine};
use crate::open_error::OpenError;

/// Length of a `can_frame`, and offset of its data, bytes.
const FRAME_BYTES: usize = 16;
const DATA_AT: usize = 8;
/// Flag that marks an identifier of 29 bits. Source: Linux, `CAN_EFF_FLAG`.
const EXTENDED: u32 = 0x8000_0000;

/// Errors that a CAN socket reports only once: interface down, and interface removed. Source: Linux, errno.
///
/// A socket receives again when its interface comes up. A socket never receives again after its interface was removed.
const ENETDOWN: i32 = 100;
const ENODEV: i32 = 19;

struct Can {
    socket: CanSocket,
    timeout: ReadTimeout,
    interface: String,
    /// Whether the interface was reported down, and no frame has arrived since.
    is_down: bool,
}

pub(super) fn open(interface: &str) -> Result<Box<dyn Line>, OpenError> {
    let opening = || {
        let socket = CanSocket::open(interface)?;
        socket.set_recv_timestamp(true)?;
        // The kernel reports bus-off and bus errors as error frames.
        socket.set_error_filter_accept_all()?;
        Ok(socket)
    };
    let socket = opening().map_err(|error| diagnosis::opening_can(interface, &error))?;
    Ok(Box::new(Can {
        socket,
        timeout: ReadTimeout::default(),
        interface: interface.to_owned(),
        is_down: false,
    }))
}

impl Line for Can {
    fn read(&mut self, wait: Duration, into: &mut [u8; READ_BYTES]) -> io::Result<Option<(MonoNs, usize)>> {
        let socket = &self.socket;
        self.timeout.set(wait, |wait| socket.set_read_timeout(wait))?;
        let mut stamped = None;
        let read = self.socket.read_frame_with_timestamp().map(|(frame, stamp)| {
            if let Some(to) = into.first_chunk_mut() {
                *to = bytes_of(&frame);
            }
            stamped = Some(clock::of_wall(stamp));
            FRAME_BYTES
        });
        // The socket stays open, so that no frame is missed when the interface comes up.
        match read.as_ref().err().and_then(io::Error::raw_os_error) {
            Some(ENETDOWN) => {
                self.is_down = true;
                return Ok(None);
            }
            Some(ENODEV) => return Err(io::Error::new(io::ErrorKind::NotFound, "the interface was removed")),
            _ => {}
        }
        let came = waited(read)?.zip(stamped).map(|(count, at)| (at, count));
        self.is_down &= came.is_none();
        Ok(came)
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        write(&self.socket, bytes)
    }

    fn complaint(&self) -> Option<String> {
        let down = discover::can::down(&Machine::ours(), &self.interface).filter(|_| self.is_down);
        down.map(|trouble| trouble.to_string())
    }
}

/// Sends a frame on a CAN bus.
pub(crate) fn write(socket: &CanSocket, bytes: &[u8]) -> io::Result<()> {
    let refused = || io::Error::new(io::ErrorKind::InvalidInput, "expected a can_frame of 16 bytes");
    socket.write_frame(&frame(bytes).ok_or_else(refused)?)
}

/// Encodes a frame as the kernel's `can_frame`: identifier with flags, length, three padding bytes, data.
fn bytes_of(frame: &CanFrame) -> [u8; FRAME_BYTES] {
    let mut bytes = [0; FRAME_BYTES];
    let data = frame.data();
    let length = u8::try_from(frame.dlc()).unwrap_or(0);
    for (to, from) in bytes.iter_mut().zip(frame.id_word().to_ne_bytes().iter().chain(&[length])) {
        *to = *from;
    }
    for (to, from) in bytes.iter_mut().skip(DATA_AT).zip(data) {
        *to = *from;
    }
    bytes
}

/// Decodes a `can_frame` of the kernel.
fn frame(bytes: &[u8]) -> Option<CanFrame> {
    let (word, rest) = bytes.split_first_chunk::<4>().filter(|_| bytes.len() == FRAME_BYTES)?;
    let word = u32::from_ne_bytes(*word);
    let length = usize::from(*rest.first()?);
    let data = bytes.get(DATA_AT..DATA_AT + length)?;
    let id = if word & EXTENDED == 0 {
        Id::Standard(StandardId::new(u16::try_from(word).ok()?)?)
    } else {
        Id::Extended(ExtendedId::new(word & !EXTENDED)?)
    };
    CanFrame::new(id, data)
}
