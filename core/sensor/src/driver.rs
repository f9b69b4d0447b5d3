//! Host side of a device's line, without I/O.
//!
//! It decides what to send and when, which bytes go to the loop, and how healthy the device is.
//!
//! A driver is a state machine run by a port's thread. Every call passes the time, so that tests can run it against
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
    /// Start of the dive.
    ///
    /// Each head runs its program from then on, or joins it at the due position. So the heads keep their relative
    /// phase without communication between their drivers.
    pub begun: MonoNs,
    /// For a head, its program.
    pub head: Option<HeadProgram>,
}

/// I/O operations that a driver can use.
pub trait Wire {
    /// Sends bytes; on a message-based carrier, as one message.
    fn send(&mut self, bytes: &[u8]);

    /// Writes on a polled bus, waits `settle` for the device, and reads `read_bytes`.
    ///
    /// The bytes written, followed by those read, come back through [`Driver::heard`].
    fn exchange(&mut self, write: &[u8], settle: DurNs, read_bytes: usize);

    /// Passes bytes on to the loop; `received` is the receive time of the first.
    fn deliver(&mut self, received: MonoNs, bytes: &[u8]);
}

/// Health of a device, inferred from its traffic.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct DeviceHealth {
    /// Valid messages received from it.
    pub good_frames: u64,
    /// Identity that the device has reported.
    pub identity: Option<String>,
    /// Description of a fault, with its remedy.
    pub complaint: Option<String>,
    /// Messages on its line from other senders that look like its own.
    pub strangers: Strangers,
}

/// Host side of one device's line.
pub trait Driver: Send {
    /// Notes that the line has been opened or reopened. The device may have been replaced or switched off meanwhile.
    fn opened(&mut self, now: MonoNs, wire: &mut dyn Wire);

    /// Notes that the line has been closed. Bytes sent are discarded.
    ///
    /// The bytes of an incomplete frame are delivered as they are, since they may contain a complete one.
    fn closed(&mut self, _wire: &mut dyn Wire) {}

    /// Processes received bytes, the first of them at `received`. Undelivered bytes are lost to the loop and to the
    /// log.
    fn heard(&mut self, received: MonoNs, bytes: &[u8], wire: &mut dyn Wire);

    /// Whether these bytes alone contain a message that this device could have sent.
    ///
    /// On a line that anybody may send to, the sender of the first such bytes counts as the device from then on.
    /// Others are ignored.
    fn accepts(&self, bytes: &[u8]) -> bool;

    /// Returns the time of the next [`Driver::wake`], if any.
    fn due(&self) -> Option<MonoNs>;

    /// Acts at the time given by [`Driver::due`].
    fn wake(&mut self, now: MonoNs, wire: &mut dyn Wire);

    /// Whether a response is pending, so that other drivers on the line must not transmit.
    fn awaits(&self) -> bool {
        false
    }

    /// Returns the silence timeout after which the connection is reopened.
    fn silence_timeout(&self) -> DurNs {
        DurNs::from_millis(5_000)
    }

    /// Returns the health of the device.
    fn health(&self) -> DeviceHealth;
}

/// Identifies a device of one kind on a line.
///
/// Its requests are harmless to any other device there: nothing turns, and no setting persists.
pub trait Probe: Send {
    /// Returns the requests to send one after the other until there is an identity.
    ///
    /// Each has time for a response.
    fn questions(&self) -> Vec<Vec<u8>>;

    /// Processes received bytes, in pieces of any size.
    fn heard(&mut self, bytes: &[u8]);

    /// Returns the identity that the device has reported.
    fn identity(&self) -> Option<String>;
}
