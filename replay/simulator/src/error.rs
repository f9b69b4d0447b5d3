//! Errors that prevent the simulation of a scene.

use headrace_config::ConfigErrors;

/// Reason why a scene can't be simulated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// An error in keys of the scene or of its vehicle file.
    #[error(transparent)]
    Config(#[from] ConfigErrors),
    /// An obstacle lies on the vehicle's trajectory.
    #[error(
        "simulating the trajectory: after {after_s:.1} s, at chainage {chainage_m:.2} m, y {y_m:.2} m, z {z_m:.2} m, it leads \
         through {what}"
    )]
    Blocked {
        /// Time at which the vehicle meets the obstacle, counted from the dive's start, s.
        after_s: f64,
        /// Chainage of the vehicle when it meets the obstacle, m.
        chainage_m: f64,
        /// Distance of the vehicle to the left of the axis, m.
        y_m: f64,
        /// Height of the vehicle above the floor, m.
        z_m: f64,
        /// Name of the obstacle.
        what: String,
    },
    /// An effect is inconsistent with the rest of the scene.
    #[error("simulating {effect}: it {problem}")]
    Effect {
        /// Name of the effect.
        effect: &'static str,
        /// The inconsistency between effect and scene, as text.
        problem: String,
    },
}
