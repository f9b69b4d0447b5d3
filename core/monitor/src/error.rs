//! Errors of building a loop.

/// Reason for which a plugin could not be added.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PluginError {
    /// Two sources have the same id.
    #[error("adding source {id:?}: a source of that id is registered already; ids must differ")]
    DuplicateSource {
        /// The id.
        id: String,
    },
    /// The id is reserved for the operator's input.
    #[error("adding source {id:?}: that is the id of the operator's input; choose another one")]
    ReservedSource {
        /// The id.
        id: String,
    },
    /// A required source is missing.
    #[error(
        "arming the loop: water.sound_speed_from = {id:?}: no source has that id; name one of the sources"
    )]
    MissingSource {
        /// The id.
        id: String,
    },
    /// More sources than the loop's tables hold.
    #[error("adding source {id:?}: at most {max} sources are allowed; remove one")]
    TooManySources {
        /// The id.
        id: String,
        /// The limit.
        max: usize,
    },
    /// More heads than the loop's tables hold.
    #[error("arming the loop: {count} heads; at most {max} are allowed; remove some")]
    TooManyHeads {
        /// Heads registered.
        count: usize,
        /// The limit.
        max: usize,
    },
    /// A declared opening can't be added to the sample store.
    #[error("arming the loop: opening {name:?}: {why}")]
    Opening {
        /// The opening.
        name: String,
        /// Problem with the opening.
        why: String,
    },
    /// The schedule of systems can't be built.
    #[error("arming the loop: {why}")]
    Schedule {
        /// The scheduler's error.
        why: String,
    },
}
