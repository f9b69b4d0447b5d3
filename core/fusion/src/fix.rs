//! Navigation fix, the part that is missing if there is no fix, and the timestamps of a reading.

use serde::{Deserialize, Serialize};

use crate::relative::Relative;
use headrace_geometry::frames::Pose;
use headrace_geometry::time::MonoNs;

/// Pose of the vehicle at one time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Fix {
    /// Position and attitude of the vehicle.
    pub pose: Pose,
    /// Speed along the tunnel, m/s, positive inwards.
    pub speed_mps: f64,
    /// Error covariance relative to the previous pass of the heads over this position.
    pub relative: Relative,
    /// Error covariance relative to a much earlier visit to this position in the same navigation segment.
    pub revisit: Relative,
    /// Number of the navigation segment. Positions of soundings relative to each other are known within a segment, but
    /// not between segments.
    pub tie: u32,
    /// Number of times the estimate has become much more certain while it settled.
    ///
    /// Soundings from before such a change have larger errors, which `relative` does not include.
    pub settled: u32,
}

/// Part of a fix that is missing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum NoFix {
    /// No recent attitude, or yaw is too uncertain.
    Heading,
    /// No recent chainage, or it is too uncertain.
    Chainage,
    /// No recent position in the cross-section, or it is too uncertain.
    Section,
}

impl NoFix {
    /// All parts of a fix that can be missing.
    pub const ALL: [Self; 3] = [Self::Heading, Self::Chainage, Self::Section];

    /// Name of the missing part in reports and logs.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Heading => "no_heading",
            Self::Chainage => "no_chainage",
            Self::Section => "no_place_in_section",
        }
    }
}

/// Receive time and time of validity of a reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Times {
    /// Receive time of the reading's first byte.
    pub received: MonoNs,
    /// Time of validity of the reading.
    pub valid: MonoNs,
}
