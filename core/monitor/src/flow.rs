//! What flows from stage to stage within a tick, and the loop's state.
//!
//! Each stage reads the lists that earlier stages have filled for this tick and works through them in order, looking
//! at nothing that lies later in them. A result therefore depends on the packets before it alone, and not on where
//! the stream was cut into ticks.

use bevy_ecs::entity::Entity;
use bevy_ecs::prelude::Resource;
use serde::{Deserialize, Serialize};

use super::alerts::AlertKind;
use super::trail::Trail;
use headrace_coverage::{
    Frontier, HoleFinder, Judgement, Loss, Request, RunChange, RunId, SampleStore, Sections, Soundings,
};
use headrace_fusion::{Fix, Navigation, NoFix};
use headrace_geometry::frames::{Point3, Tunnel};
use headrace_geometry::site::Site;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_geometry::tunnel::Profile;
use headrace_sampling::advice::Advice;
use headrace_sampling::layout::HeadLayout;
use headrace_sampling::occlusion::AngleRange;
use headrace_sampling::passes::Situation;
use headrace_sensor::device::SensorInfo;
use headrace_sensor::reading::{Reading, SourceId};
use headrace_snapshot::stateful;
use headrace_snapshot::{Restorer, Saver, SnapshotError, Stateful};

/// Room for the readings of one tick: the shortest frame of any device has over ten bytes.
pub(super) const MAX_TICK_READINGS: usize = super::merge::MAX_TICK_BYTES / 8;

/// Advice is given at every multiple of this in data time.
pub const ADVICE_PERIOD: DurNs = DurNs(200_000_000);

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
        sigma_m: f64,
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
    pub sigma_m: f64,
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
    pub reach: Option<headrace_coverage::Reach>,
    /// The head has come here from its last ping in one step.
    pub single_step: bool,
    /// A new sweep has begun.
    pub new_sweep: bool,
    /// The head stands still.
    pub standing: bool,
    /// What became of it.
    pub outcome: Outcome,
}

/// An item of the list that [`super::stage::Stage::Place`] hands on.
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

/// The tunnel, the site and the target.
#[derive(Debug, Clone, Resource)]
pub struct Place {
    /// Design profile.
    pub profile: Profile,
    /// Water, gravity, levels.
    pub site: Site,
    /// Target T, m.
    pub target_m: f64,
    /// How the heads share the work.
    pub layout: HeadLayout,
    /// Length of the tunnel, m.
    pub length_m: f64,
    /// Samples farther than this from the design profile contradict it, m.
    pub contradiction_m: f64,
}

/// What navigation knows of each source, by source.
#[derive(Debug, Resource)]
pub struct SensorTable(pub Vec<SensorInfo>);

/// For each source the number and entity of its head, where it is one.
#[derive(Debug, Resource)]
pub struct HeadTable(pub Vec<Option<(usize, Entity)>>);

/// By number of the head, the angles that the vehicle hides from it, in its own frame.
#[derive(Debug, Resource)]
pub struct HiddenAngles(pub Vec<Vec<AngleRange>>);

/// Navigation, and the next beat.
#[derive(Resource)]
pub struct Navigator {
    /// The way of navigating.
    pub navigation: Box<dyn Navigation>,
    /// The next multiple of the advice period; `None` before the first packet.
    pub next_beat: Option<MonoNs>,
}

impl Stateful for Navigator {
    fn save(&self, to: &mut Saver) {
        self.navigation.save(to);
        to.value(&self.next_beat);
    }

    fn restore(&mut self, from: &mut Restorer<'_>) -> Result<(), SnapshotError> {
        self.navigation.restore(from)?;
        self.next_beat = from.value()?;
        Ok(())
    }
}

/// What is known of the wall.
#[derive(Debug, Resource)]
pub struct Coverage {
    /// Samples.
    pub store: SampleStore,
    /// Verdicts.
    pub sections: Sections,
    /// Where samples may still land.
    pub frontier: Frontier,
    /// Samples by node of a square grid.
    pub soundings: Soundings,
}

stateful!(Coverage { state: store, sections, frontier, soundings; });

/// The search for holes with its working memory.
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

/// The streams of results with their digests; together, the dive's.
#[derive(Debug, Default, Resource)]
pub struct Digests {
    /// Poses at the beats.
    pub poses: Trail,
    /// Placed pings.
    pub pings: Trail,
    /// Judgements.
    pub judgements: Trail,
    /// Advice.
    pub advice: Trail,
}

stateful!(Digests { state: poses, pings, judgements, advice; });

impl Digests {
    /// The streams by name, in the order in which a log has them.
    pub fn streams(&self) -> [(&'static str, &Trail); 4] {
        [
            ("poses", &self.poses),
            ("pings", &self.pings),
            ("judgements", &self.judgements),
            ("advice", &self.advice),
        ]
    }

    /// Keeps the words of each tick from now on.
    pub fn keep(&mut self) {
        self.poses.keep();
        self.pings.keep();
        self.judgements.keep();
        self.advice.keep();
    }

    pub(super) fn next_tick(&mut self) {
        self.poses.next_tick();
        self.pings.next_tick();
        self.judgements.next_tick();
        self.advice.next_tick();
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
    /// Pings without a return, the wall within range or its distance not known.
    pub missing: u64,
    /// Pings without a return where the wall was out of range.
    pub out_of_range: u64,
    /// Pings that the vehicle itself stopped.
    pub occluded: u64,
    /// Returns without a fix.
    pub unplaced: u64,
    /// Samples outside the stretch that is kept.
    pub outside: u64,
    /// Samples for which there was no room.
    pub not_stored: u64,
}

/// The tick that runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Resource, Serialize, Deserialize)]
pub struct TickTime {
    /// Its number, from zero.
    pub index: u64,
    /// Its end.
    pub now: MonoNs,
}

/// What came from one source.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct SourceTally {
    /// Packets.
    pub packets: u64,
    /// Their bytes.
    pub bytes: u64,
    /// Readings that they gave.
    pub readings: u64,
    /// First and last receive time.
    pub span: Option<(MonoNs, MonoNs)>,
    /// Longest time between two packets.
    pub longest_gap: DurNs,
}

/// What came from each source.
#[derive(Debug, Clone, PartialEq, Resource)]
pub struct SourceTallies(pub Vec<SourceTally>);

impl Stateful for SourceTallies {
    fn save(&self, to: &mut Saver) {
        to.list(&self.0);
    }

