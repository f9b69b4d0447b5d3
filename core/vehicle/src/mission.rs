//! What a dive is for: the tunnel, the target, and how they are judged.

use headrace_geometry::site::Site;
use headrace_geometry::time::DurNs;
use headrace_geometry::tunnel::Profile;
use headrace_sampling::layout::HeadLayout;
use headrace_sampling::occlusion::Obstacle;

use crate::coverage::CoverageConfig;

/// The tunnel and the target that a loop works for.
#[derive(Debug, Clone, PartialEq)]
pub struct Mission {
    /// Design profile.
    pub profile: Profile,
    /// Water, gravity, levels.
    pub site: Site,
    /// The depth sensor whose temperature tells the speed of sound, in place of the site's.
    pub sound_speed_from: Option<String>,
    /// Target T, m.
    pub target_m: f64,
    /// Length of a section, m.
    pub section_m: f64,
    /// Length of the tunnel, m; samples beyond are counted, not kept.
    pub length_m: f64,
    /// How the heads share the work.
    pub layout: HeadLayout,
    /// Parts of the vehicle that may stand in a head's way, besides the other heads.
    pub hull: Vec<Obstacle>,
    /// How the wall is judged, and where there is none.
    pub coverage: CoverageConfig,
    /// How long the dive may take from its first packet; `None` when nobody has said.
    pub dive_time: Option<DurNs>,
}

impl Mission {
    /// A tunnel 100 m long with sections of 0.25 m, at a usual site; phase shift, no hull, exact holes, no end of the
    /// dive.
    pub fn new(profile: Profile, target_m: f64) -> Self {
        Self {
            profile,
            site: Site::default(),
            sound_speed_from: None,
            target_m,
            section_m: 0.25,
            length_m: 100.0,
            layout: HeadLayout::PhaseShift,
            hull: Vec::new(),
            coverage: CoverageConfig::default(),
            dive_time: None,
        }
    }
}
