//! Amount of measurement: a quick check or the full measurement.

/// Amount of measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effort {
    /// Under a minute of CPU: one or two seeds, short dives. The result shows that everything works, and gives orders
    /// of magnitude.
    Quick,
    /// Under ten minutes on two cores, as shown in `docs/why/cost`.
    Full,
}

impl Effort {
    /// Returns `quick` for a quick check, and `full` for the full measurement.
    pub fn pick<T>(self, quick: T, full: T) -> T {
        match self {
            Self::Quick => quick,
            Self::Full => full,
        }
    }

    /// Number of seeds of each scene; they are numbered from 1.
    pub fn seeds(self) -> u32 {
        self.pick(1, 5)
    }

    /// Number of rounds. In each round, every setting is measured once.
    ///
    /// At least six values are needed for a 95 % interval of the median. With three values, the interval is the least
    /// and the largest value.
    pub fn rounds(self) -> u32 {
        self.pick(3, 9)
    }

    /// Length of a dive, m.
    pub fn length_m(self) -> f64 {
        self.pick(6.5, 40.0)
    }
}
