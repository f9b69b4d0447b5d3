//! Mission of a dive: the tunnel, the target and the verdict parameters.

use headrace_geometry::site::Site;
use headrace_geometry::time::DurNs;
use headrace_geometry::tunnel::Profile;
use headrace_sampling::Target;
use headrace_sampling::advice::Looks;
use headrace_sampling::layout::HeadLayout;
use headrace_sampling::occlusion::Obstacle;

use crate::alerts::{AlertTiming, LimitsConfig};
use crate::coverage::CoverageConfig;

/// Mission parameters of a dive.
#[derive(Debug, Clone, PartialEq)]
pub struct Mission {
    /// Design profile of the tunnel's cross-section.
    pub profile: Profile,
    /// Water properties, gravity and levels of the site.
    pub site: Site,
    /// Depth sensor whose temperature determines the speed of sound, instead of the site's value.
    pub sound_speed_from: Option<String>,
    /// Coverage target, with the confidence of verdicts.
    pub target: Target,
    /// Length of a section, m.
    pub section_m: f64,
    /// Length of the tunnel, m. Samples beyond it are counted but not stored.
    pub length_m: f64,
    /// Arrangement of the heads: phase-shift or sector-offset mode.
    pub layout: HeadLayout,
    /// Speed for which the heads' phases are planned, m/s. Zero if no speed is planned.
    pub planned_speed_mps: f64,
    /// Parts of the vehicle that may occlude a head. Other heads are not listed here.
    pub hull: Vec<Obstacle>,
    /// Verdict parameters and openings of the wall.
    pub coverage: CoverageConfig,
    /// Settings of the rays that locate the wall for the speed advice: the angle between them, and the movement of the
    /// vehicle after which they are cast again.
    pub looks: Looks,
    /// Time limit of the dive, counted from the first packet; `None` if not set.
    pub dive_time: Option<DurNs>,
    /// Delays of alerts by alert class.
    pub alerts: AlertTiming,
    /// Limits of cable length and dive time.
    pub limits: LimitsConfig,
}

impl Mission {
    /// Creates a mission with defaults.
    ///
    /// The tunnel is 100 m long, with sections of 0.25 m, at the default site. The heads are in phase-shift mode. There
    /// are no hull parts and no time limit. Holes are computed exactly.
    pub fn new(profile: Profile, target_m: f64) -> Self {
        let contradiction_m = CoverageConfig::usual_contradiction_m(profile.perimeter_m());
        Self {
            profile,
            site: Site::default(),
            sound_speed_from: None,
            target: Target::new(target_m),
            section_m: 0.25,
            length_m: 100.0,
            layout: HeadLayout::PhaseShift,
            planned_speed_mps: 0.0,
            hull: Vec::new(),
            coverage: CoverageConfig { contradiction_m, ..CoverageConfig::default() },
            looks: Looks::default(),
            dive_time: None,
            alerts: AlertTiming::default(),
            limits: LimitsConfig::default(),
        }
    }

    /// Whether lengths are positive, and speeds, tolerances and confidence aren't negative.
    pub fn is_valid(&self) -> bool {
        let Self { target, section_m, length_m, planned_speed_mps, coverage, .. } = self;
        let Target { max_hole_m, confidence_sd } = target;
        let CoverageConfig { hole_tolerance_m, contradiction_m, node_m, .. } = coverage;
        [max_hole_m, section_m, length_m, contradiction_m, node_m].iter().all(|length_m| **length_m > 0.0)
            && [planned_speed_mps, hole_tolerance_m, confidence_sd].iter().all(|number| **number >= 0.0)
    }

    /// Whether pings hit the same places on the wall under the settings of both missions.
    ///
    /// True if the tunnel, the water, the layout and the hull are the same.
    pub fn places_as(&self, other: &Self) -> bool {
        self.profile == other.profile
            && self.site == other.site
            && self.sound_speed_from == other.sound_speed_from
            && self.layout == other.layout
            && self.hull == other.hull
    }
}
