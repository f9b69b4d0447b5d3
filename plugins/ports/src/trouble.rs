//! Why a line can't be opened, and what would mend it.

use std::fmt;

use headrace_sensor::connect::ConnectError;

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
