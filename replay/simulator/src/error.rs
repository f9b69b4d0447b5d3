//! Errors that prevent a simulation.

use headrace_config::ConfigErrors;

/// An error in a scene.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// Error in keys of the scene or of its vehicle file.
    #[error(transparent)]
    Config(#[from] ConfigErrors),
    /// The trajectory leads through an obstacle.
    #[error(
        "simulating the trajectory: after {after_s:.1} s, at chainage {chainage_m:.2} m, y {y_m:.2} m, z {z_m:.2} m, it leads \
         through {what}"
    )]
    Blocked {
        /// Seconds after the start.
        after_s: f64,
        /// Chainage, m.
        chainage_m: f64,
        /// Left of the axis, m.
        y_m: f64,
        /// Above the floor, m.
        z_m: f64,
        /// The obstacle.
        what: String,
    },
    /// An effect that is inconsistent with the scene.
    #[error("simulating {effect}: it {problem}")]
    Effect {
        /// Its name.
        effect: &'static str,
        /// The inconsistency, as text.
        problem: String,
    },
}
