//! Unsure stretches: sections that neither pass nor fail although no more samples will come.

use core::ops::Range;
use serde::{Deserialize, Serialize};

use super::passage::{Drive, Passage};

/// Reason why a section neither passes nor fails although no more samples will come.
///
/// More samples come only if the vehicle turns back.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Unsure {
    /// The coverage extent begins in the section, or the vehicle turned back in it.
    ///
    /// So some heads have not been in the section.
    NotInspected,
    /// Because of position errors, the error of the hole's diameter is larger than its difference from the target.
    Position,
    /// The section has samples of several navigation segments, whose offset is unknown.
    SeveralStretches,
    /// More returns are doubtful than were accepted as wall, or doubtful returns may fill the hole.
    DoubtfulReturns,
    /// The section has samples of a head that was distrusted soon after.
    DistrustedHead,
    /// The section's samples contradict the design profile.
    ContradictedProfile,
    /// The section's cross-section area is implausible for the design.
    OtherSize,
    /// All of the section's wall is a declared opening.
    NoWall,
}

impl Unsure {
    /// All reasons for which a section can be unsure.
    pub const ALL: [Self; 8] = [
        Self::NotInspected,
        Self::Position,
        Self::SeveralStretches,
        Self::DoubtfulReturns,
        Self::DistrustedHead,
        Self::ContradictedProfile,
        Self::OtherSize,
        Self::NoWall,
    ];

    /// Word used for the reason in reports and logs.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::NotInspected => "not_inspected",
            Self::Position => "position",
            Self::SeveralStretches => "several_stretches",
            Self::DoubtfulReturns => "doubtful_returns",
            Self::DistrustedHead => "distrusted_head",
            Self::ContradictedProfile => "contradicted_profile",
            Self::OtherSize => "other_size",
            Self::NoWall => "no_wall",
        }
    }
}

/// Neighbouring sections that are unsure for the same reason.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Stretch {
    /// Reason why the sections of the stretch are unsure.
    pub why: Unsure,
    /// Index of the stretch's first section.
    pub from: i64,
    /// Index after the stretch's last section.
    pub to: i64,
    /// The stretch's sections, in two groups.
    ///
    /// Those of the first group are unsure mainly because of the size of their hole. Those of the second group are
    /// unsure mainly because of its error.
    of: [Largest; 2],
}

/// A group of unsure sections: their number, and the figures of the section with the largest hole.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Largest {
    /// Number of sections in the group.
    pub sections: u32,
    /// Diameter of the group's largest hole, and standard deviation of this diameter, m.
    pub hole_m: [f64; 2],
    /// Driving figures of the section with the largest hole.
    pub driven: Driven,
}

/// Speed at which a section was driven, and the largest speed that meets the target there.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Driven {
    /// Speed along the tunnel, m/s. Zero if no head passed.
    pub speed_mps: f64,
    /// Largest speed that meets the target with all heads turning as scheduled, m/s. Zero if no speed does.
    pub fits_mps: f64,
    /// Whether the heads pass unevenly at this speed, even at their scheduled angles. They are then at different places
    /// along the hull, and so are out of phase.
    pub is_uneven: bool,
    /// Whether some heads were silent or detected no wall. The speeds nevertheless assume that all heads work.
    pub is_short: bool,
}

/// Ratio of the longest time between passes to that between evenly spread passes above which passes are uneven.
const UNEVEN: f64 = 1.05;

impl Driven {
    /// Returns the driving figures of the passage through a section.
    pub fn of(passage: &Passage) -> Self {
        let Drive { speed_mps, passes_needed, planned_gap_s, all_gap_s, .. } = passage.drive;
        Self {
            speed_mps,
            fits_mps: passage.drive.with_losses_mps(passes_needed),
            is_uneven: planned_gap_s > UNEVEN * all_gap_s,
            is_short: !passage.silent.is_empty(),
        }
    }
}

/// Ratio of the hole's error to its diameter above which the error, not the size, is the main reason for a section to
/// be unsure.
const MOSTLY_ERROR: f64 = 0.2;
/// Maximum gap between sections of one unsure stretch, m.
///
/// A vehicle that repeats one section also passes the sections within this distance.
const JOIN_M: f64 = 2.0;

