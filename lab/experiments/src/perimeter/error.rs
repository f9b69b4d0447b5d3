//! Errors of computing a perimeter.

/// A reason why a perimeter can't be computed.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PerimeterError {
    /// Too few angles with an echo around the turn.
    #[error("a perimeter needs echoes at 3 angles or more; there are {count}")]
    TooFewPings {
        /// Number of angles with an echo.
        count: usize,
    },
    /// A setting is out of range.
    #[error("{setting} is {value}; expected {wanted}")]
    Setting {
        /// The setting's name.
        setting: &'static str,
        /// Value of the setting.
        value: f64,
        /// Allowed values.
        wanted: &'static str,
    },
    /// The skeleton doesn't close around the head. A longer pulse or more dilation closes the gaps.
    #[error("the wall's skeleton does not close round the head")]
    NotClosed,
    /// The skeleton still has a fork after pruning and thinning.
    #[error("the wall's skeleton forks at {forks} pixels")]
    Forked {
        /// Number of pixels without exactly two neighbours.
        forks: usize,
    },
}
