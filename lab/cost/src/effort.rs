//! How much is measured.

/// How much is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effort {
    /// Under a minute of CPU: one or two seeds, short dives. Shows that all works, and orders of magnitude.
    Quick,
    /// Under ten minutes on two cores: what `docs/why/cost` shows.
    Full,
}

impl Effort {
    /// One of two values.
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

    /// Times that every setting is measured, in turns. Six are the fewest of which a median has an interval of 95 %; of three it has their
    /// least and largest.
    pub fn rounds(self) -> u32 {
        self.pick(3, 9)
    }

    /// Length of a dive, m.
    pub fn length_m(self) -> f64 {
        self.pick(6.5, 40.0)
    }
}
