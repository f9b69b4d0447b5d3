//! Why a line can't be opened, and what would mend it.

use std::fmt;

use headrace_sensor::connect::ConnectError;

use crate::fix_hint;

/// What kind of trouble.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OpenErrorKind {
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
pub struct OpenError {
    /// What kind.
    pub kind: OpenErrorKind,
    /// In words.
    pub why: String,
    /// The line or the command that mends it, where there is one.
    pub remedy: Option<String>,
}

impl fmt::Display for OpenError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.why)?;
        self.remedy.as_ref().map_or(Ok(()), |remedy| write!(f, "; {remedy}"))
    }
}

impl OpenError {
    pub(crate) fn new(kind: OpenErrorKind, why: String, remedy: Option<&str>) -> Self {
        Self { kind, why, remedy: remedy.map(str::to_owned) }
    }

    /// There is no such device file or host.
    pub(crate) fn not_there(what: &str) -> Self {
        let why = format!("opening {what}: it isn't there");
        Self::new(OpenErrorKind::Absent, why, Some("plug it in, or see headrace devices"))
    }

    /// The rights to a device file don't suffice.
    pub(crate) fn denied(path: &str, remedy: &str) -> Self {
        Self::new(OpenErrorKind::Denied, format!("opening {path}: this user may not open it"), Some(remedy))
    }

    /// There is no such CAN interface.
    pub(crate) fn no_interface(interface: &str) -> Self {
        let why = format!("opening {interface}: there is no such CAN interface");
        Self::new(OpenErrorKind::Absent, why, Some(&fix_hint::no_interface(interface)))
    }

    /// The kernel has no sockets for CAN.
    pub(crate) fn no_can(interface: &str) -> Self {
        let why = format!("opening {interface}: this kernel has no CAN sockets");
        Self::new(OpenErrorKind::Absent, why, Some(fix_hint::CAN_RAW))
    }

    /// A `connect` that can't be used, as it stands in a vehicle file.
    pub fn unusable(error: &ConnectError) -> Self {
        let ConnectError { text, problem, allowed } = error;
        Self::new(OpenErrorKind::Other, format!("connect = {text:?}: {problem}"), Some(allowed))
    }

    pub(crate) fn not_plugged_in(what: &str) -> Self {
        let why = format!("looking for {what}: no such device is plugged in");
        Self::new(OpenErrorKind::Absent, why, Some("headrace devices shows what is"))
    }

    pub(crate) fn ambiguous(what: &str, paths: &[String]) -> Self {
        let why = format!("looking for {what}: there are several, {}", paths.join(" and "));
        Self::new(OpenErrorKind::Ambiguous, why, Some("add the serial number to connect"))
    }

    #[cfg(not(target_os = "linux"))]
    pub(crate) fn unsupported(what: &str) -> Self {
        Self::new(OpenErrorKind::Other, format!("opening {what}: this system has no such ports for us"), None)
    }
}
