//! Context of the filter in one dive: the design, the site and the settings.

use super::setting_check::Design;
use super::settings::Settings;
use headrace_geometry::frames::{Body, Vec3};
use headrace_geometry::site::Site;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::tunnel::Profile;

/// Design, site and settings of a dive.
#[derive(Debug, Clone)]
pub struct Context {
    /// Design profile of the tunnel.
    pub profile: Profile,
    /// Water and location of the tunnel.
    pub site: Site,
    /// Noise settings of the sensors.
    pub settings: Settings,
    /// Position of the inertial unit on the vehicle.
    pub unit_at: Vec3<Body>,
}

impl Context {
    /// Returns the design, the site and the settings, from which wrong settings are detected.
    pub(super) fn design(&self) -> Design<'_> {
        let Self { profile, site, settings, unit_at } = self;
        Design { profile, site, settings, unit_at: *unit_at }
    }
}

stateful!(Context { state: unit_at; fixed: profile, site, settings; });
