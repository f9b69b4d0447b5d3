//! Interface of a driver: transport, setup, I/O operations, health and identification.

use super::strangers::IgnoredSenders;
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
    /// Each head runs its program from this time on. A head that joins later starts at the position that its program
    /// gives for the time of joining. So the heads keep their relative phase, although their drivers do not
    /// communicate.
    pub begun: MonoNs,
    /// Rotation program of a profiling head; `None` for other devices.
    pub head: Option<HeadProgram>,
}

/// I/O operations that a driver can use.
pub trait Wire {
    /// Sends bytes, as one message on a message-based carrier.
    fn send(&mut self, bytes: &[u8]);

    /// Writes to a device on a polled bus, waits for the duration `settle`, and reads `read_bytes` bytes.
    ///
    /// [`Driver::heard`] then receives the written bytes followed by the read bytes.
    fn exchange(&mut self, write: &[u8], settle: DurNs, read_bytes: usize);

    /// Passes bytes on to the loop; `received` is the receive time of the first byte.
    fn deliver(&mut self, received: MonoNs, bytes: &[u8]);
}

/// Health of a device, inferred from its traffic.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct DeviceHealth {
    /// Number of valid messages from the device.
    pub good_frames: u64,
    /// Identity that the device has reported, if any.
    pub identity: Option<String>,
    /// Description of the device's fault, with its remedy; `None` without a fault.
    pub complaint: Option<String>,
    /// Messages of other senders on the line that look like messages of the device.
    pub strangers: IgnoredSenders,
}

/// Host side of one device's line.
pub trait Driver: Send {
    /// Reacts to the line being opened or reopened. The device may have been replaced or switched off while the line
    /// was closed.
    fn opened(&mut self, now: MonoNs, wire: &mut dyn Wire);

    /// Reacts to the line being closed. Bytes that the driver sends from now on are discarded.
    ///
    /// The bytes of an incomplete frame are delivered unchanged, because they may contain a complete frame.
    fn closed(&mut self, _wire: &mut dyn Wire) {}

    /// Processes received bytes; `received` is the receive time of the first byte.
    ///
    /// Bytes that the driver does not deliver are lost to the loop and to the log.
    fn heard(&mut self, received: MonoNs, bytes: &[u8], wire: &mut dyn Wire);

    /// Whether these bytes alone contain a message that this device could have sent.
    ///
    /// On a line with any number of senders, the sender of the first such bytes counts as the device. All other
    /// senders are ignored.
    fn accepts(&self, bytes: &[u8]) -> bool;

    /// Returns the time of the next call of [`Driver::wake`]; `None` if no call is needed.
    fn due(&self) -> Option<MonoNs>;

    /// Performs the action that is due at the time that [`Driver::due`] returned.
    fn wake(&mut self, now: MonoNs, wire: &mut dyn Wire);

    /// Whether the driver waits for a response from the device. While the response is pending, other drivers on the
    /// same line must not transmit.
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

/// Probe that identifies a device of one kind on a line.
///
/// The probe's requests are harmless to any other device on the line: they start no motion and change no stored
/// setting.
pub trait Probe: Send {
    /// Returns the requests, which are sent one by one until the device has reported its identity.
    ///
    /// A pause for the response follows each request.
    fn questions(&self) -> Vec<Vec<u8>>;

    /// Processes received bytes, in pieces of any size.
    fn heard(&mut self, bytes: &[u8]);

    /// Returns the identity that the device has reported.
    fn identity(&self) -> Option<String>;
}
