//! headrace's dive logs, the drive that feeds a loop from a log or a scene, and the simulator.

mod clocks;
pub mod drive;
pub mod import;
pub mod log;
#[cfg(feature = "mesh")]
pub mod mesh;
pub mod playback;
pub mod player;
pub mod record;
pub mod simulate;
pub mod smooth;
pub mod snapshot_store;
pub mod verify;
pub mod view;
