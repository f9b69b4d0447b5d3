//! Errors of computing a perimeter.

/// A perimeter can't be computed.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PerimeterError {
    /// Too few angles with an echo around the turn.
    #[error("a perimeter needs echoes at 3 angles or more; there are {count}")]
    TooFewPings {
        /// Angles with an echo.
        count: usize,
    },
    /// A setting is out of range.
    #[error("{setting} is {value}; expected {wanted}")]
    Setting {
        /// The setting's name.
        setting: &'static str,
        /// Its value.
        value: f64,
        /// Allowed values.
        wanted: &'static str,
    },
    /// The skeleton doesn't close around the head; a longer pulse or more dilation would close it.
    #[error("the wall's skeleton does not close round the head")]
    NotClosed,
    /// The skeleton still has a fork after pruning and thinning.
    #[error("the wall's skeleton forks at {forks} pixels")]
    Forked {
        /// Pixels with other than two neighbours.
        forks: usize,
    },
}
