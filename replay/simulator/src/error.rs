//! Why a scene can't be simulated.

use headrace_config::ConfigError;

/// What is wrong with a scene.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// A key of the scene or of its vehicle file.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The trajectory leads through something.
    #[error(
        "simulating the trajectory: after {after_s:.1} s, at chainage {chainage_m:.2} m, y {y_m:.2} m, z {z_m:.2} m, it leads \
         through {what}"
    )]
    Blocked {
        /// Seconds after the start.
        after_s: f64,
        /// Where: chainage, left, up, m.
        chainage_m: f64,
        /// Left of the axis.
        y_m: f64,
        /// Above the floor.
        z_m: f64,
        /// What is there.
        what: String,
    },
    /// An effect that contradicts the rest.
    #[error("simulating {effect}: it {problem}")]
    Effect {
        /// Its name.
        effect: &'static str,
        /// What is wrong.
        problem: String,
    },
}
