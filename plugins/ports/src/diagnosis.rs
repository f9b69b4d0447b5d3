//! Maps system errors of ports to causes, each with a command that fixes it.

use std::io;

use crate::discover::remedy_for;
use crate::fix_hint;
use crate::open_error::{OpenError, OpenErrorKind};

/// Returns the cause of `error`, which occurred while probing the device at `what`.
pub(crate) fn probing(what: &str, error: &io::Error) -> OpenError {
    let OpenError { kind, remedy, .. } = opening(what, error);
    let why = match kind {
        OpenErrorKind::Absent => format!("probing {what}: no device answers there ({error})"),
        _ => format!("probing {what}: {error}"),
    };
    OpenError { kind, why, remedy }
}

/// Returns the cause of `error`, which occurred while opening `what`.
pub(crate) fn opening(what: &str, error: &io::Error) -> OpenError {
    use io::ErrorKind as E;
    let why = |words: &str| format!("opening {what}: {words}");
    match error.kind() {
        E::NotFound => OpenError::not_there(what),
        E::PermissionDenied => OpenError::denied(what, &remedy_for(what)),
        E::ConnectionRefused => OpenError::new(
            OpenErrorKind::Absent,
            why("no device listens there"),
            Some(fix_hint::NOBODY_LISTENS),
        ),
        E::TimedOut | E::HostUnreachable | E::NetworkUnreachable => OpenError::new(
            OpenErrorKind::Absent,
            why("no device answers there"),
            Some(fix_hint::NOBODY_ANSWERS),
        ),
        E::ResourceBusy | E::AddrInUse => {
            OpenError::new(OpenErrorKind::Busy, why("another program uses it"), Some("close that program"))
        }
        _ => OpenError::new(OpenErrorKind::Other, why(&error.to_string()), None),
    }
}

/// Returns the cause of `error`, which occurred while opening a CAN interface.
pub(crate) fn opening_can(interface: &str, error: &io::Error) -> OpenError {
    /// No such device; address family not supported. Source: Linux, errno.
    const ENODEV: i32 = 19;
    const EAFNOSUPPORT: i32 = 97;
    match error.raw_os_error() {
        Some(ENODEV) => OpenError::no_interface(interface),
        Some(EAFNOSUPPORT) => OpenError::no_can(interface),
        _ => opening(interface, error),
    }
}

/// Returns the reason why an open line failed.
pub(crate) fn losing(error: &io::Error) -> String {
    /// Input/output error; no such device or address; no such device. Source: Linux, errno.
    const UNPLUGGED: [i32; 3] = [5, 6, 19];
    use io::ErrorKind as E;
    if error.raw_os_error().is_some_and(|number| UNPLUGGED.contains(&number)) {
        return "the port is gone".to_owned();
    }
    match error.kind() {
        E::ConnectionRefused => "no device listens there".to_owned(),
        E::ConnectionReset | E::ConnectionAborted => "the device has closed the connection".to_owned(),
        // A `BrokenPipe` created by the serial library itself has neither an errno nor a message.
        E::BrokenPipe if error.raw_os_error().is_some() => "the device has closed the connection".to_owned(),
        E::BrokenPipe if error.get_ref().is_none() => "the port is gone".to_owned(),
        E::TimedOut | E::WouldBlock => "the device accepts no data".to_owned(),
        _ => error.to_string(),
    }
}
