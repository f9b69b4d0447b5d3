//! What the drivers of all devices share: the clock, lines of every carrier, and the life of a line: opened, read with stamps,
//! lost, and opened again. Also what is plugged in, what keeps us from it, and what answers there.
//!
//! The drivers themselves are in the devices' crates and do no I/O; see [`headrace_sensor::driver`].

mod clock;
mod device_end;
mod diagnosis;
mod discover;
mod fix_hint;
mod line_thread;
mod lines;
mod open_error;
mod probe;
mod status;
mod supervisor;
pub mod uhid;

pub use clock::{clock_anchor, now, of_wall};
pub use device_end::{EmulatedPort, wait_for_any};
pub use discover::can::is_interface_up;
pub use discover::{Found, Machine, Presence, Rights, User, discover, presence};
pub use line_thread::SentSink;
pub use open_error::{OpenError, OpenErrorKind};
#[cfg(target_os = "linux")]
pub use probe::{Answer, probe};
pub use status::{Board, LineHistory, Phase, Status};
pub use supervisor::{Connection, Supervisor};
