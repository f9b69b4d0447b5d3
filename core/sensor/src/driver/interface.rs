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
    /// An I2C bus. Each message is a transaction: the written bytes, then the read bytes.
    I2c,
}

/// Parameters of a new driver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriverSetup {
    /// Start of the dive.
    ///
    /// Each head runs its program from this time on. A head that joins later starts where its program is at that time.
    /// So the heads keep their relative phase, although their drivers do not communicate.
    pub begun: MonoNs,
    /// Rotation program of a profiling head; `None` for other devices.
    pub head: Option<HeadProgram>,
}

/// I/O operations that a driver can use.
pub trait Wire {
    /// Sends bytes. On a carrier of messages, they are one message.
    fn send(&mut self, bytes: &[u8]);

    /// Writes to a device on a polled bus, waits for the duration `settle`, and reads `read_bytes` bytes.
    ///
    /// Later, [`Driver::heard`] receives the written bytes followed by the read bytes.
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
    /// Messages from other senders on the line that could be messages of this device.
    pub strangers: IgnoredSenders,
}

/// Host side of one device's line.
pub trait Driver: Send {
    /// Handles the opening of the line. If it was open before, the device may have been replaced or switched off since.
    fn opened(&mut self, now: MonoNs, wire: &mut dyn Wire);

    /// Handles the closing of the line. Bytes that the driver sends from now on are discarded.
    ///
    /// The bytes of an incomplete frame are delivered unchanged, because they may contain a complete frame.
    fn closed(&mut self, _wire: &mut dyn Wire) {}

    /// Processes received bytes. `received` is the receive time of the first byte.
    ///
    /// Bytes that the driver does not deliver are lost to the loop and to the log.
    fn heard(&mut self, received: MonoNs, bytes: &[u8], wire: &mut dyn Wire);

    /// Whether these bytes alone contain a message that this device could have sent.
    ///
    /// On a line with any number of senders, the first sender of such bytes counts as the device. All other senders are
    /// ignored.
    fn accepts(&self, bytes: &[u8]) -> bool;

    /// Returns the time of the next call of [`Driver::wake`]; `None` if no call is needed.
    fn due(&self) -> Option<MonoNs>;

    /// Performs the action that [`Driver::due`] announced for this time.
    fn wake(&mut self, now: MonoNs, wire: &mut dyn Wire);

    /// Whether the driver waits for a response from the device. Until it arrives, other drivers on the same line must
    /// not transmit.
    fn awaits(&self) -> bool {
        false
    }

    /// Returns the duration of silence after which the connection is reopened.
    fn silence_timeout(&self) -> DurNs {
        DurNs::from_millis(5_000)
    }

    /// Returns the health of the device.
    fn health(&self) -> DeviceHealth;
}

/// Probe that identifies a device of one kind on a line.
///
/// Its requests are harmless to any other device on the line: they start no motion and change no stored setting.
pub trait Probe: Send {
    /// Returns the requests. They are sent one by one until the device has reported its identity.
    ///
    /// After each request, there is a pause for the response.
    fn questions(&self) -> Vec<Vec<u8>>;

    /// Processes received bytes, in pieces of any size.
    fn heard(&mut self, bytes: &[u8]);

    /// Returns the identity that the device has reported: parts separated by ", ".
    ///
    /// A part `key = value` is a line for the device's table in a vehicle file.
    fn identity(&self) -> Option<String>;

    /// Whether the device is certainly of this kind. Devices of other kinds may answer, too.
    fn is_of_kind(&self) -> bool;
}
