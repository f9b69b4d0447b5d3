//! Reasons why a line can't be opened, each with its fix.

use std::fmt;

use headrace_sensor::connect::{Connect, ConnectError};

use crate::fix_hint;

/// Kind of open error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OpenErrorKind {
    /// The port doesn't exist.
    Absent,
    /// The port exists but access is denied.
    Denied,
    /// Another program uses the port.
    Busy,
    /// Several devices match the `connect`.
    Ambiguous,
    /// Any other reason.
    Other,
}

/// Reason why a line can't be opened.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OpenError {
    /// Kind of error.
    pub kind: OpenErrorKind,
    /// Reason, as text.
    pub why: String,
    /// Advice or command that fixes the problem, if any.
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

    /// The device file or host doesn't exist.
    pub(crate) fn not_there(what: &str) -> Self {
        let why = format!("opening {what}: there is no such port");
        Self::new(OpenErrorKind::Absent, why, Some("plug it in, or run headrace devices"))
    }

    /// Access to the device file is denied.
    pub(crate) fn denied(path: &str, remedy: &str) -> Self {
        Self::new(OpenErrorKind::Denied, format!("opening {path}: this user may not open it"), Some(remedy))
    }

    /// The CAN interface doesn't exist.
    pub(crate) fn no_interface(interface: &str) -> Self {
        let why = format!("opening {interface}: there is no such CAN interface");
        Self::new(OpenErrorKind::Absent, why, Some(&fix_hint::no_interface(interface)))
    }

    /// The kernel has no CAN sockets.
    pub(crate) fn no_can(interface: &str) -> Self {
        let why = format!("opening {interface}: this kernel has no CAN sockets");
        Self::new(OpenErrorKind::Absent, why, Some(fix_hint::CAN_RAW))
    }

    /// The `connect` in the vehicle file doesn't parse.
    pub fn unusable(error: &ConnectError) -> Self {
        let ConnectError { text, problem, allowed } = error;
        Self::new(OpenErrorKind::Other, format!("connect = {text:?}: {problem}"), Some(allowed))
    }

    /// Another line of the vehicle uses the same device.
    pub(crate) fn same_device(connect: &Connect, other: &Connect) -> Self {
        let why =
            format!("opening {connect}: it leads to the same device as {other}, which another sensor uses");
        Self::new(
            OpenErrorKind::Busy,
            why,
            Some("give each sensor its own device, or the same connect to sensors that share a line"),
        )
    }

    pub(crate) fn not_plugged_in(what: &str) -> Self {
        let why = format!("looking for {what}: no such device is plugged in");
        Self::new(OpenErrorKind::Absent, why, Some("headrace devices lists those that are"))
    }

    pub(crate) fn ambiguous(what: &str, paths: &[String]) -> Self {
        let why = format!("looking for {what}: there are several, {}", paths.join(" and "));
        Self::new(OpenErrorKind::Ambiguous, why, Some("add the serial number to connect"))
    }

    #[cfg(not(target_os = "linux"))]
    pub(crate) fn unsupported(what: &str) -> Self {
        Self::new(
            OpenErrorKind::Other,
            format!("opening {what}: headrace doesn't support such ports on this system"),
            None,
        )
    }
}
