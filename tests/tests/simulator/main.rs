//! The simulator: scenes, effects, boulders and meshes.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test stops at what it can't do")]

mod advised;
mod boulders;
mod effects;
#[cfg(feature = "mesh")]
mod mesh_scene;
mod scenes;
