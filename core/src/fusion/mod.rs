//! Where the vehicle is: the seam behind which navigation stands, and the ways of navigating.

pub mod calibration;
pub mod direct;
pub mod filter;
pub mod relative;
pub mod section;
pub mod smooth;

use serde::{Deserialize, Serialize};

use self::direct::DirectNavigation;
use self::filter::FilterNavigation;
use self::filter::running::Sigmas;
use self::filter::settings::Settings;
use self::filter::sources::Consistency;
use self::relative::Relative;
use crate::app::reading::Reading;
use crate::config::{ConfigError, Section};
use crate::frames::{Mount, Pose};
use crate::site::Site;
use crate::snapshot::Stateful;
use crate::time::MonoNs;
use crate::tunnel::Profile;

/// A sensor as navigation knows it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SensorInfo {
    /// How it sits on the vehicle.
    pub mount: Mount,
    /// What it is.
    pub kind: SensorKind,
}

/// Kinds of sensor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
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
    /// A sonar that measures velocity over ground.
    VelocityLog,
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

/// Which way a vehicle navigates: the `[navigation]` table of its file.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "there is one of it")]
pub enum NavigationConfig {
    /// By the filter.
    Filter(Settings),
    /// Without one.
    Direct,
}

impl NavigationConfig {
    /// Reads the table; without one, a filter with the usual settings.
    ///
    /// Errors: the first key that is unknown or out of range.
    pub fn parse(section: Option<Section<'_>>) -> Result<Self, ConfigError> {
        let Some(section) = section else { return Ok(Self::Filter(Settings::default())) };
        let by_filter = section.choice("way", &[("filter", true), ("direct", false)])?.unwrap_or(true);
        let settings = Settings::parse(&section)?;
        section.finish()?;
        Ok(if by_filter { Self::Filter(settings) } else { Self::Direct })
    }

    /// Navigation that knows nothing yet.
    pub fn begin(&self, profile: &Profile, site: Site) -> Box<dyn Navigation> {
        match self {
            Self::Filter(settings) => Box::new(FilterNavigation::new(profile.clone(), site, *settings)),
            Self::Direct => Box::new(DirectNavigation::new(profile.clone(), site)),
        }
    }
}
