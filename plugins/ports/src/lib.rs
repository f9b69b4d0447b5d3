//! What the drivers of all devices share: the clock, lines of every carrier, and the life of a line: opened, read with stamps,
//! lost, and opened again. Also what is plugged in, what keeps us from it, and what answers there.
//!
//! The drivers themselves are in the devices' crates and do no I/O; see [`headrace_sensor::driver`].

mod clock;
mod crew;
mod diagnosis;
mod discover;
mod lines;
mod probe;
mod remedy;
mod service;
mod stand;
mod status;
mod trouble;
pub mod uhid;

pub use clock::{clock_anchor, now, of_wall};
pub use crew::{Crew, Hand};
pub use discover::can::is_interface_up;
pub use discover::{Found, Machine, Presence, Rights, User, discover, presence};
#[cfg(target_os = "linux")]
pub use probe::{Answer, probe};
pub use service::SentSink;
pub use stand::{Stand, wait_for_any};
pub use status::{Board, LineHistory, Phase, Status};
pub use trouble::{Trouble, TroubleKind};
