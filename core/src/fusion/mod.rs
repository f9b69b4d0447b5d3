//! Where the vehicle is: the seam behind which navigation stands, and the ways of navigating.

pub mod direct;

use crate::app::reading::Reading;
use crate::frames::{Mount, Pose};
use crate::time::MonoNs;

/// A sensor as navigation knows it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorInfo {
    /// How it sits on the vehicle.
    pub mount: Mount,
    /// What it is.
    pub kind: SensorKind,
}

/// Kinds of sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SensorKind {
    /// A profiling head.
    Head,
    /// An echosounder; readings of less confidence are not used.
    Echosounder {
        /// Least confidence, 0 to 1.
        min_confidence: f64,
    },
    /// A pressure sensor.
    Depth,
    /// An inertial unit.
    Imu,
    /// A cable counter.
    Tether {
        /// Chainage where it reads zero, m.
        zero_at_m: f64,
        /// Metres of chainage for a metre of cable.
        scale: f64,
    },
    /// A source that navigation has no use for.
    Other,
}

/// Where the vehicle is at a moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fix {
    /// Position and attitude.
    pub pose: Pose,
    /// Speed along the tunnel, m/s, positive inwards.
    pub speed_mps: f64,
    /// Standard deviation of the displacement between two passes of a head a turn apart, m.
    pub relative_sigma_m: f64,
}

/// What a fix lacks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoFix {
    /// No recent attitude.
    Heading,
    /// No recent measure of the way along the tunnel.
    Chainage,
    /// No recent measure of the place in the cross-section.
    Section,
}

impl NoFix {
    /// The word used in reports and logs.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Heading => "no_heading",
            Self::Chainage => "no_chainage",
            Self::Section => "no_place_in_section",
        }
    }
}

/// A way of navigating. Readings come in the order in which they were received; a fix is as of the readings so far.
pub trait Navigation: Send + Sync {
    /// Takes a reading. `source` is the same for all readings of one sensor.
    ///
    /// Allocates: never.
    fn update(&mut self, source: usize, sensor: &SensorInfo, at: MonoNs, reading: &Reading);

    /// Where the vehicle is at `at`, which may be a little before or after the last reading.
    ///
    /// Errors: what is missing.
    fn fix(&self, at: MonoNs) -> Result<Fix, NoFix>;
}
