//! headrace's dive logs, the drive that feeds a loop from a log or a scene, and the simulator.

pub mod drive;
pub mod import;
pub mod log;
#[cfg(feature = "mesh")]
pub mod mesh;
pub mod player;
pub mod record;
pub mod simulate;
pub mod smooth;
pub mod verify;
pub mod view;
