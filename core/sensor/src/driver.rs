//! Host side of a device's line, without I/O: what to send and when, which bytes go to the loop, and the device's health.
//!
//! A driver is a state machine run by a port's thread. It gets the time with every call, so that tests can run it against
//! an emulated device without a port, a thread or a clock.

mod cutter;
mod listener;
mod strangers;

pub use cutter::{Cutter, Piece};
pub use listener::{Judge, Listener, MessageListener};
pub use strangers::Strangers;

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sampling::head::HeadProgram;

/// Transport between the host and a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Carrier {
    /// A serial port: a byte stream.
    Serial,
    /// A TCP connection opened by the host: a byte stream.
    Tcp,
    /// UDP: each datagram is a message, or a piece of a byte stream.
    Udp,
    /// A CAN interface: each message is a `can_frame` of 16 bytes.
    Can,
    /// A HID device: each message is a report.
    Hid,
    /// An I2C bus: each message is a transaction, the bytes written followed by the bytes read.
    I2c,
}

/// Parameters of a new driver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriverSetup {
    /// Start of the dive: each head runs its program from then on, or joins it at the position due, so that the heads keep
    /// their relative phase without communication between their drivers.
    pub begun: MonoNs,
    /// For a head, its program.
    pub head: Option<HeadProgram>,
}

/// I/O operations available to a driver.
pub trait Wire {
    /// Sends bytes; on a message-based carrier, as one message.
    fn send(&mut self, bytes: &[u8]);

    /// On a bus that is polled: writes, waits `settle` for the device, and reads `read_bytes`. The bytes written followed by
    /// those read come back through [`Driver::heard`].
    fn exchange(&mut self, write: &[u8], settle: DurNs, read_bytes: usize);

    /// Passes bytes on to the loop; `received` is the receive time of the first.
    fn deliver(&mut self, received: MonoNs, bytes: &[u8]);
}

/// Health of a device as inferred from its traffic.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct DeviceHealth {
    /// Valid messages received from it.
    pub good_frames: u64,
    /// Identity reported by the device, once received.
    pub identity: Option<String>,
    /// Description of a fault, with its remedy.
    pub complaint: Option<String>,
    /// Messages on its line by others that pass for it.
    pub strangers: Strangers,
}

/// Host side of one device's line.
pub trait Driver: Send {
    /// The line has been opened or reopened: the device may have been replaced or switched off meanwhile.
    fn opened(&mut self, now: MonoNs, wire: &mut dyn Wire);

    /// The line has been closed: the bytes of an incomplete frame are delivered as they are, for they may contain a complete
    /// one. Bytes sent are discarded.
    fn closed(&mut self, _wire: &mut dyn Wire) {}

    /// Received bytes, the first of them at `received`. Bytes that aren't delivered are lost to the loop and to the log.
    fn heard(&mut self, received: MonoNs, bytes: &[u8], wire: &mut dyn Wire);

    /// Whether these bytes, on their own, hold a message that this device could have sent. On a line that anybody may send
    /// to, the sender of the first such bytes is the device from then on, and others aren't heard.
    fn accepts(&self, bytes: &[u8]) -> bool;

    /// Time of the next [`Driver::wake`], if any.
    fn due(&self) -> Option<MonoNs>;

    /// Called at the time given by [`Driver::due`].
    fn wake(&mut self, now: MonoNs, wire: &mut dyn Wire);

    /// Whether a response is pending, so that others on the same line must not transmit.
    fn awaits(&self) -> bool {
        false
    }

    /// Silence timeout after which the connection is reopened.
    fn silence_timeout(&self) -> DurNs {
        DurNs::from_millis(5_000)
    }

    /// Health of the device.
    fn health(&self) -> DeviceHealth;
}

/// Identifies a device of one kind on a line. What it sends is harmless to any other device there: nothing turns, and no
/// setting persists.
pub trait Probe: Send {
    /// Requests to send one after the other, each with time for a response, until there is an identity.
    fn questions(&self) -> Vec<Vec<u8>>;

    /// Received bytes, in pieces of any size.
    fn heard(&mut self, bytes: &[u8]);

    /// Identity reported by the device, once received.
    fn identity(&self) -> Option<String>;
}
