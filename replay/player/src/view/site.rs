//! The site shown, and its frames.

use headrace_geometry::tunnel::Profile;
use headrace_monitor::head_descriptions::HeadDescriptions;

/// Frame names.
pub(super) const TUNNEL: &str = "tunnel";
pub(super) const VEHICLE: &str = "vehicle";
pub(super) const WALL: &str = "wall";

/// Facts about the site that a view needs.
#[derive(Debug, Clone)]
pub struct Site {
    /// Design profile of the tunnel.
    pub profile: Profile,
    /// Target T, m.
    pub target_m: f64,
    /// Length of a section, m.
    pub section_m: f64,
    /// Distance before a missed stretch at which the vehicle should turn round, m.
    pub run_up_m: f64,
    /// Length of the tunnel, m.
    pub length_m: f64,
    /// Names and possible settings of the heads.
    pub head_descriptions: HeadDescriptions,
    /// Numbers of the sources that are heads.
    pub heads: Vec<u64>,
}
