//! Properties of the site that a view displays, and the names of the view's frames.

use headrace_geometry::tunnel::Profile;
use headrace_monitor::head_descriptions::HeadDescriptions;

/// Names of the coordinate frames.
pub(super) const TUNNEL: &str = "tunnel";
pub(super) const VEHICLE: &str = "vehicle";
pub(super) const WALL: &str = "wall";

/// Properties of the site that a view needs.
#[derive(Debug, Clone)]
pub struct Site {
    /// Design profile of the tunnel.
    pub profile: Profile,
    /// Target T, the largest diameter that a hole in the samples may have, m.
    pub target_m: f64,
    /// Length of a judged section along the tunnel, m.
    pub section_m: f64,
    /// Distance before a missed stretch at which the vehicle turns round to pass it again, m.
    pub run_up_m: f64,
    /// Length of the tunnel, m.
    pub length_m: f64,
    /// Names and possible settings of the heads.
    pub head_descriptions: HeadDescriptions,
    /// Source numbers of the heads.
    pub heads: Vec<u64>,
}
