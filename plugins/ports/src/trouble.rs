//! Why a line can't be opened, and what would mend it.

use std::fmt;
use std::io;

use headrace_sensor::connect::ConnectError;

use crate::discover::remedy_for;
use crate::remedy;

/// What kind of trouble.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TroubleKind {
    /// It isn't there.
    Absent,
    /// It is there and we may not open it.
    Denied,
    /// Another program has it.
    Busy,
    /// There are several, and it isn't said which.
    Ambiguous,
    /// Something else.
    Other,
}

/// Why a line can't be opened.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Trouble {
    /// What kind.
    pub kind: TroubleKind,
    /// In words.
    pub why: String,
    /// The line or the command that mends it, where there is one.
    pub remedy: Option<String>,
}

/// Why an open line has failed, in words.
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

impl fmt::Display for Trouble {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.why)?;
        self.remedy.as_ref().map_or(Ok(()), |remedy| write!(f, "; {remedy}"))
    }
}

impl Trouble {
    pub(crate) fn new(kind: TroubleKind, why: String, remedy: Option<&str>) -> Self {
        Self { kind, why, remedy: remedy.map(str::to_owned) }
    }

    /// An open line has failed while its device was asked.
    pub(crate) fn asking(what: &str, error: &io::Error) -> Self {
        let Self { kind, remedy, .. } = Self::opening(what, error);
        let why = match kind {
            TroubleKind::Absent => format!("asking at {what}: nobody answers there ({error})"),
            _ => format!("asking at {what}: {error}"),
        };
        Self { kind, why, remedy }
    }

    /// Opening `what` has failed.
    pub(crate) fn opening(what: &str, error: &io::Error) -> Self {
        use io::ErrorKind as E;
        let why = |words: &str| format!("opening {what}: {words}");
        match error.kind() {
            E::NotFound => Self::not_there(what),
            E::PermissionDenied => Self::denied(what, &remedy_for(what)),
            E::ConnectionRefused => {
                Self::new(TroubleKind::Absent, why("nobody listens there"), Some(remedy::NOBODY_LISTENS))
            }
            E::TimedOut | E::HostUnreachable | E::NetworkUnreachable => {
                Self::new(TroubleKind::Absent, why("nobody answers there"), Some(remedy::NOBODY_ANSWERS))
            }
            E::ResourceBusy | E::AddrInUse => {
                Self::new(TroubleKind::Busy, why("another program has it"), Some("close that one"))
            }
            _ => Self::new(TroubleKind::Other, why(&error.to_string()), None),
        }
    }

    /// Opening a CAN interface has failed.
    pub(crate) fn can(interface: &str, error: &io::Error) -> Self {
        /// No such device; network is down; address family not supported. Source: Linux, errno.
        const ENODEV: i32 = 19;
        const EAFNOSUPPORT: i32 = 97;
        match error.raw_os_error() {
            Some(ENODEV) => Self::no_interface(interface),
            Some(EAFNOSUPPORT) => Self::no_can(interface),
            _ => Self::opening(interface, error),
        }
    }

    /// There is no such device file or host.
    pub(crate) fn not_there(what: &str) -> Self {
        let why = format!("opening {what}: it isn't there");
        Self::new(TroubleKind::Absent, why, Some("plug it in, or see headrace devices"))
    }

    /// The rights to a device file don't suffice.
    pub(crate) fn denied(path: &str, remedy: &str) -> Self {
        Self::new(TroubleKind::Denied, format!("opening {path}: this user may not open it"), Some(remedy))
    }

    /// There is no such CAN interface.
    pub(crate) fn no_interface(interface: &str) -> Self {
        let why = format!("opening {interface}: there is no such CAN interface");
        Self::new(TroubleKind::Absent, why, Some(&remedy::no_interface(interface)))
    }

    /// The kernel has no sockets for CAN.
    pub(crate) fn no_can(interface: &str) -> Self {
        let why = format!("opening {interface}: this kernel has no CAN sockets");
        Self::new(TroubleKind::Absent, why, Some(remedy::CAN_RAW))
    }

    /// A `connect` that can't be used, as it stands in a vehicle file.
    pub fn unusable(error: &ConnectError) -> Self {
        let ConnectError { text, problem, allowed } = error;
        Self::new(TroubleKind::Other, format!("connect = {text:?}: {problem}"), Some(allowed))
    }

    pub(crate) fn not_plugged_in(what: &str) -> Self {
        let why = format!("looking for {what}: no such device is plugged in");
        Self::new(TroubleKind::Absent, why, Some("headrace devices shows what is"))
    }

    pub(crate) fn ambiguous(what: &str, paths: &[String]) -> Self {
        let why = format!("looking for {what}: there are several, {}", paths.join(" and "));
        Self::new(TroubleKind::Ambiguous, why, Some("add the serial number to connect"))
    }

    #[cfg(not(target_os = "linux"))]
    pub(crate) fn unsupported(what: &str) -> Self {
        Self::new(TroubleKind::Other, format!("opening {what}: this system has no such ports for us"), None)
    }
}
