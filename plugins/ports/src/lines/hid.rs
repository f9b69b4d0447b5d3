//! HID devices, found by vendor, product and serial number.

use std::io;
use std::time::Duration;

use headrace_geometry::time::MonoNs;
use headrace_sensor::connect::UsbIdentity;
use hidapi::{DeviceInfo, HidApi, HidDevice, HidError};

use super::line::{Line, READ_BYTES};
use crate::clock;
use crate::diagnosis;
use crate::open_error::OpenError;

struct Hid(HidDevice);

pub(super) fn open(identity: &UsbIdentity) -> Result<Box<dyn Line>, OpenError> {
    let what = format!("hid:{identity}");
    let api = HidApi::new().map_err(|error| diagnosis::opening(&what, &io_error(&error)))?;
    let mut fitting = api.device_list().filter(|device| is_it(device, identity));
    let Some(device) = fitting.next() else { return Err(OpenError::not_plugged_in(&what)) };
    let path = device.path().to_string_lossy().into_owned();
    if let Some(other) = fitting.find(|other| other.path() != device.path()) {
        return Err(OpenError::ambiguous(&what, &[path, other.path().to_string_lossy().into_owned()]));
    }
    let opened =
        api.open_path(device.path()).map_err(|error| diagnosis::opening(&path, &io_error(&error)))?;
    Ok(Box::new(Hid(opened)))
}

fn is_it(device: &DeviceInfo, identity: &UsbIdentity) -> bool {
    (device.vendor_id(), device.product_id()) == (identity.vendor, identity.product)
        && identity.serial.as_ref().is_none_or(|serial| device.serial_number() == Some(serial.as_str()))
}

fn io_error(error: &HidError) -> io::Error {
    match error {
        HidError::IoError { error } => io::Error::new(error.kind(), error.to_string()),
        // hidapi's only mark of an unplugged device is this text.
        other if other.to_string().contains("disconnected") => {
            io::Error::new(io::ErrorKind::BrokenPipe, "it was unplugged")
        }
        other => io::Error::other(other.to_string()),
    }
}

impl Line for Hid {
    fn read(&mut self, wait: Duration, into: &mut [u8; READ_BYTES]) -> io::Result<Option<(MonoNs, usize)>> {
        let wait_ms = i32::try_from(wait.as_millis()).unwrap_or(i32::MAX).max(1);
        let count = self.0.read_timeout(into, wait_ms).map_err(|error| io_error(&error))?;
        Ok((count > 0).then(|| (clock::now(), count)))
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.write(bytes).map(|_| ()).map_err(|error| io_error(&error))
    }
}
