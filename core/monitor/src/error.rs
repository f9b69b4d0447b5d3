//! Errors of building a loop.

/// Why a plugin could not be added.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PluginError {
    /// Two sources have one id.
    #[error("adding source {id:?}: a source of that id is registered already; ids must differ")]
    DuplicateSource {
        /// The id.
        id: String,
    },
    /// The id of the operator's input.
    #[error("adding source {id:?}: that is the id of the operator's input; choose another one")]
    ReservedSource {
        /// The id.
        id: String,
    },
    /// A required source is missing.
    #[error("arming the loop: water.sound_speed_from = {id:?}: there is no such source")]
    MissingSource {
        /// The id.
        id: String,
    },
    /// More sources than the loop's tables hold.
    #[error("adding source {id:?}: there are {max} sources already, which is the most")]
    TooManySources {
        /// The id.
        id: String,
        /// The limit.
        max: usize,
    },
    /// More heads than the loop's tables hold.
    #[error("arming the loop: {count} heads; the most is {max}")]
    TooManyHeads {
        /// Heads registered.
        count: usize,
        /// The limit.
        max: usize,
    },
    /// A declared opening can't be laid out.
    #[error("arming the loop: opening {name:?}: {why}")]
    Opening {
        /// The opening.
        name: String,
        /// What is wrong with it.
        why: String,
    },
    /// The schedule of systems can't be built.
    #[error("arming the loop: {why}")]
    Schedule {
        /// The scheduler's error.
        why: String,
    },
}
