//! Device side of the kernel's `/dev/uhid`: a HID device created by a program, for rehearsals and tests.
//!
//! A process that opens `/dev/uhid` (normally root) and writes these events makes the kernel plug in a virtual
//! device, which gets its own `/dev/hidrawN`. Layout: `struct uhid_event` of Linux' `<linux/uhid.h>`, packed, native
//! byte order:
//! ```text
//!   CREATE2   0 type u32 = 11, 4 name[128], 132 phys[64], 196 serial ("uniq")[64], 260 descriptor's size u16, 262 bus u16,
//!             264 vendor u32, 268 product u32, 272 version u32, 276 country u32, 280 descriptor, at most 4096
//!   INPUT2    0 type u32 = 12, 4 size u16, 6 report
//!   DESTROY   0 type u32 = 1
//! ```
//! The kernel zero-fills a short event, so events are written without their trailing zeros.

use std::io::Write;

/// Path of the kernel's uhid device.
pub const PATH: &str = "/dev/uhid";

/// Maximum length of a report descriptor, set by the kernel.
pub const MAX_DESCRIPTOR_BYTES: usize = 4096;

/// Maximum length of a report, set by the kernel.
pub const MAX_INPUT_BYTES: usize = 4096;

const DESTROY: u32 = 1;
const CREATE2: u32 = 11;
const INPUT2: u32 = 12;
const BUS_USB: u16 = 3;
const NAME_BYTES: usize = 128;
const PHYS_BYTES: usize = 64;
const SERIAL_BYTES: usize = 64;

/// Identity of a virtual device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Identity<'a> {
    /// Product name, at most 127 bytes.
    pub name: &'a str,
    /// Serial number, at most 63 bytes; it distinguishes devices of one model.
    pub serial: &'a str,
    /// USB vendor id.
    pub vendor_id: u16,
    /// USB product id.
    pub product_id: u16,
    /// HID report descriptor, 1 to 4096 bytes.
    pub descriptor: &'a [u8],
}

/// Reason why a device couldn't be created, written or removed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum UhidError {
    /// A field doesn't fit the kernel's event.
    #[error("{what} has {bytes} bytes; allowed: {least} to {most}")]
    Size {
        /// Name of the field.
        what: &'static str,
        /// Length of the field, bytes.
        bytes: usize,
        /// Minimum length of the field, bytes.
        least: usize,
        /// Maximum length of the field, bytes.
        most: usize,
    },
    /// The kernel refused an event.
    #[error("uhid: {event}: {source}")]
    Refused {
        /// Name of the event.
        event: &'static str,
        /// Error of the kernel.
        source: std::io::Error,
    },
    /// The kernel accepted only part of an event, which real kernels never do.
    #[error("uhid: {event}: {taken} of {bytes} bytes were taken")]
    Cut {
        /// Name of the event.
        event: &'static str,
        /// Number of bytes of the event that the kernel accepted.
        taken: usize,
        /// Length of the event, bytes.
        bytes: usize,
    },
}

/// A virtual device. It stays plugged in until [`VirtualDevice::unplug`], or until `W` is closed.
#[derive(Debug)]
pub struct VirtualDevice<W> {
    kernel: W,
}

impl<W: Write> VirtualDevice<W> {
    /// Plugs in a USB device.
    ///
    /// `kernel` is `/dev/uhid`, opened for writing without a buffer, because each write must be one event. The kernel
    /// creates `/dev/hidrawN` some time after this function returns.
    ///
    /// Errors: see [`UhidError`].
    pub fn plug(mut kernel: W, identity: &Identity<'_>) -> Result<Self, UhidError> {
        send(&mut kernel, "create a device", &create(identity)?)?;
        Ok(Self { kernel })
    }

    /// Sends an input report of 1 to 4096 bytes. The report begins with its id if the descriptor has report
    /// ids.
    pub fn report(&mut self, report: &[u8]) -> Result<(), UhidError> {
        send(&mut self.kernel, "input report", &input(report)?)
    }

    /// Unplugs the device, and returns the writer for reuse.
    pub fn unplug(mut self) -> Result<W, UhidError> {
        send(&mut self.kernel, "destroy the device", &DESTROY.to_ne_bytes())?;
        Ok(self.kernel)
    }
}

fn create(identity: &Identity<'_>) -> Result<Vec<u8>, UhidError> {
    let size = size("a report descriptor", identity.descriptor, 1, MAX_DESCRIPTOR_BYTES)?;
    let mut event = Vec::with_capacity(280 + identity.descriptor.len());
    event.extend(CREATE2.to_ne_bytes());
    push_text(&mut event, "a device's name", identity.name, NAME_BYTES)?;
    push_text(&mut event, "a device's place", "headrace", PHYS_BYTES)?;
    push_text(&mut event, "a serial number", identity.serial, SERIAL_BYTES)?;
    event.extend(size.to_ne_bytes());
    event.extend(BUS_USB.to_ne_bytes());
    // The fields version and country are zero.
    for word in [u32::from(identity.vendor_id), u32::from(identity.product_id), 0, 0] {
        event.extend(word.to_ne_bytes());
    }
    event.extend(identity.descriptor);
    Ok(event)
}

fn input(report: &[u8]) -> Result<Vec<u8>, UhidError> {
    let size = size("a report", report, 1, MAX_INPUT_BYTES)?;
    let mut event = Vec::with_capacity(6 + report.len());
    event.extend(INPUT2.to_ne_bytes());
    event.extend(size.to_ne_bytes());
    event.extend(report);
    Ok(event)
}

fn size(what: &'static str, bytes: &[u8], least: usize, most: usize) -> Result<u16, UhidError> {
    let size = u16::try_from(bytes.len()).ok().filter(|_| (least..=most).contains(&bytes.len()));
    size.ok_or(UhidError::Size { what, bytes: bytes.len(), least, most })
}

