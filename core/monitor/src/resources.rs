//! State of the dive that isn't tied to one sensor: tunnel, target, coverage of the wall, and counts.

use bevy_ecs::entity::Entity;
use bevy_ecs::prelude::Resource;
use serde::{Deserialize, Serialize};

use super::result_stream::ResultStream;
use headrace_coverage::{
    Frontier, HoleFinder, MissingSamples, OtherSettings, Relief, SampleStore, Sections, Soundings, Stretch,
    WallLimits,
};
use headrace_fusion::NoFix;
use headrace_geometry::site::Site;
use headrace_geometry::snapshot::{Restorer, Saver, SnapshotError, Stateful, stateful};
use headrace_geometry::time::MonoNs;
use headrace_geometry::tunnel::Profile;
use headrace_sampling::layout::HeadLayout;
use headrace_sensor::reading::SourceId;

/// The tunnel as designed, and the water in it.
#[derive(Debug, Clone, Resource)]
pub struct TunnelDesign {
    /// Design profile.
    pub profile: Profile,
    /// Water, gravity, levels.
    pub site: Site,
    /// Length of the tunnel, m.
    pub length_m: f64,
    /// Deviation from the design profile beyond which a sample contradicts the profile, m.
    pub contradiction_m: f64,
    /// Limits for accepting returns as wall.
    pub limits: WallLimits,
}

/// Coverage target.
#[derive(Debug, Clone, Copy, Resource)]
pub struct Target {
    /// Target T, m.
    pub target_m: f64,
    /// Arrangement of the heads: phase shift or sector offset.
    pub layout: HeadLayout,
    /// Speed for which the heads are set in phase, m/s; zero if none is planned.
    pub planned_speed_mps: f64,
    /// Effect of other head settings.
    pub(super) other: OtherSettings,
}

/// Entities of the vehicle, of each sensor by source, and of each head by number.
#[derive(Debug, Clone, Resource)]
pub struct VehicleEntities {
    pub(super) vehicle: Entity,
    pub(super) by_source: Vec<Entity>,
    pub(super) heads: Vec<Entity>,
}

impl VehicleEntities {
    /// The vehicle, then its sensors in the order of sources.
    pub(super) fn all(&self) -> impl Iterator<Item = Entity> + '_ {
        core::iter::once(self.vehicle).chain(self.by_source.iter().copied())
    }

    /// Sensor whose bytes come from this source.
    pub fn of_source(&self, source: SourceId) -> Option<Entity> {
        self.by_source.get(source.index()).copied()
    }

    /// Head with this number, from zero in the order of sources.
    pub fn of_head(&self, head: usize) -> Option<Entity> {
        self.heads.get(head).copied()
    }
}

/// Coverage of the wall: the samples, the verdicts, and the data from which the verdicts are formed.
#[derive(Debug, Resource)]
pub struct Coverage {
    /// Samples.
    pub store: SampleStore,
    /// Verdicts.
    pub sections: Sections,
    /// Chainages at which samples may still land.
    pub frontier: Frontier,
    /// Samples by node of a square grid.
    pub soundings: Soundings,
    /// Places near the vehicle at which the wall was found to deviate from the design.
    pub relief: Relief,
    /// Last judged unsure stretch.
    pub unsure: Option<Stretch>,
    /// Latest missing samples.
    pub lacks: MissingSamples,
}

stateful!(Coverage { state: store, sections, frontier, soundings, relief, unsure, lacks; });

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

/// Result streams. Their digests together give the digest of the dive.
#[derive(Debug, Default, Resource)]
pub struct Digests {
    /// Poses at the updates.
    pub poses: ResultStream,
    /// Placed pings.
    pub pings: ResultStream,
    /// Judgements.
    pub judgements: ResultStream,
    /// The advice.
    pub advice: ResultStream,
    /// Live states at the updates.
    pub states: ResultStream,
    /// Changes of alerts, and notes.
    pub alerts: ResultStream,
}

stateful!(Digests { state: poses, pings, judgements, advice, states, alerts; });

impl Digests {
    /// Streams by name, in log order.
    pub fn streams(&self) -> [(&'static str, &ResultStream); 6] {
        [
            ("poses", &self.poses),
            ("pings", &self.pings),
            ("judgements", &self.judgements),
            ("advice", &self.advice),
            ("states", &self.states),
            ("alerts", &self.alerts),
        ]
    }

    /// Keeps the words of each tick from now on. Allocates: once, all memory for the words.
    pub fn keep(&mut self) {
        self.poses.keep();
        self.pings.keep();
        self.judgements.keep();
        self.advice.keep();
        self.states.keep();
        self.alerts.keep();
    }

    pub(super) fn next_tick(&mut self) {
        self.poses.next_tick();
        self.pings.next_tick();
        self.judgements.next_tick();
        self.advice.next_tick();
        self.states.next_tick();
        self.alerts.next_tick();
    }
}

/// Counts over the whole dive.
#[derive(Debug, Clone, Copy, PartialEq, Default, Resource, Serialize, Deserialize)]
pub struct Tally {
    /// Packets consumed.
    pub packets: u64,
    /// First and last receive time.
    pub span: Option<(MonoNs, MonoNs)>,
    /// Samples on the wall.
    pub samples: u64,
    /// Pings without a return although the wall was within range, or without a fix.
    pub missing: u64,
    /// Pings without a return because the wall was out of range.
    pub out_of_range: u64,
    /// Pings that the vehicle occluded.
    pub occluded: u64,
    /// Returns without a fix.
    pub unplaced: u64,
    /// Returns without a fix by reason, in the order of [`NoFix::ALL`].
    pub lacking: [u64; NoFix::ALL.len()],
    /// Pings without a fix, with or without a return.
    pub without_fix: u64,
    /// Samples outside the store's extent.
    pub outside: u64,
    /// Samples not stored for lack of room.
    pub not_stored: u64,
    /// Returns that were not accepted as wall.
    pub doubtful: u64,
}

/// The current tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Resource, Serialize, Deserialize)]
pub struct TickTime {
    /// Number from zero.
    pub index: u64,
    /// End of the tick's time.
    pub now: MonoNs,
}
