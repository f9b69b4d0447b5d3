//! Stretches of which neither a pass nor a fail can be told, though nothing more will come: why, and how far they go.

use serde::{Deserialize, Serialize};

use super::frontier::Reach;
use super::sections::Sections;

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
            self.hole_m = other.hole_m;
        }
        true
    }
}

impl Sections {
    /// A section as a stretch of its own; `None` where it isn't unsure.
    pub fn unsure(&self, index: i64) -> Option<Stretch> {
        let section = self.get(index)?;
        let hole_m = section.hole.map_or(0.0, |hole| hole.diameter_m);
        let (from, to) = (index, index + 1);
        Some(Stretch { why: section.unsure()?, from, to, sections: 1, hole_m: [hole_m, section.hole_sd_m] })
    }

    /// The unsure stretches of the way, in order. Allocates: for the end of a dive.
    pub fn unsure_stretches(&self, way: Option<Reach>) -> Vec<Stretch> {
        let mut all: Vec<Stretch> = Vec::new();
        for stretch in self.sections_of(way).filter_map(|index| self.unsure(index)) {
            if !all.last_mut().is_some_and(|last| last.join(&stretch, self.section_m())) {
                all.push(stretch);
            }
        }
        all
    }
}
