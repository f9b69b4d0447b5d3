//! How a missed stretch is to be passed again.

use serde::{Deserialize, Serialize};

use super::cause::Cause;
use super::causes::Causes;

/// How fast to pass again what was missed, and whether that helps.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Again {
    /// Largest speed that meets the target in all that a speed mends, m/s; zero where most is mended by none.
    pub at_most_mps: f64,
    /// Returns are missing for which no speed makes up, in a tenth of it or more.
    pub is_beyond_speed: bool,
}

/// Of failed sections, one of so many is named.
pub(super) const NAMED_OF: u32 = 10;

/// A failed section.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Failing {
    /// What it was put down to.
    pub causes: Causes,
    /// The speed that meets the target there, m/s; zero where none does.
    pub again_mps: f64,
}

/// Failed sections, counted by how they are to be passed again.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Tally {
    /// Those that a speed mends, and the lowest such speed, m/s.
    mended: u32,
    least_mps: f64,
    /// Those that lack returns for which no speed makes up.
    beyond: u32,
}

impl Again {
    /// Of a single section.
    pub fn of(section: &Failing) -> Self {
        let mut tally = Tally::default();
        tally.add(section);
        tally.again(1)
    }
}

impl Failing {
    fn is_mended(&self) -> bool {
        self.again_mps > 0.0
    }

    fn is_beyond(&self) -> bool {
        !self.is_mended() && self.causes.has(Cause::MissingReturns)
    }
}

impl Tally {
    pub(super) fn add(&mut self, section: &Failing) {
        if section.is_mended() {
            let is_least = self.mended == 0 || section.again_mps < self.least_mps;
            self.least_mps = if is_least { section.again_mps } else { self.least_mps };
            self.mended += 1;
        }
        self.beyond += u32::from(section.is_beyond());
    }

    /// Takes one out; true if it may have been the only one with the lowest speed, which has to be found anew.
    pub(super) fn remove(&mut self, section: &Failing) -> bool {
        self.mended = self.mended.saturating_sub(u32::from(section.is_mended()));
        self.beyond = self.beyond.saturating_sub(u32::from(section.is_beyond()));
        section.is_mended() && section.again_mps <= self.least_mps
    }

    /// Whether a section's speed is the lowest.
    pub(super) fn is_least(&self, section: &Failing) -> bool {
        section.is_mended() && section.again_mps <= self.least_mps
    }

    pub(super) fn join(&mut self, other: &Self) {
        self.least_mps = match (self.mended, other.mended) {
            (_, 0) => self.least_mps,
            (0, _) => other.least_mps,
            _ => self.least_mps.min(other.least_mps),
        };
        self.mended += other.mended;
        self.beyond += other.beyond;
    }

    /// How to pass again so many sections that were counted.
    pub(super) fn again(&self, failed: u32) -> Again {
        Again {
            at_most_mps: if self.mended > 0 && 2 * self.mended >= failed { self.least_mps } else { 0.0 },
            is_beyond_speed: self.beyond > 0 && NAMED_OF * self.beyond >= failed,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn section(cause: Cause, again_mps: f64) -> Failing {
        Failing { causes: Causes::of(cause), again_mps }
    }

    fn again(sections: &[Failing]) -> Again {
        let mut tally = Tally::default();
        for section in sections {
            tally.add(section);
        }
        tally.again(u32::try_from(sections.len()).unwrap())
    }

    #[test]
    fn the_slowest_of_what_a_speed_mends_is_told_where_that_is_half_of_it() {
        let fast = [section(Cause::TooFast, 0.12), section(Cause::TooFast, 0.1)];
        assert_eq!(again(&fast), Again { at_most_mps: 0.1, is_beyond_speed: false });
        let lost = section(Cause::MissingReturns, 0.0);
        assert_eq!(again(&[fast[0], lost]), Again { at_most_mps: 0.12, is_beyond_speed: true });
        assert_eq!(again(&[fast[0], lost, lost]), Again { at_most_mps: 0.0, is_beyond_speed: true });
        // In a mode in which no speed meets the target it isn't for want of returns.
        let coarse = section(Cause::AngularStep, 0.0);
        assert_eq!(again(&[coarse; 3]), Again::default());
        // One of twelve isn't what is the matter.
        let mut many = [fast[1]; 12];
        many[3] = lost;
        assert_eq!(again(&many), Again { at_most_mps: 0.1, is_beyond_speed: false });
        assert_eq!(again(&[]), Again::default());
    }
}
