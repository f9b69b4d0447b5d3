//! Errors of building a loop.

/// Reason for which a plugin could not be added.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PluginError {
    /// Two sources have the same id.
    #[error("adding source {id:?}: a source of that id is registered already; ids must differ")]
    DuplicateSource {
        /// Id that two sources have.
        id: String,
    },
    /// The id of a source is reserved for the operator's input.
    #[error("adding source {id:?}: that is the id of the operator's input; choose another one")]
    ReservedSource {
        /// Reserved id.
        id: String,
    },
    /// A required source is missing.
    #[error(
        "arming the loop: water.sound_speed_from = {id:?}: no source has that id; name one of the sources"
    )]
    MissingSource {
        /// Id of the missing source.
        id: String,
    },
    /// There are more sources than the loop's tables hold.
    #[error("adding source {id:?}: at most {max} sources are allowed; remove one")]
    TooManySources {
        /// Id of the source that exceeds the limit.
        id: String,
        /// Maximum number of sources.
        max: usize,
    },
    /// There are more heads than the loop's tables hold.
    #[error("arming the loop: {count} heads; at most {max} are allowed; remove some")]
    TooManyHeads {
        /// Number of heads registered.
        count: usize,
        /// Maximum number of heads.
        max: usize,
    },
    /// A declared opening can't be added to the sample store.
    #[error("arming the loop: opening {name:?}: {why}")]
    Opening {
        /// The declared opening.
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
