//! The simulator turns a scene into the bytes that its devices would send.
//!
//! Only the effects that a scene names or implies are simulated. Without effects a device is ideal except for its wire
//! format's resolution.

mod builder;
mod clock;
pub mod effects;
pub mod environment;
mod error;
mod facts;
mod file_loader;
mod implied_effects;
#[cfg(feature = "mesh")]
pub mod mesh;
mod motion;
mod notes;
mod outbox;
pub mod position_error_model;
mod random;
mod scene;
mod sensing;
mod simulation;
mod stages;
mod stretch;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod testing_motion;
pub mod trajectory;
mod truth;

pub use builder::Added;
pub use clock::START;
pub use error::SceneError;
pub use facts::{Facts, SensorFacts};
pub use file_loader::FileLoader;
pub use implied_effects::{Called, Fate, Take};
pub use outbox::Message;
pub use scene::Scene;
pub use sensing::Scenery;
pub use simulation::{Adviser, Simulation};
pub use stages::Stage;
pub use trajectory::{Leg, PilotAdvice, Trajectory};
pub use truth::{Cause, SoundingTruth, TruthRow};
