//! Stretches of which neither a pass nor a fail can be told, though nothing more will come: why, and how far they go.

use serde::{Deserialize, Serialize};

use super::passage::Drive;

/// Why a section has neither passed nor failed, though no more samples will come without turning back.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Unsure {
    /// Where the way begins or turns back: not all heads have been there.
    NotInspected,
    /// The hole is within its error of the target: position isn't known well enough.
    Position,
    /// It holds samples of several stretches of navigation.
    SeveralStretches,
    /// More returns are doubtful than were taken for wall.
    DoubtfulReturns,
    /// It holds samples of a head that wasn't believed soon after.
    DistrustedHead,
    /// Its samples contradict the design profile.
    ContradictedProfile,
    /// Its cross-section can't be the design's.
    OtherSize,
    /// All of its wall is a declared opening.
    NoWall,
}

impl Unsure {
    /// All of them.
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

    /// The word used in reports and logs.
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

/// Neighbouring sections that are unsure for one reason.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Stretch {
    /// Why.
    pub why: Unsure,
    /// Index of the first section.
    pub from: i64,
    /// Index after the last.
    pub to: i64,
    /// How many of the sections between are unsure for this reason.
    pub sections: u32,
    /// Largest hole, and the standard deviation of that hole, m.
    pub hole_m: [f64; 2],
    /// How the section with the largest hole was driven.
    pub driven: Driven,
}

/// How a section was driven, and how it should be.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Driven {
    /// Speed along the tunnel, m/s; zero where nothing passed.
    pub speed_mps: f64,
    /// The largest speed that meets the target, all heads turning as scheduled, m/s; zero where none does.
    pub fits_mps: f64,
    /// At this speed heads at their scheduled angles pass unevenly: those apart along the hull are out of phase.
    pub is_uneven: bool,
}

/// Time between passes over that of evenly spread ones from which they are uneven.
const UNEVEN: f64 = 1.05;

impl Driven {
    /// From how vehicle and heads moved.
    pub fn of(drive: &Drive) -> Self {
        let Drive { speed_mps, fits_mps, planned_gap_s, all_gap_s, .. } = *drive;
        Self { speed_mps, fits_mps, is_uneven: planned_gap_s > UNEVEN * all_gap_s }
    }
}

/// Sections farther apart than this are of different stretches, m.
const JOIN_M: f64 = 0.5;

impl Stretch {
    /// Adds a section; false if it is unsure for another reason, or too far away.
    #[must_use]
    pub fn join(&mut self, other: &Self, section_m: f64) -> bool {
        let apart = (other.from - self.to).max(self.from - other.to);
        if self.why != other.why || apart as f64 * section_m > JOIN_M + 1e-9 {
            return false;
        }
        (self.from, self.to) = (self.from.min(other.from), self.to.max(other.to));
        self.sections += other.sections;
        if other.hole_m[0] > self.hole_m[0] {
            (self.hole_m, self.driven) = (other.hole_m, other.driven);
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(why: Unsure, section: i64, hole_m: f64) -> Stretch {
        let driven = Driven { speed_mps: hole_m, ..Driven::default() };
        Stretch { why, from: section, to: section + 1, sections: 1, hole_m: [hole_m, 0.1], driven }
    }

    #[test]
    fn neighbours_within_half_a_metre_are_one_stretch() {
        let mut stretch = one(Unsure::Position, 10, 0.4);
        assert!(stretch.join(&one(Unsure::Position, 11, 0.6), 0.25));
        assert!(stretch.join(&one(Unsure::Position, 7, 0.5), 0.25), "two sections lie between");
        assert!(!stretch.join(&one(Unsure::Position, 15, 0.5), 0.25), "three");
        assert!(!stretch.join(&one(Unsure::DoubtfulReturns, 12, 0.5), 0.25), "another reason");
        let all = Stretch { from: 7, sections: 3, ..one(Unsure::Position, 11, 0.6) };
        assert_eq!(stretch, all);
    }
}
