//! A navigation fix, why there may be none, and the times of a reading.

use serde::{Deserialize, Serialize};

use crate::relative::Relative;
use headrace_geometry::frames::Pose;
use headrace_geometry::time::MonoNs;

/// Where the vehicle is at a moment.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Fix {
    /// Position and attitude.
    pub pose: Pose,
    /// Speed along the tunnel, m/s, positive inwards.
    pub speed_mps: f64,
    /// Its errors against those when the heads last passed here.
    pub relative: Relative,
}

/// What a fix lacks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum NoFix {
    /// No recent attitude.
    Heading,
    /// No recent measure of the way along the tunnel.
    Chainage,
    /// No recent measure of the place in the cross-section.
    Section,
}

impl NoFix {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Heading, Self::Chainage, Self::Section];

    /// The word used in reports and logs.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Heading => "no_heading",
            Self::Chainage => "no_chainage",
            Self::Section => "no_place_in_section",
        }
    }
}

/// When a reading came, and when it was valid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Times {
    /// When its first byte came.
    pub received: MonoNs,
    /// The moment that it speaks of.
    pub valid: MonoNs,
}
