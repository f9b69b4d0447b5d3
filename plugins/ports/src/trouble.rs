//! Why a line can't be opened, and what would mend it.

use std::fmt;
use std::io;

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

impl fmt::Display for Trouble {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.why)?;
        self.remedy.as_ref().map_or(Ok(()), |remedy| write!(f, "; {remedy}"))
    }
}

impl Trouble {
    fn new(kind: TroubleKind, why: String, remedy: Option<&str>) -> Self {
        Self { kind, why, remedy: remedy.map(str::to_owned) }
    }

    /// Opening `what` has failed.
    pub(crate) fn opening(what: &str, error: &io::Error) -> Self {
        use io::ErrorKind as E;
        let why = |words: &str| format!("opening {what}: {words}");
        match error.kind() {
            E::NotFound => Self::new(
                TroubleKind::Absent,
                why("it isn't there"),
                Some("plug it in, or see headrace devices"),
            ),
            E::PermissionDenied => {
                let remedy = format!("see headrace devices, or allow it to this user: {}", group_line(what));
                Self::new(TroubleKind::Denied, why("this user may not open it"), Some(&remedy))
            }
            E::ConnectionRefused | E::TimedOut | E::HostUnreachable | E::NetworkUnreachable => {
                Self::new(TroubleKind::Absent, why(&format!("nobody answers there ({error})")), None)
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
            Some(ENODEV) => Self::new(
                TroubleKind::Absent,
                format!("opening {interface}: there is no such interface"),
                Some("plug the adapter in; ip link shows what there is"),
            ),
            Some(EAFNOSUPPORT) => Self::new(
                TroubleKind::Absent,
                format!("opening {interface}: this kernel has no CAN"),
                Some("sudo modprobe can-raw"),
            ),
            _ => Self::opening(interface, error),
        }
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

/// The line that gives this user the right to a device file.
fn group_line(path: &str) -> &'static str {
    if path.starts_with("/dev/hidraw") {
        "install deploy/udev/70-headrace.rules"
    } else if path.starts_with("/dev/i2c") {
        "sudo usermod -aG i2c $USER, and log in again"
    } else {
        "sudo usermod -aG dialout $USER, and log in again"
    }
}
