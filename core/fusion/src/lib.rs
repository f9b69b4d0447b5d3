//! Where the vehicle is: the seam behind which navigation stands, and the ways of navigating.

#![cfg_attr(not(test), warn(clippy::cast_possible_truncation))]
#![cfg_attr(test, allow(clippy::cast_possible_truncation))]

pub mod direct;
pub mod filter;
pub mod relative;
pub mod section;
pub mod smooth;

use serde::{Deserialize, Serialize};

use self::filter::running::Sigmas;
use self::filter::sources::Consistency;
use self::relative::Relative;
use headrace_geometry::frames::Pose;
use headrace_geometry::time::MonoNs;
use headrace_sensor::device::SensorInfo;
use headrace_sensor::reading::Reading;
use headrace_snapshot::Stateful;

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

/// A way of navigating. Readings come in the order in which they were received; a fix is as of the readings so far. Its
/// state is all that a fix depends on, so that a snapshot can take it up again.
pub trait Navigation: Stateful + Send + Sync {
    /// Takes a reading. `source` is the same for all readings of one sensor.
    ///
    /// Allocates: never.
    fn update(&mut self, source: usize, sensor: &SensorInfo, times: Times, reading: &Reading);

    /// No reading will come any more.
    fn end(&mut self) {}

    /// How well a source agrees with the others; `None` where that isn't known.
    fn consistency(&self, _source: usize) -> Option<Consistency> {
        None
    }

    /// How far off the estimate may be; `None` where that isn't known.
    fn sigmas(&self) -> Option<Sigmas> {
        None
    }

    /// Where the vehicle is at `at`, which may be a little before or after the last reading.
    ///
    /// Errors: what is missing.
    fn fix(&self, at: MonoNs) -> Result<Fix, NoFix>;
}
