//! The dive's entities: the vehicle and its sensors, including the heads.
//!
//! In the placer, the vehicle has [`Navigator`] and [`VehicleState`]. Every sensor has [`Mounted`],
//! [`SensorDecoder`] and [`SensorHealth`]. A head also has [`Head`], [`HeadSpecification`],
//! [`HiddenAngles`], [`MeasuredMotion`] and [`LossCount`].
//!
//! In the surveyor, a head has [`Head`], [`Mounted`], [`HiddenAngles`], [`HeadClassifier`], [`HeadSweep`] and
//! [`HeadFrontier`].

use bevy_ecs::entity::Entity;
use bevy_ecs::prelude::{Component, Resource};
use serde::{Deserialize, Serialize};

pub use super::head_motion::MeasuredMotion;
pub use super::loss_count::LossCount;
use super::messages::PlacedPing;

use headrace_coverage::{HeadReach, HeadWall, MOST_WAITING};
use headrace_fusion::filter::cable::CableDoubt;
use headrace_fusion::filter::pose_sd::PoseSd;
use headrace_fusion::stuck_sensor::StuckSensor;
use headrace_fusion::{Fix, Navigation, NoFix};
use headrace_geometry::frames::{Point3, Tunnel};
use headrace_geometry::snapshot::{Restorer, Saver, SnapshotError, Stateful};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sampling::head::{HeadMode, HeadSpec};
use headrace_sampling::occlusion::AngleRange;
use headrace_sensor::device::{Decoder, SensorInfo};
use headrace_sensor::reading::SourceId;

/// The vehicle's navigation: converts readings to fixes.
#[derive(Component)]
pub struct Navigator {
    /// Method that computes fixes from readings.
    pub navigation: Box<dyn Navigation>,
    /// Time of the next advice update, a multiple of the advice period; `None` before the first packet.
    pub next_update: Option<MonoNs>,
    /// Detectors of stuck sensors, by source.
    pub repeats: Vec<StuckSensor>,
    /// Bitmask of the stuck sources.
    pub hung: u64,
}

impl Stateful for Navigator {
    fn save(&self, to: &mut Saver) {
        self.navigation.save(to);
        to.value(&self.next_update);
        to.value(&(&self.repeats, self.hung));
    }

    fn restore(&mut self, from: &mut Restorer<'_>) -> Result<(), SnapshotError> {
        self.navigation.restore(from)?;
        self.next_update = from.value()?;
        (self.repeats, self.hung) = from.value()?;
        Ok(())
    }
}

/// Fix of the vehicle at the latest advice update, and its standard deviations.
#[derive(Debug, Clone, Copy, PartialEq, Component, Serialize, Deserialize)]
pub struct VehicleState {
    /// Time of the latest advice update; `None` before the first one.
    pub at: Option<MonoNs>,
    /// Pose and speed of the vehicle, or the reason for which there is no fix.
    pub fix: Result<Fix, NoFix>,
    /// Standard deviations of the pose, from its covariance; `None` if the navigation method provides none.
    pub sd: Option<PoseSd>,
    /// Doubt about the cable counter; `None` while the counter is trusted.
    pub cable_doubt: Option<CableDoubt>,
}

impl Default for VehicleState {
    fn default() -> Self {
        Self { at: None, fix: Err(NoFix::Heading), sd: None, cable_doubt: None }
    }
}

/// Source, mount and kind of a sensor.
#[derive(Debug, Clone, Copy, PartialEq, Component)]
pub struct Mounted {
    /// Source that supplies the sensor's bytes.
    pub source: SourceId,
    /// Mount and kind of the sensor.
    pub info: SensorInfo,
}

/// Decoder of a sensor's bytes to readings.
#[derive(Component)]
pub struct SensorDecoder(pub Box<dyn Decoder>);

impl Stateful for SensorDecoder {
    fn save(&self, to: &mut Saver) {
        self.0.save(to);
    }

    fn restore(&mut self, from: &mut Restorer<'_>) -> Result<(), SnapshotError> {
        self.0.restore(from)
    }
}

/// Traffic statistics of a sensor.
#[derive(Debug, Clone, Copy, PartialEq, Default, Component, Serialize, Deserialize)]
pub struct SensorHealth {
    /// Number of packets received.
    pub packets: u64,
    /// Number of bytes received.
    pub bytes: u64,
    /// Number of readings decoded.
    pub readings: u64,
    /// Number of readings decoded but withheld.
    pub withheld: u64,
    /// Receive times of the first and last packet.
    pub span: Option<(MonoNs, MonoNs)>,
    /// Longest time between two packets of the sensor.
    pub longest_gap: DurNs,
}

impl SensorHealth {
    /// Counts a packet and its readings.
    pub(super) fn count(&mut self, received: MonoNs, bytes: usize, readings: usize) {
        self.packets += 1;
        self.bytes += bytes as u64;
        self.readings += readings as u64;
        if let Some((_, last)) = self.span {
            self.longest_gap = self.longest_gap.max(received.since(last));
        }
        self.span = Some(widened(self.span, received));
    }