/// Appends a text to a field of `field` bytes. The last byte of the field stays zero.
fn push_text(event: &mut Vec<u8>, what: &'static str, text: &str, field: usize) -> Result<(), UhidError> {
    size(what, text.as_bytes(), 0, field - 1)?;
    event.extend(text.as_bytes());
    event.extend(std::iter::repeat_n(0, field - text.len()));
    Ok(())
}

fn send(kernel: &mut impl Write, name: &'static str, event: &[u8]) -> Result<(), UhidError> {
    match kernel.write(event) {
        Ok(taken) if taken == event.len() => Ok(()),
        Ok(taken) => Err(UhidError::Cut { event: name, taken, bytes: event.len() }),
        Err(source) => Err(UhidError::Refused { event: name, source }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    /// A vendor-defined device, with reports of two bytes.
    const DESCRIPTOR: [u8; 21] = [
        0x06, 0x00, 0xFF, 0x09, 0x01, 0xA1, 0x01, 0x09, 0x02, 0x15, 0x00, 0x26, 0xFF, 0x00, 0x75, 0x08, 0x95,
        0x02, 0x81, 0x02, 0xC0,
    ];

    const COUNTER: Identity<'static> = Identity {
        name: "tether counter",
        serial: "HR-0001",
        vendor_id: 0x1209,
        product_id: 0x0001,
        descriptor: &DESCRIPTOR,
    };

    /// A stand-in for the kernel that records each write, and accepts at most a given number of bytes of
    /// each.
    #[derive(Debug)]
    struct Events {
        taken: Vec<Vec<u8>>,
        most: usize,
    }

    impl Write for &mut Events {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            let taken = bytes.len().min(self.most);
            self.taken.push(bytes[..taken].to_vec());
            Ok(taken)
        }

        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    fn created(identity: &Identity<'_>) -> Vec<u8> {
        let mut event = Vec::new();
        VirtualDevice::plug(&mut event, identity).unwrap();
        event
    }

    #[test]
    fn event_fields_are_at_the_kernel_offsets() {
        let event = created(&COUNTER);
        assert_eq!(event.len(), 280 + DESCRIPTOR.len());
        assert_eq!(event[0..4], 11_u32.to_ne_bytes());
        assert_eq!(event[4..18], *b"tether counter");
        assert!(event[18..132].iter().all(|byte| *byte == 0));
        assert_eq!(event[132..140], *b"headrace");
        assert!(event[140..196].iter().all(|byte| *byte == 0));
        assert_eq!(event[196..203], *b"HR-0001");
        assert!(event[203..260].iter().all(|byte| *byte == 0));
        assert_eq!(event[260..262], 21_u16.to_ne_bytes());
        assert_eq!(event[262..264], 3_u16.to_ne_bytes());
        assert_eq!(event[264..268], 0x1209_u32.to_ne_bytes());
        assert_eq!(event[268..272], 1_u32.to_ne_bytes());
        assert_eq!(event[272..280], [0; 8]);
        assert_eq!(event[280..], DESCRIPTOR);
    }

    #[test]
    #[cfg(target_endian = "little")]
    fn report_event_matches_the_worked_example() {
        let report = [0x01, 0x2A, 0x01, 0xC0, 0x1D, 0xFE, 0xFF, 0xDC, 0x05, 0x00, 0x00];
        let mut expected = vec![0x0C, 0x00, 0x00, 0x00, 0x0B, 0x00];
        expected.extend(report);
        assert_eq!(input(&report).unwrap(), expected);
    }

    #[test]
    fn each_uhid_event_is_one_write() {
        let mut events = Events { taken: Vec::new(), most: usize::MAX };
        let mut device = VirtualDevice::plug(&mut events, &COUNTER).unwrap();
        device.report(&[1; 11]).unwrap();
        device.report(&[2; 11]).unwrap();
        let kernel = device.unplug().unwrap();
        VirtualDevice::plug(kernel, &COUNTER).unwrap();
        let lengths: Vec<_> = events.taken.iter().map(Vec::len).collect();
        assert_eq!(lengths, [301, 17, 17, 4, 301]);
        assert_eq!(events.taken[3], 1_u32.to_ne_bytes());
    }

    #[test]
    fn fields_of_invalid_length_are_refused() {
        let said = |identity| VirtualDevice::plug(Vec::new(), &identity).unwrap_err().to_string();
        let long = "x".repeat(128);
        let name = Identity { name: &long, ..COUNTER };
        assert_eq!(said(name), "a device's name has 128 bytes; allowed: 0 to 127");
        let serial = Identity { serial: &long[..64], ..COUNTER };
        assert_eq!(said(serial), "a serial number has 64 bytes; allowed: 0 to 63");
        let empty = Identity { descriptor: &[], ..COUNTER };
        assert_eq!(said(empty), "a report descriptor has 0 bytes; allowed: 1 to 4096");
        let mut device = VirtualDevice::plug(Vec::new(), &COUNTER).unwrap();
        assert_eq!(
            device.report(&[0; 4097]).unwrap_err().to_string(),
            "a report has 4097 bytes; allowed: 1 to 4096"
        );

        let fits = Identity { name: &long[..127], serial: &long[..63], ..COUNTER };
        let event = created(&fits);
        assert_eq!((event[131], event[259]), (0, 0));
    }

    #[test]
    fn partial_event_write_is_an_error() {
        let mut events = Events { taken: Vec::new(), most: 100 };
        let said = VirtualDevice::plug(&mut events, &COUNTER).unwrap_err().to_string();
        assert_eq!(said, "uhid: create a device: 100 of 301 bytes were taken");
    }
}
