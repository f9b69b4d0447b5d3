//! Configuration of the filter for one dive.

use super::settings::Settings;
use super::suspicion::Design;
use headrace_geometry::frames::{Body, Vec3};
use headrace_geometry::site::Site;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::tunnel::Profile;

/// Configuration of a dive.
#[derive(Debug, Clone)]
pub struct Context {
    /// Design profile.
    pub profile: Profile,
    /// Water and location.
    pub site: Site,
    /// Noise settings of the sensors.
    pub settings: Settings,
    /// Position of the inertial unit on the vehicle.
    pub unit_at: Vec3<Body>,
}

impl Context {
    /// Returns the part that settings are checked against.
    pub(super) fn design(&self) -> Design<'_> {
        let Self { profile, site, settings, unit_at } = self;
        Design { profile, site, settings, unit_at: *unit_at }
    }
}

stateful!(Context { state: unit_at; fixed: profile, site, settings; });
