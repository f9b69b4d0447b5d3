//! State of the dive that isn't tied to one sensor: tunnel, target, coverage of the wall, and counts.

use bevy_ecs::prelude::Resource;
use serde::{Deserialize, Serialize};

use super::result_stream::ResultStream;
use headrace_coverage::{
    Frontier, HoleFinder, Metres, MissingSamples, OtherSettings, Reach, SampleStore, Sections, Soundings,
    Stretch, WallLimits,
};
use headrace_fusion::NoFix;
use headrace_geometry::frames::{Mount, Pose, Vec3};
use headrace_geometry::math;
use headrace_geometry::site::Site;
use headrace_geometry::snapshot::{Restorer, Saver, SnapshotError, Stateful, stateful};
use headrace_geometry::time::MonoNs;
use headrace_geometry::tunnel::Profile;
use headrace_sampling::Target;
use headrace_sampling::layout::HeadLayout;

/// The tunnel as designed, and the water in it.
#[derive(Debug, Clone, Resource)]
pub struct TunnelDesign {
    /// Design profile of the tunnel's cross-section.
    pub profile: Profile,
    /// Water properties, gravity and water level of the site.
    pub site: Site,
    /// Length of the tunnel, m.
    pub length_m: f64,
    /// Deviation from the design profile beyond which a sample contradicts the profile, m.
    pub contradiction_m: f64,
    /// Limits for accepting returns as wall.
    pub limits: WallLimits,
}

impl TunnelDesign {
    /// Range of chainages that a head's beams reach.
    ///
    /// The samples lie in the plane across the head's axis. If the head is tilted, this plane extends over some
    /// chainage.
    pub(crate) fn reach(&self, pose: &Pose, mount: &Mount) -> Reach {
        let origin = pose.place(mount.position);
        let axis = pose.attitude * (mount.rotation * Vec3::new(1.0, 0.0, 0.0));
        let across = math::hypot(axis.y(), axis.z());
        let spread_m = if across > 0.0 {
            let leaning = [axis.y() / across, axis.z() / across];
            let across = across.min(0.99);
            let slope = across / math::sqrt(1.0 - across * across);
            slope * self.profile.farthest_along_m([origin.y(), origin.z()], leaning)
        } else {
            0.0
        };
        Reach { from_m: origin.x() - spread_m, to_m: origin.x() + spread_m }
    }
}

/// Target and settings by which the driving of a dive is judged.
#[derive(Debug, Clone, Copy, Resource)]
pub struct Plan {
    /// Coverage target, with the confidence of verdicts.
    pub target: Target,
    /// Arrangement of the heads: phase-shift or sector-offset mode.
    pub layout: HeadLayout,
    /// Speed for which the heads are set in phase, m/s; zero if none is planned.
    pub planned_speed_mps: f64,
    /// Predicted effect of alternative head settings.
    pub(super) other: OtherSettings,
}

/// Coverage of the wall: the samples, the verdicts, and the data from which the verdicts are formed.
#[derive(Debug, Resource)]
pub struct Coverage {
    /// Samples on the wall.
    pub store: SampleStore,
    /// Sections of the tunnel with their verdicts.
    pub sections: Sections,
    /// Chainages at which samples of the present course may still land.
    pub frontier: Frontier,
    /// Samples by node of a square grid.
    pub soundings: Soundings,
    /// Last judged stretch without a verdict.
    pub unsure: Option<Stretch>,
    /// Most recent missing samples: points where a sample was expected but not obtained.
    pub missing_samples: MissingSamples,
}

impl Coverage {
    /// Length of each verdict within the coverage extent.
    pub fn metres(&self) -> Metres {
        self.sections.metres(self.frontier.way())
    }
}

stateful!(Coverage { state: store, sections, frontier, soundings, unsure, missing_samples; });

/// Hole search, with its working memory.
#[derive(Debug, Default, Resource)]
pub struct Finder(pub HoleFinder);

impl Stateful for Finder {
    fn save(&self, to: &mut Saver) {
        self.0.save(to);
    }

    fn restore(&mut self, from: &mut Restorer<'_>) -> Result<(), SnapshotError> {
        self.0.restore(from)
    }
}

/// Result streams of the surveyor.
#[derive(Debug, Default, Resource)]
pub struct Digests {
    /// Result stream of the georeferenced pings.
    pub pings: ResultStream,
    /// Result stream of the section judgements.
    pub judgements: ResultStream,
}

stateful!(Digests { state: pings, judgements; });

impl Digests {
    pub(super) fn next_tick(&mut self) {
        self.pings.next_tick();
        self.judgements.next_tick();
    }
}

/// Counts of pings over the whole dive.
#[derive(Debug, Clone, Copy, PartialEq, Default, Resource, Serialize, Deserialize)]
pub struct Tally {
    /// Number of samples on the wall.
    pub samples: u64,
    /// Number of pings without a return although the wall was within range. Without a fix, the range is not checked.
    pub missing: u64,
    /// Number of pings without a return because the wall was out of range.
    pub out_of_range: u64,
    /// Number of pings that the vehicle occluded.
    pub occluded: u64,
    /// Number of returns without a fix.
    pub unplaced: u64,
    /// Number of returns without a fix by reason, in the order of [`NoFix::ALL`].
    pub no_fix: [u64; NoFix::ALL.len()],
    /// Number of pings without a fix, with or without a return.
    pub without_fix: u64,
    /// Number of samples outside the sample store's extent.
    pub outside: u64,
    /// Number of samples not stored for lack of room.
    pub not_stored: u64,
    /// Number of returns that were not accepted as wall.
    pub doubtful: u64,
}

/// Number and end time of the current tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct TickTime {
    /// Number of the tick, from zero.
    pub index: u64,
    /// End time of the tick.
    pub now: MonoNs,
}