    fn restore(&mut self, from: &mut Restorer<'_>) -> Result<(), SnapshotError> {
        from.slots(&mut self.0)
    }
}

impl SourceTallies {
    pub(super) fn new(sources: usize) -> Self {
        Self(vec![SourceTally::default(); sources])
    }
}

/// One entry of the advice's history.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct AdviceEntry {
    /// The moment, in data time.
    pub at: MonoNs,
    /// Chainage then, m; `None` without a fix.
    pub chainage_m: Option<f64>,
    /// Speed then, m/s.
    pub speed_mps: f64,
    /// The advice.
    pub advice: Advice,
}

/// The advice over time, kept whenever it has changed enough to matter, or ten seconds have gone.
///
/// When it is full every other entry is dropped, and from then on entries are at least twice as far apart in time as they
/// had to be before: a longer dive is told more coarsely, from its beginning to its end.
#[derive(Debug, Clone, Resource)]
pub struct AdviceLog {
    /// The entries, in order.
    pub entries: Vec<AdviceEntry>,
    /// Entries for which there was no room.
    pub dropped: u64,
    /// Least time between two entries.
    apart: DurNs,
}

stateful!(AdviceLog { state: dropped, apart; lists: entries; });

impl Default for AdviceLog {
    fn default() -> Self {
        Self { entries: Vec::with_capacity(Self::CAPACITY), dropped: 0, apart: DurNs(0) }
    }
}

impl AdviceLog {
    /// An entry has some 400 bytes.
    const CAPACITY: usize = 1 << 13;
    const EVERY: DurNs = DurNs(10_000_000_000);
    const CHANGE_MPS: f64 = 0.01;

    pub(super) fn take(&mut self, entry: &AdviceEntry) {
        let unchanged = |last: &AdviceEntry| {
            last.advice.reason == entry.advice.reason
                && last.advice.will_exceed == entry.advice.will_exceed
                && (last.advice.v_max_mps - entry.advice.v_max_mps).abs() < Self::CHANGE_MPS
                && (last.speed_mps - entry.speed_mps).abs() < Self::CHANGE_MPS
                && entry.at.since(last.at).0 < Self::EVERY.0
        };
        if self.entries.last().is_some_and(unchanged) {
            return;
        }
        if self.entries.last().is_some_and(|last| entry.at.since(last.at).0 < self.apart.0) {
            self.dropped += 1;
            return;
        }
        if self.entries.len() == Self::CAPACITY {
            self.thin_out();
        }
        self.entries.push(*entry);
    }

    fn thin_out(&mut self) {
        let before = self.entries.len();
        let mut number = 0_usize;
        self.entries.retain(|_| {
            number += 1;
            number % 2 == 1
        });
        self.dropped += (before - self.entries.len()) as u64;
        self.apart = DurNs((2 * self.apart.0).max(2 * ADVICE_PERIOD.0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_geometry::tunnel::shapes;
    use headrace_sampling::advice::{Advisor, Task};
    use headrace_sampling::swing::Swing;

    /// Advice that changes at every beat of ten hours is told from beginning to end in the room that there is.
    #[test]
    fn the_advice_s_history_does_not_grow_with_hours() {
        let profile = shapes::circle(3.0).unwrap();
        let task =
            Task { target_m: 0.5, length_m: 100.0, layout: HeadLayout::PhaseShift, sound_speed_mps: 1447.0 };
        let nowhere = Situation {
            pose: None,
            speed_mps: 0.0,
            doubt_m: 0.0,
            layout: HeadLayout::PhaseShift,
            configured: 0,
            heads: [None; headrace_sampling::head::MAX_HEADS],
        };
        let advice = Advisor::new(&profile, task, &[], &[]).advise(&nowhere, Swing::default(), None);
        let mut log = AdviceLog::default();
        let room = log.entries.capacity();
        let beats = 180_000_u32;
        for beat in 0..beats {
            let at = MonoNs(u64::from(beat) * ADVICE_PERIOD.0.unsigned_abs());
            let speed_mps = f64::from(beat % 2);
            log.take(&AdviceEntry { at, chainage_m: None, speed_mps, advice });
        }
        assert_eq!(log.entries.capacity(), room);
        assert!(log.entries.len() > AdviceLog::CAPACITY / 2 - 1, "{}", log.entries.len());
        assert!(log.dropped > 0, "what is left out is counted");
        let apart_s = log.entries.windows(2).map(|two| two[1].at.since(two[0].at).as_secs_f64());
        assert!(apart_s.fold(0.0, f64::max) < 12.0);
        assert_eq!(log.entries[0].at, MonoNs(0));
    }
}
