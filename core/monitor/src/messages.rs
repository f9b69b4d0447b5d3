//! What flows from stage to stage within a tick.
//!
//! Each stage reads the lists that earlier stages have filled for this tick and works through them in order, looking
//! at nothing that lies later in them. A result therefore depends on the packets before it alone, and not on where
//! the stream was cut into ticks.

use bevy_ecs::prelude::Resource;

use super::advice_log::AdviceEntry;
use super::alerts::AlertKind;
use headrace_coverage::{Judgement, Loss, Reach, Request, RunChange, RunId};
use headrace_fusion::{Fix, NoFix};
use headrace_geometry::frames::{Point3, Tunnel};
use headrace_geometry::time::MonoNs;
use headrace_sampling::passes::Situation;
use headrace_sensor::reading::{Reading, SourceId};

/// A reading with its source and times.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Event {
    /// Where it came from.
    pub source: SourceId,
    /// When its packet was received.
    pub received: MonoNs,
    /// When it was valid.
    pub valid_at: MonoNs,
    /// The value.
    pub reading: Reading,
}

/// Readings of this tick, in order.
#[derive(Debug, Resource)]
pub struct Events(pub Vec<Event>);

/// A moment at which the way on is looked at: a multiple of [`ADVICE_PERIOD`], or a sonar ping.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Positioned {
    /// The event of this index is a sonar ping; the fix is for its time of validity.
    Ping {
        /// Index into [`Events`].
        event: usize,
        /// Where the vehicle was.
        fix: Result<Fix, NoFix>,
    },
    /// A multiple of the advice period has passed.
    Beat {
        /// The multiple.
        at: MonoNs,
        /// Where the vehicle is.
        fix: Result<Fix, NoFix>,
    },
}

/// Pings and beats of this tick with their fixes, in order.
#[derive(Debug, Resource)]
pub struct PositionedList(pub Vec<Positioned>);

/// What became of a ping.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outcome {
    /// A sample on the wall.
    Sample {
        /// Where the beam ended.
        point: Point3<Tunnel>,
        /// Its arc length, m.
        arc_m: f64,
    },
    /// No return from where one should have come, for a reason; nobody knows where that was without a fix.
    Lost(Loss, Option<Aim>),
    /// A return that could not be placed.
    Unplaced(NoFix),
}

/// Where a beam meets the wall by design.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aim {
    /// Chainage, m.
    pub x_m: f64,
    /// Arc length, m.
    pub arc_m: f64,
}

/// A ping with its place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlacedPing {
    /// Number of the head, from zero.
    pub head: usize,
    /// When the packet was received.
    pub received: MonoNs,
    /// When the ping was valid.
    pub valid_at: MonoNs,
    /// The vehicle then; `None` without a fix.
    pub fix: Option<Fix>,
    /// Chainages on which the head lands samples at this attitude; `None` without a fix.
    pub reach: Option<Reach>,
    /// The head has come here from its last ping in one step.
    pub single_step: bool,
    /// A new sweep has begun.
    pub new_sweep: bool,
    /// The head stands still.
    pub standing: bool,
    /// What became of it.
    pub outcome: Outcome,
}

/// An item of the list that [`super::stage::Stage::Georeference`] hands on.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "a list that is filled once and read once a tick")]
pub enum Placed {
    /// A ping.
    Ping(PlacedPing),
    /// The situation at a beat.
    Situation(MonoNs, Situation),
}

/// Pings and situations of this tick, in order.
#[derive(Debug, Resource)]
pub struct PlacedList(pub Vec<Placed>);

/// Sections to be judged after a ping, in order; room that is used again and again.
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
        /// The moment, in data time.
        at: MonoNs,
        /// What has changed.
        change: Judgement,
    },
    /// A run of flagged sections has changed.
    Run {
        /// Its number.
        id: RunId,
        /// The moment, in data time.
        at: MonoNs,
        /// What has changed.
        change: RunChange,
    },
    /// Something is wrong that wasn't before.
    Alert(AlertKind),
    /// How fast one may go.
    Advice(AdviceEntry),
}

/// Results of this tick, in order.
#[derive(Debug, Resource)]
pub struct Notices(pub Vec<Notice>);