    /// Time since the sensor's most recent packet, at `now`; `None` before the first packet.
    pub fn silent_for(&self, now: MonoNs) -> Option<DurNs> {
        self.span.map(|(_, last)| now.since(last))
    }
}

/// Extends the time span between two packets to include time `at`.
pub(super) fn widened(span: Option<(MonoNs, MonoNs)>, at: MonoNs) -> (MonoNs, MonoNs) {
    span.map_or((at, at), |(first, last)| (first.min(at), last.max(at)))
}

/// A profiling head. Heads are numbered from zero in the order of sources.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Component)]
pub struct Head(pub usize);

/// Specification of a profiling head, as configured in the vehicle file.
#[derive(Debug, Clone, PartialEq, Component)]
pub struct HeadSpecification {
    /// Mount and scan parameters of the head.
    pub spec: HeadSpec,
    /// Scan modes to which the head can be set.
    pub modes: Vec<HeadMode>,
    /// Shortest range setting that reaches all wall from the tunnel's centre, m, and the head's modes at that
    /// setting.
    ///
    /// The setting is the head's present setting or a longer one. `None` if no setting is long enough.
    pub reaching: Option<(f64, Vec<HeadMode>)>,
}

/// Angles at which the vehicle occludes the head's beam, in the head's frame.
#[derive(Debug, Clone, PartialEq, Default, Component)]
pub struct HiddenAngles(pub Vec<AngleRange>);

impl HiddenAngles {
    /// Whether the vehicle occludes the beam at this angle of the head, radians.
    pub fn hides(&self, angle_rad: f64) -> bool {
        self.0.iter().any(|range| range.has(angle_rad))
    }
}

/// Classifier of a head's returns.
#[derive(Debug, Clone, Copy, Default, Component, Serialize, Deserialize)]
pub struct HeadClassifier(pub(super) HeadWall);

/// Sweep state of a head: its latest sample, and the returns that wait for classification.
#[derive(Debug, Clone, Copy, Default, Component, Serialize, Deserialize)]
pub struct HeadSweep {
    /// Latest valid sample in the present sweep of the head.
    pub(super) last: Option<LastSample>,
    /// Sonar returns that are classified only after the head's next returns.
    pub(super) waiting: WaitingReturns,
}

/// A return that can be classified only after the head's next returns.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(super) struct Waiting {
    pub(super) ping: PlacedPing,
    /// Whether the ping after this return gave no return.
    pub(super) broken: bool,
    /// Whether a new sweep has begun since this return.
    pub(super) new_sweep: bool,
}

/// Sonar returns of a head that wait for classification, in order.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub(super) struct WaitingReturns([Option<Waiting>; MOST_WAITING]);

impl WaitingReturns {
    /// Adds a waiting return. Returns false if there is no room.
    pub(super) fn add(&mut self, ping: &PlacedPing) -> bool {
        let slot = self.0.iter_mut().find(|slot| slot.is_none());
        slot.map(|slot| *slot = Some(Waiting { ping: *ping, broken: false, new_sweep: false })).is_some()
    }

    /// Most recent waiting return.
    pub(super) fn last_mut(&mut self) -> Option<&mut Waiting> {
        self.0.iter_mut().flatten().next_back()
    }

    /// Removes and returns all waiting returns.
    pub(super) fn take(&mut self) -> impl Iterator<Item = Waiting> + use<> {
        core::mem::take(&mut self.0).into_iter().flatten()
    }
}

/// Latest valid sample of a head in its present sweep.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(super) struct LastSample {
    pub(super) point: Point3<Tunnel>,
    /// Arc length of the sample, m.
    pub(super) arc_m: f64,
    /// Whether, at each ping since this sample, the head has moved a single angular step and got a return.
    pub(super) unbroken: bool,
}

/// Reach of a head: the chainages where its samples land now, and all chainages where they have landed so far. `None`
/// before its first ping with a fix.
#[derive(Debug, Clone, Copy, PartialEq, Default, Component, Serialize, Deserialize)]
pub struct HeadFrontier(pub Option<HeadReach>);

/// Entities of the placer: the vehicle, and each sensor by source.
#[derive(Debug, Clone, Resource)]
pub struct VehicleEntities {
    pub(super) vehicle: Entity,
    pub(super) by_source: Vec<Entity>,
}

impl VehicleEntities {
    /// Sensor whose bytes come from this source.
    pub fn of_source(&self, source: SourceId) -> Option<Entity> {
        self.by_source.get(source.index()).copied()
    }
}

/// Entities of the surveyor: each head by number, from zero in the order of sources.
#[derive(Debug, Clone, Resource)]
pub struct HeadEntities(pub(super) Vec<Entity>);

impl HeadEntities {
    /// Head with this number.
    pub fn of_head(&self, head: usize) -> Option<Entity> {
        self.0.get(head).copied()
    }
}
