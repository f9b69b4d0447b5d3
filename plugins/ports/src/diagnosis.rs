//! System errors of ports as troubles: what is wrong, and the command that fixes it.

use std::io;

use crate::discover::remedy_for;
use crate::remedy;
use crate::trouble::{Trouble, TroubleKind};

/// Probing the device at `what` has failed with `error`.
pub(crate) fn probing(what: &str, error: &io::Error) -> Trouble {
    let Trouble { kind, remedy, .. } = opening(what, error);
    let why = match kind {
        TroubleKind::Absent => format!("asking at {what}: nobody answers there ({error})"),
        _ => format!("asking at {what}: {error}"),
    };
    Trouble { kind, why, remedy }
}

/// Opening `what` has failed with `error`.
pub(crate) fn opening(what: &str, error: &io::Error) -> Trouble {
    use io::ErrorKind as E;
    let why = |words: &str| format!("opening {what}: {words}");
    match error.kind() {
        E::NotFound => Trouble::not_there(what),
        E::PermissionDenied => Trouble::denied(what, &remedy_for(what)),
        E::ConnectionRefused => {
            Trouble::new(TroubleKind::Absent, why("nobody listens there"), Some(remedy::NOBODY_LISTENS))
        }
        E::TimedOut | E::HostUnreachable | E::NetworkUnreachable => {
            Trouble::new(TroubleKind::Absent, why("nobody answers there"), Some(remedy::NOBODY_ANSWERS))
        }
        E::ResourceBusy | E::AddrInUse => {
            Trouble::new(TroubleKind::Busy, why("another program has it"), Some("close that one"))
        }
        _ => Trouble::new(TroubleKind::Other, why(&error.to_string()), None),
    }
}

/// Opening a CAN interface has failed with `error`.
pub(crate) fn opening_can(interface: &str, error: &io::Error) -> Trouble {
    /// No such device; network is down; address family not supported. Source: Linux, errno.
    const ENODEV: i32 = 19;
    const EAFNOSUPPORT: i32 = 97;
    match error.raw_os_error() {
        Some(ENODEV) => Trouble::no_interface(interface),
        Some(EAFNOSUPPORT) => Trouble::no_can(interface),
        _ => opening(interface, error),
    }
}

/// Why an open line has failed.
pub(crate) fn losing(error: &io::Error) -> String {
    /// Input/output error; no such device or address; no such device. Source: Linux, errno.
    const UNPLUGGED: [i32; 3] = [5, 6, 19];
    use io::ErrorKind as E;
    if error.raw_os_error().is_some_and(|number| UNPLUGGED.contains(&number)) {
        return "the port is gone".to_owned();
    }
    match error.kind() {
        E::ConnectionRefused => "nobody listens there".to_owned(),
        E::ConnectionReset | E::ConnectionAborted => "the device has closed the connection".to_owned(),
        // The serial library's own has neither a number nor words.
        E::BrokenPipe if error.raw_os_error().is_some() => "the device has closed the connection".to_owned(),
        E::BrokenPipe if error.get_ref().is_none() => "the port is gone".to_owned(),
        E::TimedOut | E::WouldBlock => "it doesn't take what is sent to it".to_owned(),
        _ => error.to_string(),
    }
}
