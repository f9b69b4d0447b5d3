//! Speed for passing a missed stretch again, and whether a lower speed helps.

use serde::{Deserialize, Serialize};

use super::cause::{Cause, Causes};

/// Speed for passing a missed stretch again, and whether a lower speed helps.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Again {
    /// Largest speed that meets the target in all sections in which any speed meets it, m/s.
    ///
    /// Zero if no speed meets the target in more than half of the sections.
    pub at_most_mps: f64,
    /// Whether at least a tenth of the sections lose too many returns for any speed to make up for them.
    pub is_beyond_speed: bool,
}

/// Reciprocal of a share of a missed stretch's failed sections. A remedy is advised if at least this share needs it.
pub(super) const NAMED_OF: u32 = 10;

/// Causes and required speed of a failed section.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Failing {
    /// Causes of the section's fail.
    pub causes: Causes,
    /// Speed that meets the target in the section, m/s. Zero if no speed does.
    pub again_mps: f64,
}

/// Counts of failed sections by remedy.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Tally {
    /// Number of sections in which some speed meets the target (`mended`), and the lowest of their speeds, m/s.
    mended: u32,
    least_mps: f64,
    /// Number of sections that lose too many returns for any speed to make up for them.
    beyond: u32,
}

impl Again {
    /// Advice for passing a single section again.
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

    /// Removes a section from the counts.
    ///
    /// Returns true if it may have been the only section with the lowest speed. The caller must then find the lowest
    /// speed of the other sections.
    pub(super) fn remove(&mut self, section: &Failing) -> bool {
        let is_counted =
            self.mended >= section.is_mended().into() && self.beyond >= section.is_beyond().into();
        debug_assert!(is_counted, "a removed section was counted: {section:?} in {self:?}");
        self.mended = self.mended.saturating_sub(u32::from(section.is_mended()));
        self.beyond = self.beyond.saturating_sub(u32::from(section.is_beyond()));
        section.is_mended() && section.again_mps <= self.least_mps
    }

    /// Whether these counts can be those of a missed stretch with `failed` failed sections.
    pub(super) fn is_of(&self, failed: u32) -> bool {
        self.mended.checked_add(self.beyond).is_some_and(|counted| counted <= failed)
    }

    /// Whether the section's speed is the lowest one counted, or lower.
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

    /// Advice for passing all counted sections again. `failed` is the number of failed sections.
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
    fn lowest_speed_is_advised_if_slowing_down_helps_half_of_the_sections() {
        let fast = [section(Cause::TooFast, 0.12), section(Cause::TooFast, 0.1)];
        assert_eq!(again(&fast), Again { at_most_mps: 0.1, is_beyond_speed: false });
        let lost = section(Cause::MissingReturns, 0.0);
        assert_eq!(again(&[fast[0], lost]), Again { at_most_mps: 0.12, is_beyond_speed: true });
        assert_eq!(again(&[fast[0], lost, lost]), Again { at_most_mps: 0.0, is_beyond_speed: true });
        // If no speed meets the target in the present scan mode, the angular step is the cause, not the missing
        // returns.
        let coarse = section(Cause::AngularStep, 0.0);
        assert_eq!(again(&[coarse; 3]), Again::default());
        // One section of twelve is less than a tenth, so no remedy is advised for it.
        let mut many = [fast[1]; 12];
        many[3] = lost;
        assert_eq!(again(&many), Again { at_most_mps: 0.1, is_beyond_speed: false });
        assert_eq!(again(&[]), Again::default());
    }
}
