//! I/O that all device drivers share.
//!
//! Contains the host's clock, the lines of every carrier, and the service that opens, reads, timestamps and reopens a
//! line. Also contains device discovery, diagnosis and probing. Drivers are in the device crates and do no I/O; see
//! [`headrace_sensor::driver`].

mod backlog;
mod clock;
mod device_end;
mod diagnosis;
mod discover;
mod fix_hint;
mod host;
mod line_service;
mod lines;
mod open_error;
mod probe;
mod status;
mod supervisor;
pub mod uhid;
mod wake;

pub use backlog::LateData;
pub use clock::{ahead, clock_anchor, now, of_wall, set_ahead};
pub use device_end::{EmulatedPort, wait_for_any};
pub use discover::can::is_interface_up;
pub use discover::{Found, Machine, Presence, Rights, User, discover, presence};
pub use host::Host;
pub use line_service::{Attached, Common, LineRecord, LineService};
pub use lines::{IsValid, Line, READ_BYTES, Senders, same_device};
pub use open_error::{OpenError, OpenErrorKind};
#[cfg(target_os = "linux")]
pub use probe::{Answer, probe};
pub use status::{LineHistory, Phase, Status, StatusQueue};
pub use supervisor::{Connection, Supervisor};
pub use wake::{System, Threads, Waker};
