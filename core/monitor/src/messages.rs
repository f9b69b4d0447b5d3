//! Messages between the stages of a tick.
//!
//! Each stage processes the lists that earlier stages have filled for this tick in order, without looking ahead. A result
//! therefore depends only on the packets before it, not on where the stream was cut into ticks.

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
use headrace_fusion::filter::suspicion::SettingDoubt;
use headrace_fusion::{Fix, NoFix};
use headrace_geometry::frames::{Point3, Tunnel};
use headrace_geometry::time::MonoNs;
use headrace_sampling::advice::Advice;
use headrace_sampling::passes::Situation;
use headrace_sensor::reading::{Reading, SourceId};

/// A reading with its source and times.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Event {
    /// Source.
    pub source: SourceId,
    /// Receive time of its packet.
    pub received: MonoNs,
    /// Time of validity.
    pub valid_at: MonoNs,
    /// The value.
    pub reading: Reading,
}

/// Readings of this tick, in order.
#[derive(Debug, Resource)]
pub struct Events(pub Vec<Event>);

/// What navigation doubts at a beat.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Doubts {
    /// The cable's counter while it isn't believed.
    pub cable: Option<CableDoubt>,
    /// The setting that is likely wrong.
    pub setting: Option<SettingDoubt>,
    /// How much longer the vehicle should stand still for its gyros' bias to be known, s.
    pub stand_s: u32,
    /// Bits of the sources that hang: they repeat a reading, and count as silent.
    pub hung: u64,
}

/// An epoch with its fix: a multiple of [`ADVICE_PERIOD`](super::advice_log::ADVICE_PERIOD), or a sonar ping.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Positioned {
    /// The event of this index is a sonar ping; the fix is for its time of validity.
    Ping {
        /// Index into [`Events`].
        event: usize,
        /// Fix at the ping, or the reason there is none.
        fix: Result<Fix, NoFix>,
    },
    /// A multiple of the advice period has passed.
    Beat {
        /// Its timestamp.
        at: MonoNs,
        /// Fix at the beat, or the reason there is none.
        fix: Result<Fix, NoFix>,
        /// What navigation doubts.
        doubts: Doubts,
        /// Standard deviations of the pose then.
        sd: Option<PoseSd>,
        /// Index into [`Events`] of the event that it precedes.
        before: usize,
    },
}

/// Pings and beats of this tick with their fixes, in order.
#[derive(Debug, Resource)]
pub struct PositionedList(pub Vec<Positioned>);

/// Outcome of a ping.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Outcome {
    /// A return that could be placed: a sample, if it is taken for wall.
    Sample {
        /// End point of the beam.
        point: Point3<Tunnel>,
        /// Its arc length, m.
        arc_m: f64,
    },
    /// No sample, with the reason and the point aimed at; `None` without a fix or a wall in that direction.
    Lost(Loss, Option<Aim>),
    /// A return without a fix, with the reason.
    Unplaced(NoFix),
}

/// Whether the vehicle is in a beam's way, by its geometry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Hidden {
    /// It isn't.
    No,
    /// Nearly: it may be heard all the same.
    Beside,
    /// It is.
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
    /// Chainages on which the head lands samples at this attitude; `None` without a fix.
    pub reach: Option<Reach>,
    /// The head has moved a single step since its last ping.
    pub single_step: bool,
    /// A new sweep has begun.
    pub new_sweep: bool,
    /// The head is stalled.
    pub standing: bool,
    /// Outcome.
    pub outcome: Outcome,
    /// Angle of the head, in the sensor frame, radians.
    pub angle_rad: f64,
    /// Whether the vehicle is in the way at this angle.
    pub hidden: Hidden,
    /// Longest range at the head's setting, m.
    pub longest_m: f64,
    /// Source of the packet.
    pub source: SourceId,
    /// Where the head was; `None` without a fix.
    pub origin: Option<Point3<Tunnel>>,
}

/// An item of the output of [`super::stage::Stage::Georeference`].
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "a list that is filled once and read once a tick")]
pub enum Placed {
    /// A ping.
    Ping(PlacedPing),
    /// The situation at a beat, and what navigation doubts.
    Situation(MonoNs, Situation, Doubts),
}

/// Pings and situations of this tick, in order.
#[derive(Debug, Resource)]
pub struct PlacedList(pub Vec<Placed>);

/// For each item of [`PlacedList`] the index into [`Events`]: of the ping, or of the event that a situation precedes.
#[derive(Debug, Resource)]
pub struct PlacedEvents(pub Vec<usize>);

/// What has been judged, and the alerts that hold, at a beat.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Standing {
    /// Metres of the way.
    pub metres: LiveMetres,
    /// The unsure stretch that was judged last.
    pub unsure: Option<Stretch>,
    /// All wall that heads see here has passed.
    pub passed: bool,
    /// On the way back for a missed stretch: how far, m.
    pub back_to_m: Option<f64>,
    /// Alerts that hold.
    pub alerts: ActiveAlerts,
}

/// Standing at each beat of this tick, in order.
#[derive(Debug, Resource)]
pub struct Standings(pub Vec<Standing>);

/// Advice at each beat of this tick, in order.
#[derive(Debug, Resource)]
pub struct AdviceList(pub Vec<Advice>);

/// Sections to be judged after a ping, in order; a reused buffer.
#[derive(Debug, Resource)]
pub struct Requests(pub Vec<Request>);

/// A result for the outlets.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "copied into room that is there already; a box would allocate")]
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
    /// First occurrence of an alert; of a head's, for this head.
    Alert(AlertKind, Option<SourceId>),
    /// Speed advice.
    Advice(AdviceEntry),
    /// An alert of the list has changed.
    Listed {
        /// Kind of change.
        change: AlertChange,
        /// Timestamp, in data time.
        at: MonoNs,
        /// The alert, as it was then.
        alert: ListedAlert,
    },
    /// Somebody has put down a note.
    Note(Note),
}

/// Results of this tick, in order.
#[derive(Debug, Resource)]
pub struct Notices(pub Vec<Notice>);
