//! The host's side of a device's line, without I/O: what to send and when, what of the bytes goes to the loop, and what is
//! to be thought of the device.
//!
//! A driver is a state machine that a port's thread drives. It gets the time with every call, so that tests can let it talk
//! to an emulated device without a port, a thread or a clock.

mod cutter;
mod listener;

pub use cutter::{Cutter, Piece};
pub use listener::{Judge, Listener, MessageListener};

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sampling::head::HeadProgram;

/// How bytes get to a device and back.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Carrier {
    /// A serial port: bytes in a row.
    Serial,
    /// A TCP connection that we open: bytes in a row.
    Tcp,
    /// UDP: a message, or a piece of a row of bytes, a datagram.
    Udp,
    /// A CAN interface: a `can_frame` of 16 bytes a message.
    Can,
    /// A HID device: a report a message.
    Hid,
    /// An I2C bus: a transaction a message, the bytes written and then the bytes read.
    I2c,
}

/// What a driver is told when it is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriverSetup {
    /// When the dive began: heads are at their programs' start then, or where they would have come to since, so that they
    /// keep their phases among each other without knowing of each other.
    pub begun: MonoNs,
    /// For a head, its program.
    pub head: Option<HeadProgram>,
}

/// What a driver can do with its line.
pub trait Wire {
    /// Puts bytes on the line; on a carrier of messages they are one.
    fn send(&mut self, bytes: &[u8]);

    /// On a bus that is read on demand: writes, gives the device `settle` to work, and reads `read_bytes`. The bytes written
    /// and then those read come back through [`Driver::heard`].
    fn exchange(&mut self, write: &[u8], settle: DurNs, read_bytes: usize);

    /// Hands bytes over to the loop, `received` with their first one.
    fn deliver(&mut self, received: MonoNs, bytes: &[u8]);
}

/// What is to be thought of a device, as far as its bytes tell.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct DeviceHealth {
    /// Messages that it sent and that were understood.
    pub good_frames: u64,
    /// What it says that it is, once it has.
    pub identity: Option<String>,
    /// What is wrong with it, in words, with what would be right.
    pub complaint: Option<String>,
}

/// The host's side of one device's line.
pub trait Driver: Send {
    /// The line has been opened, for the first time or again: the device may have been replaced or switched off meanwhile.
    fn opened(&mut self, now: MonoNs, wire: &mut dyn Wire);

    /// The line has been closed: bytes held for the rest of a frame are delivered as they are, for a whole frame may be among
    /// them. What is sent goes nowhere.
    fn closed(&mut self, _wire: &mut dyn Wire) {}

    /// Bytes that came, the first of them at `received`. What isn't delivered is lost to the loop and to the log.
    fn heard(&mut self, received: MonoNs, bytes: &[u8], wire: &mut dyn Wire);

    /// When it next wants [`Driver::wake`], if it does.
    fn due(&self) -> Option<MonoNs>;

    /// The time that [`Driver::due`] gave has come.
    fn wake(&mut self, now: MonoNs, wire: &mut dyn Wire);

    /// Whether an answer is awaited, so that others on the same line keep silent.
    fn awaits(&self) -> bool {
        false
    }

    /// How long the device may be silent before its line is opened anew.
    fn silence_timeout(&self) -> DurNs {
        DurNs::from_millis(5_000)
    }

    /// What is to be thought of the device.
    fn health(&self) -> DeviceHealth;
}

/// Finds out whether a device of one kind is on a line, and which. What it sends is harmless to whatever else is there:
/// nothing turns, and no setting stays.
pub trait Probe: Send {
    /// What to send, one after the other, each with time for an answer, until there is an identity.
    fn questions(&self) -> Vec<Vec<u8>>;

    /// Bytes that came, in whatever pieces.
    fn heard(&mut self, bytes: &[u8]);

    /// What the device says that it is, once it has.
    fn identity(&self) -> Option<String>;
}
