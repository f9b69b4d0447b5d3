//! Why there is no perimeter.

/// Why there is no perimeter.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PerimeterError {
    /// A perimeter needs pings all round.
    #[error("a perimeter needs echoes at 3 angles at least; there are {count}")]
    TooFewPings {
        /// Angles with an echo.
        count: usize,
    },
    /// A setting is out of range.
    #[error("{setting} is {value}; wanted is {wanted}")]
    Setting {
        /// The setting's name.
        setting: &'static str,
        /// What it is.
        value: f64,
        /// What it may be.
        wanted: &'static str,
    },
    /// The skeleton doesn't close round the head; a longer pulse or more growing would.
    #[error("the wall's skeleton does not close round the head")]
    NotClosed,
    /// The skeleton has a fork that pruning and thinning left.
    #[error("the wall's skeleton forks at {forks} pixels")]
    Forked {
        /// Pixels with other than two neighbours.
        forks: usize,
    },
}
