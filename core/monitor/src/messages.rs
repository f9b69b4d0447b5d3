//! Elements of the lists that stages and parts of the loop pass on within a tick.
//!
//! Each list is processed in order, without looking ahead. A result therefore depends only on the packets
//! before it, wherever the stream was cut into ticks.

use serde::{Deserialize, Serialize};

use super::advice_log::AdviceEntry;
use super::notes::Note;
use crate::alert_list::alert::{AlertChange, ListedAlert};
use crate::live_state::state::{ActiveObservations, LiveMetres};
use headrace_coverage::{Judgement, Loss, Reach, RunChange, RunId, Stretch};
use headrace_fusion::filter::cable::CableDoubt;
use headrace_fusion::filter::pose_sd::PoseSd;
use headrace_fusion::filter::setting_check::SettingDoubt;
use headrace_fusion::{Fix, NoFix};
use headrace_geometry::frames::{Point3, Tunnel};
use headrace_geometry::time::MonoNs;
use headrace_sampling::passes::Situation;
use headrace_sensor::reading::{Reading, SourceId};

/// A reading with its source and times.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Event {
    /// Source of the reading.
    pub source: SourceId,
    /// Receive time of the reading's packet.
    pub received: MonoNs,
    /// Time for which the reading is valid.
    pub valid_at: MonoNs,
    /// Value.
    pub reading: Reading,
}

/// Doubts that navigation reports at an update.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Doubts {
    /// Doubt about the cable counter; `None` while the counter is trusted.
    pub cable: Option<CableDoubt>,
    /// Setting that is likely wrong.
    pub setting: Option<SettingDoubt>,
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
        /// Its arc length, m.
        arc_m: f64,
    },
    /// No sample, for this reason. The aim is the point at which the beam meets the design, if it is known.
    Lost(Loss, Option<Aim>),
    /// A return without a fix, with the reason for the missing fix.
    Unplaced(NoFix),
}

/// Whether the vehicle occludes a beam, by the geometry of the vehicle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Hidden {
    /// Not occluded.
    No,
    /// The beam passes close to the vehicle. A return is possible.
    Beside,
    /// Occluded.
    Yes,
}

/// Point at which a beam meets the design profile.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Aim {
    /// Chainage, m.
    pub x_m: f64,
    /// Arc length, m.
    pub arc_m: f64,
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
    /// Fix at that time.
    pub fix: Option<Fix>,
    /// Chainages at which the head places samples at this attitude; `None` without a fix.
    pub reach: Option<Reach>,
    /// Whether the head has moved a single step since its previous ping.
    pub single_step: bool,
    /// Whether a new sweep has begun.
    pub new_sweep: bool,
    /// Whether the head is stalled.
    pub standing: bool,
    /// Outcome of the ping.
    pub outcome: Outcome,
    /// Angle of the head, in the sensor frame, radians.
    pub angle_rad: f64,
    /// Whether the vehicle occludes the beam at this angle.
    pub hidden: Hidden,
    /// Longest range at the head's setting, m.
    pub longest_m: f64,
    /// Source of the packet.
    pub source: SourceId,
    /// Position of the head; `None` without a fix.
    pub origin: Option<Point3<Tunnel>>,
}

/// Situation at an update, a multiple of [`ADVICE_PERIOD`](super::advice_log::ADVICE_PERIOD).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Update {
    /// Time of the update.
    pub at: MonoNs,
    /// Vehicle and heads at that time.
    pub situation: Situation,
    /// Doubts of navigation.
    pub doubts: Doubts,
    /// Fix, or the reason for which there is none.
    pub fix: Result<Fix, NoFix>,
    /// Standard deviations of the pose.
    pub sd: Option<PoseSd>,
}

/// A ping or an update, placed in the tunnel.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "the list is filled once and read once per tick")]
pub enum Placement {
    /// A ping.
    Ping(PlacedPing),
    /// An update.
    Update(Update),
}

/// A placement and its place among the tick's readings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlacedItem {
    /// Index of the ping's reading. For an update: index of the first reading after it.
    pub event: usize,
    /// The ping or update.
    pub placement: Placement,
}

/// Judged metres and the observations that hold at an update.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Standing {
    /// Metres of the coverage extent by verdict.
    pub metres: LiveMetres,
    /// Last judged unsure stretch.
    pub unsure: Option<Stretch>,
    /// Whether all wall that the heads see here has passed.
    pub passed: bool,
    /// Place to which the vehicle goes back for a missed stretch, m; `None` unless it is on the way there.
    pub back_to_m: Option<f64>,
    /// Observations that hold.
    pub(crate) observations: ActiveObservations,
}

/// A result for the outlets.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "copied into preallocated room; a box would allocate")]
pub enum Notice {
    /// A section's verdict, hole or flag has changed.
    Section {
        /// Index of the section.
        section: i64,
        /// Timestamp, in data time.
        at: MonoNs,
        /// Kind of change.
        change: Judgement,
    },
    /// A run of flagged sections has changed.
    Run {
        /// Its number.
        id: RunId,
        /// Timestamp, in data time.
        at: MonoNs,
        /// Kind of change.
        change: RunChange,
    },
    /// Speed advice.
    Advice(AdviceEntry),
    /// An alert of the list has changed.
    Listed {
        /// Kind of change.
        change: AlertChange,
        /// Timestamp, in data time.
        at: MonoNs,
        /// The alert as it was at that time.
        alert: ListedAlert,
    },
    /// A note was added.
    Note(Note),
}