impl Stretch {
    /// Creates an unsure stretch from one section.
    ///
    /// The figures are the diameter of the section's hole, its error, and its standard deviation, m.
    pub fn one(why: Unsure, index: i64, [hole_m, error_m, sd_m]: [f64; 3], driven: Driven) -> Self {
        let section = Largest { sections: 1, hole_m: [hole_m, sd_m], driven };
        let is_error = error_m > MOSTLY_ERROR * hole_m;
        let of = if is_error { [Largest::default(), section] } else { [section, Largest::default()] };
        Self { why, from: index, to: index + 1, of }
    }

    /// Number of the stretch's sections that neither pass nor fail.
    pub fn sections(&self) -> u32 {
        self.of.iter().map(|of| of.sections).sum()
    }

    /// Whether most of the stretch's sections are unsure because of the error of their hole, rather than its size.
    pub fn is_mostly_error(&self) -> bool {
        self.of[1].sections > self.of[0].sections
    }

    /// Returns the figures that represent the stretch. They are those of the largest hole in the larger group of
    /// sections.
    pub fn largest(&self) -> &Largest {
        &self.of[usize::from(self.is_mostly_error())]
    }

    /// Whether `sections` are too far away to belong to this unsure stretch.
    pub fn is_beyond(&self, sections: Range<i64>, section_m: f64) -> bool {
        let apart = (sections.start - self.to).max(self.from - sections.end);
        apart as f64 * section_m > JOIN_M + 1e-9
    }

    /// Adds another stretch to this one. Returns false if it has another reason, or is too far away.
    #[must_use]
    pub fn join(&mut self, other: &Self, section_m: f64) -> bool {
        if self.why != other.why || self.is_beyond(other.from..other.to, section_m) {
            return false;
        }
        (self.from, self.to) = (self.from.min(other.from), self.to.max(other.to));
        for (mine, other) in self.of.iter_mut().zip(&other.of) {
            let sections = mine.sections + other.sections;
            if other.hole_m[0] > mine.hole_m[0] {
                *mine = *other;
            }
            mine.sections = sections;
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(why: Unsure, section: i64, hole_m: f64) -> Stretch {
        let driven = Driven { speed_mps: hole_m, ..Driven::default() };
        Stretch::one(why, section, [hole_m, 0.1 * hole_m, 0.05 * hole_m], driven)
    }

    #[test]
    fn unsure_neighbours_within_2_m_are_one_stretch() {
        let mut stretch = one(Unsure::Position, 10, 0.4);
        assert!(stretch.join(&one(Unsure::Position, 11, 0.6), 0.25));
        assert!(stretch.join(&one(Unsure::Position, 1, 0.5), 0.25), "eight sections lie between them");
        assert!(!stretch.join(&one(Unsure::Position, 21, 0.5), 0.25), "nine sections lie between them");
        assert!(!stretch.is_beyond(20..21, 0.25) && stretch.is_beyond(21..22, 0.25));
        assert!(!stretch.is_beyond(-8..-7, 0.25) && stretch.is_beyond(-9..-8, 0.25));
        assert!(!stretch.join(&one(Unsure::DoubtfulReturns, 12, 0.5), 0.25), "another reason");
        assert_eq!((stretch.from, stretch.to, stretch.sections()), (1, 12, 3));
        let largest = Largest { sections: 3, ..*one(Unsure::Position, 11, 0.6).largest() };
        assert_eq!(*stretch.largest(), largest);
    }

    /// A single section with a large error does not represent its stretch, whatever the size of its hole.
    #[test]
    fn single_section_with_a_large_error_does_not_set_the_figures_of_its_stretch() {
        let lost = |section| Stretch::one(Unsure::Position, section, [0.9, 1.4, 0.7], Driven::default());
        let mut stretch = lost(0);
        assert!(stretch.is_mostly_error());
        let third =
            |hole_m: f64| Stretch::one(Unsure::Position, 0, [hole_m, 0.3 * hole_m, 0.1], Driven::default());
        assert!(
            third(1.0).is_mostly_error() && third(0.2).is_mostly_error(),
            "whatever the size of the hole"
        );
        assert!(stretch.join(&one(Unsure::Position, 1, 0.5), 0.25));
        assert!(stretch.join(&one(Unsure::Position, 2, 0.49), 0.25));
        assert!(!stretch.is_mostly_error());
        assert_eq!(stretch.sections(), 3);
        let largest = Largest { sections: 2, ..*one(Unsure::Position, 1, 0.5).largest() };
        assert_eq!(*stretch.largest(), largest);
        assert!(stretch.join(&lost(3), 0.25) && stretch.join(&lost(4), 0.25));
        assert!(stretch.is_mostly_error() && stretch.sections() == 5);
    }
}
