//! The simulator turns a scene into the bytes that its devices would send.
//!
//! Only the effects that a scene names or implies are simulated. Without effects a device is ideal except for its wire
//! format's resolution.

mod adviser;
mod builder;
mod calls;
pub mod calm;
mod clock;
pub mod effects;
pub mod environment;
mod error;
mod facts;
mod files;
#[cfg(feature = "mesh")]
pub mod mesh;
mod motion;
mod notes;
mod outbox;
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
mod told;
pub mod trajectory;
mod truth;

pub use adviser::Adviser;
pub use builder::Added;
pub use calls::{Called, Fate, Take};
pub use clock::START;
pub use error::SceneError;
pub use facts::{Facts, SensorFacts};
pub use files::FileLoader;
pub use outbox::Message;
pub use scene::Scene;
pub use sensing::Scenery;
pub use simulation::Simulation;
pub use stages::Stage;
pub use told::Told;
pub use trajectory::{Leg, Trajectory};
pub use truth::{Cause, SoundingTruth, TruthRow};
