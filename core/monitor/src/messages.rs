//! Elements of the lists that stages and parts of the loop pass on within a tick.
//!
//! Each list is processed in order, without looking ahead. A result therefore depends only on the packets
//! before it, wherever the stream was cut into ticks.

use serde::{Deserialize, Serialize};

use super::advice_log::AdviceEntry;
use super::notes::Note;
use crate::alert_list::alert::{AlertChange, ListedAlert};
use crate::dive_plan::missed::MissedList;
use crate::live_state::state::ActiveObservations;
use headrace_coverage::{Judgement, Loss, Metres, Reach, RunChange, RunId, Stretch};
use headrace_fusion::filter::cable::CableDoubt;
use headrace_fusion::filter::pose_sd::PoseSd;
use headrace_fusion::filter::setting_check::SettingDoubt;
use headrace_fusion::{Fix, NoFix};
use headrace_geometry::frames::{Point3, Tunnel};
use headrace_geometry::time::MonoNs;
use headrace_geometry::tunnel::WallPoint;
use headrace_sampling::passes::Situation;
use headrace_sensor::reading::{Reading, SourceId};

/// A reading with its source and times.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Event {
    /// Source that delivered the reading.
    pub source: SourceId,
    /// Receive time of the reading's packet.
    pub received: MonoNs,
    /// Time for which the reading is valid.
    pub valid_at: MonoNs,
    /// Value of the reading.
    pub reading: Reading,
}

/// Doubts about sensors and settings that navigation reports at an advice update.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Doubts {
    /// Doubt about the cable counter; `None` while the counter is trusted.
    pub cable: Option<CableDoubt>,
    /// Vehicle file setting that is likely wrong.
    pub setting: Option<SettingDoubt>,
    /// Whether the pitch and yaw of the heads on their mounts are not verified yet.
    pub unverified_mounts: bool,
    /// Time for which the vehicle should stay stationary to find the gyros' bias, s.
    pub stand_s: u32,
    /// Bitmask of the stuck sources. They repeat a reading, and count as silent.
    pub hung: u64,
}

/// Outcome of a ping.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Outcome {
    /// A return that could be placed. If it is accepted as wall, it becomes a sample.
    Sample {
        /// End point of the beam.
        point: Point3<Tunnel>,
        /// Arc length of the end point, m.
        arc_m: f64,
    },
    /// No sample, for the given reason. The aim is the point at which the beam meets the design profile; `None` if
    /// unknown.
    Lost(Loss, Option<WallPoint>),
    /// A return that can't be placed because there is no fix, with the reason for that.
    Unplaced(NoFix),
}

/// Whether the vehicle occludes a beam, according to the vehicle's geometry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Hidden {
    /// The beam is not occluded.
    No,
    /// The beam passes close to the vehicle. A return is possible.
    Beside,
    /// The beam is occluded.
    Yes,
}

/// A georeferenced ping.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PlacedPing {
    /// Number of the head, from zero.
    pub head: usize,
    /// Receive time of the packet.
    pub received: MonoNs,
    /// Time of validity of the ping.
    pub valid_at: MonoNs,
    /// Fix at the ping's time of validity.
    pub fix: Option<Fix>,
    /// Chainages at which the head places samples at this attitude; `None` without a fix.
    pub reach: Option<Reach>,
    /// Whether the head has moved a single angular step since its previous ping.
    pub single_step: bool,
    /// Whether a new sweep of the head has begun with this ping.
    pub new_sweep: bool,
    /// Whether the head is stalled.
    pub standing: bool,
    /// Outcome of the ping.
    pub outcome: Outcome,
    /// Angle of the head, in the sensor frame, radians.
    pub angle_rad: f64,
    /// Whether the vehicle occludes the beam at this angle.
    pub hidden: Hidden,
    /// Longest range that the head can measure at its range setting, m.
    pub longest_m: f64,
    /// Source of the ping's packet.
    pub source: SourceId,
    /// Position of the head; `None` without a fix.
    pub origin: Option<Point3<Tunnel>>,
}

/// Situation at an advice update, which takes place at every multiple of
/// [`ADVICE_PERIOD`](super::advice_log::ADVICE_PERIOD).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Update {
    /// Time of the advice update.
    pub at: MonoNs,
    /// Situation of the vehicle and its heads at the advice update.
    pub situation: Situation,
    /// Doubts that navigation reports.
    pub doubts: Doubts,
    /// Fix at the advice update, or the reason for which there is none.
    pub fix: Result<Fix, NoFix>,
    /// Standard deviations of the vehicle's pose.
    pub sd: Option<PoseSd>,
}

/// A ping or an advice update, with its position in the tunnel.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "the list is filled once and read once per tick")]
pub enum Placement {
    /// A georeferenced ping.
    Ping(PlacedPing),
    /// An advice update.
    Update(Update),
}

/// A georeferenced ping or an advice update, and its position among the tick's readings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlacedItem {
    /// Index of the ping's reading. For an advice update, it is the index of the first reading after the update.
    pub event: usize,
    /// The ping or update.
    pub placement: Placement,
}

/// Coverage results and observations at an advice update.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Standing {
    /// Length of each verdict within the coverage extent.
    pub metres: Metres,
    /// Chainage at which the first missed stretch begins, m; `None` if no stretch is missed.
    pub missed_from_m: Option<f64>,
    /// Most recently judged stretch that neither passes nor fails.
    pub unsure: Option<Stretch>,
    /// Whether every part of the wall visible to the heads here has the verdict pass.
    pub passed: bool,
    /// Chainage to which the vehicle goes back for a missed stretch, m; `None` unless the vehicle is on the
    /// way there.
    pub back_to_m: Option<f64>,
    /// Missed stretches, from which the plan for the rest of the dive is made.
    pub(crate) missed: MissedList,
    /// Observations about the dive that hold at the advice update.
    pub(crate) observations: ActiveObservations,
}

/// A result that outlets are notified of.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "copied into preallocated room; a box would allocate")]
pub enum Notice {
    /// A section's verdict, hole or flag has changed.
    Section {
        /// Index of the changed section.
        section: i64,
        /// Time of the change, in data time.
        at: MonoNs,
        /// Kind of the section's change.
        change: Judgement,
    },
    /// A missed stretch has changed.
    Run {
        /// Number of the missed stretch.
        id: RunId,
        /// Time of the change, in data time.
        at: MonoNs,
        /// Kind of the stretch's change.
        change: RunChange,
    },
    /// Speed advice at an update.
    Advice(AdviceEntry),
    /// An alert of the list has changed.
    Listed {
        /// Kind of the alert's change.
        change: AlertChange,
        /// Time of the change, in data time.
        at: MonoNs,
        /// The alert as it was at the time of the change.
        alert: ListedAlert,
    },
    /// A note was added.
    Note(Note),
}
