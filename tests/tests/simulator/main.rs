//! The simulator: scenes, effects, boulders and meshes.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a failed step ends the test")]

mod advised;
mod boulders;
mod effects;
mod instructed;
#[cfg(feature = "mesh")]
mod mesh_scene;
mod scenes;
