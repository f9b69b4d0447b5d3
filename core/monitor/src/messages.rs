//! Messages between the stages of a tick.
//!
//! Earlier stages fill lists for the tick. Each stage processes them in order, without looking ahead. A
//! result therefore depends only on the packets before it, wherever the stream was cut into ticks.

use bevy_ecs::prelude::Resource;
use serde::{Deserialize, Serialize};

use super::advice_log::AdviceEntry;
use super::alert_list::{AlertChange, ListedAlert};
use super::alerts::AlertKind;
use super::live_state::{ActiveAlerts, LiveMetres};
use super::notes::Note;
use headrace_coverage::{Judgement, Loss, Reach, Request, RunChange, RunId, Stretch};
use headrace_fusion::filter::cable::CableDoubt;
use headrace_fusion::filter::pose_sd::PoseSd;
use headrace_fusion::filter::setting_check::SettingDoubt;
use headrace_fusion::{Fix, NoFix};
use headrace_geometry::frames::{Point3, Tunnel};
use headrace_geometry::time::MonoNs;
use headrace_sampling::advice::Advice;
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

/// Readings of this tick, in order.
#[derive(Debug, Resource)]
pub struct Events(pub Vec<Event>);

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

/// An epoch with its fix: a multiple of [`ADVICE_PERIOD`](super::advice_log::ADVICE_PERIOD), or a sonar ping.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Positioned {
    /// The event with this index is a sonar ping. The fix is for the ping's time of validity.
    Ping {
        /// Index into [`Events`].
        event: usize,
        /// Fix at the ping, or the reason for which there is none.
        fix: Result<Fix, NoFix>,
    },
    /// A multiple of the advice period has passed.
    Beat {
        /// Timestamp.
        at: MonoNs,
        /// Fix at the update, or the reason for which there is none.
        fix: Result<Fix, NoFix>,
        /// Doubts of navigation.
        doubts: Doubts,
        /// Standard deviations of the pose at the update.
        sd: Option<PoseSd>,
        /// Index into [`Events`] of the next event.
        before: usize,
    },
}

/// Pings and updates of this tick with their fixes, in order.
#[derive(Debug, Resource)]
pub struct PositionedList(pub Vec<Positioned>);

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

/// An output item of [`super::stage::Stage::Georeference`].
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "the list is filled once and read once per tick")]
pub enum Placed {
    /// A ping.
    Ping(PlacedPing),
    /// The situation at an update, and the doubts of navigation.
    Situation(MonoNs, Situation, Doubts),
}

/// Pings and situations of this tick, in order.
#[derive(Debug, Resource)]
pub struct PlacedList(pub Vec<Placed>);

/// For each item of [`PlacedList`], an index into [`Events`].
///
/// It is the index of the ping, or of the event after the situation.
#[derive(Debug, Resource)]
pub struct PlacedEvents(pub Vec<usize>);

/// Judged metres and active alerts at an update.
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
    /// Alerts that hold.
    pub alerts: ActiveAlerts,
}

/// Judged metres and alerts at each update of this tick, in order.
#[derive(Debug, Resource)]
pub struct JudgedStates(pub Vec<Standing>);

/// Advice at each update of this tick, in order.
#[derive(Debug, Resource)]
pub struct AdviceList(pub Vec<Advice>);

/// Sections to be judged after a ping, in order. The buffer is reused.
#[derive(Debug, Resource)]
pub struct Requests(pub Vec<Request>);

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
    /// First occurrence of an alert. The source is the head, if the alert names one.
    Alert(AlertKind, Option<SourceId>),
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

/// Results of this tick, in order.
#[derive(Debug, Resource)]
pub struct Notices(pub Vec<Notice>);
