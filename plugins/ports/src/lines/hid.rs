//! HID devices, found by vendor, product and serial number.

use std::ffi::CString;
use std::fs::File;
use std::io;
use std::time::Duration;

use headrace_geometry::time::MonoNs;
use headrace_sensor::connect::UsbIdentity;
use hidapi::{DeviceInfo, HidApi, HidDevice, HidError};
use rustix::fs::{FlockOperation, flock};

use super::line::{Line, READ_BYTES};
use crate::clock;
use crate::diagnosis;
use crate::open_error::OpenError;

struct Hid {
    device: HidDevice,
    /// Lock that keeps other headrace processes out. The kernel would give each report to every program with the
    /// device open.
    _lock: File,
}

pub(super) fn open(identity: &UsbIdentity) -> Result<Box<dyn Line>, OpenError> {
    let path = path_of(identity)?;
    let lock = File::open(&path).map_err(|error| diagnosis::opening(&path, &error))?;
    flock(&lock, FlockOperation::NonBlockingLockExclusive)
        .map_err(|_| diagnosis::opening(&path, &io::ErrorKind::ResourceBusy.into()))?;
    let failed = |error: &HidError| diagnosis::opening(&path, &io_error(error));
    let opened =
        HidApi::new().and_then(|api| api.open_path(&CString::new(path.as_str()).unwrap_or_default()));
    Ok(Box::new(Hid { device: opened.map_err(|error| failed(&error))?, _lock: lock }))
}

/// Returns the device file of the only device with this identity.
pub(super) fn path_of(identity: &UsbIdentity) -> Result<String, OpenError> {
    let what = format!("hid:{identity}");
    let api = HidApi::new().map_err(|error| diagnosis::opening(&what, &io_error(&error)))?;
    let mut fitting = api.device_list().filter(|device| is_it(device, identity));
    let Some(device) = fitting.next() else { return Err(OpenError::not_plugged_in(&what)) };
    let path = device.path().to_string_lossy().into_owned();
    if let Some(other) = fitting.find(|other| other.path() != device.path()) {
        return Err(OpenError::ambiguous(&what, &[path, other.path().to_string_lossy().into_owned()]));
    }
    Ok(path)
}

fn is_it(device: &DeviceInfo, identity: &UsbIdentity) -> bool {
    (device.vendor_id(), device.product_id()) == (identity.vendor, identity.product)
        && identity.serial.as_ref().is_none_or(|serial| device.serial_number() == Some(serial.as_str()))
}

fn io_error(error: &HidError) -> io::Error {
    match error {
        HidError::IoError { error } => io::Error::new(error.kind(), error.to_string()),
        // hidapi reports an unplugged device only by this text.
        other if other.to_string().contains("disconnected") => {
            io::Error::new(io::ErrorKind::BrokenPipe, "it was unplugged")
        }
        other => io::Error::other(other.to_string()),
    }
}

impl Line for Hid {
    fn read(&mut self, wait: Duration, into: &mut [u8; READ_BYTES]) -> io::Result<Option<(MonoNs, usize)>> {
        let wait_ms = i32::try_from(wait.as_millis()).unwrap_or(i32::MAX).max(1);
        let count = self.device.read_timeout(into, wait_ms).map_err(|error| io_error(&error))?;
        Ok((count > 0).then(|| (clock::now(), count)))
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.device.write(bytes).map(|_| ()).map_err(|error| io_error(&error))
    }
}
