//! Amount of measurement.

/// Amount of measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effort {
    /// Under a minute of CPU: one or two seeds, short dives. It shows that everything works, and orders of magnitude.
    Quick,
    /// Under ten minutes on two cores, as shown in `docs/why/cost`.
    Full,
}

impl Effort {
    /// Picks one of two values.
    pub fn pick<T>(self, quick: T, full: T) -> T {
        match self {
            Self::Quick => quick,
            Self::Full => full,
        }
    }

    /// Seeds of each scene, from 1 on.
    pub fn seeds(self) -> u32 {
        self.pick(1, 5)
    }

    /// Number of times that every setting is measured, in turns.
    ///
    /// Six is the fewest values whose median has a 95 % interval. With three values the interval is the least and the
    /// largest.
    pub fn rounds(self) -> u32 {
        self.pick(3, 9)
    }

    /// Length of a dive, m.
    pub fn length_m(self) -> f64 {
        self.pick(6.5, 40.0)
    }
}
