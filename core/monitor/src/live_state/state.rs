//! The state itself, and the states of position and sensors in it.

use bevy_ecs::prelude::Resource;
use serde::{Deserialize, Serialize};

use super::speed_band::SpeedBand;
use crate::dive_plan::route::DivePlan;
use crate::observations::{MOST_OBSERVATIONS, ObservedKind, Occurrences};
use crate::unread::{UnreadPacket, UnreadSpan, WithheldReadings};
use headrace_coverage::{Metres, Stretch};
use headrace_fusion::NoFix;
use headrace_fusion::filter::pose_sd::PoseSd;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sampling::Target;
use headrace_sampling::advice::{Advice, Reason};
use headrace_sampling::head::HeadSet;
use headrace_sensor::reading::{MAX_SOURCES, SourceId};
use headrace_sensor::withheld::WithheldReason;

/// Version of the live state and of its JSON.
pub const LIVE_STATE_VERSION: u32 = 4;
/// Age above which data is shown as stale. It equals the maximum time between readings of a head that isn't
/// silent.
pub const OLD_AFTER: DurNs = DurNs(2_000_000_000);

/// Reason for which a position is doubtful.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PositionDoubt {
    /// The cable counter isn't trusted.
    Cable,
    /// The position error between passes is larger than the advice allows for.
    Spread,
}

impl PositionDoubt {
    /// Word used for the doubt in JSON.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Cable => "cable",
            Self::Spread => "spread",
        }
    }
}

/// Availability of a position.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum PositionState {
    /// There is no position, for this reason.
    None(NoFix),
    /// There is a position, but samples placed by it are doubtful, for this reason.
    Doubtful(PositionDoubt),
    /// The position is reliable.
    Ok,
}

impl PositionState {
    /// Word used for the availability in JSON: `none`, `doubtful` or `ok`.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::None(_) => "none",
            Self::Doubtful(_) => "doubtful",
            Self::Ok => "ok",
        }
    }

    /// Number used for the availability in published data.
    pub(crate) fn number(self) -> u64 {
        match self {
            Self::Ok => 0,
            Self::Doubtful(doubt) => 1 + doubt as u64,
            Self::None(no_fix) => 3 + no_fix as u64,
        }
    }
}

/// An observation that applies at present.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct ActiveObservation {
    pub(crate) kind: ObservedKind,
    /// The distrusted head, or the velocity log that the cable counter differs from.
    pub(crate) source: Option<SourceId>,
    pub(crate) occurrences: Occurrences,
}

/// List of all observations that apply at present.
pub(crate) type ActiveObservations = [Option<ActiveObservation>; MOST_OBSERVATIONS];

/// Slowest practical speed, m/s. A lower advised speed counts as no speed.
pub const LEAST_MPS: f64 = 0.005;

/// Speed below which the vehicle counts as driving back, m/s.
pub(crate) const ASTERN_MPS: f64 = -0.02;

/// State of a sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SensorState {
    /// No reading has arrived so far.
    Never,
    /// No reading has arrived for longer than [`OLD_AFTER`].
    Silent,
    /// Packets arrive, but all readings in them have been withheld for longer than [`OLD_AFTER`].
    Withheld,
    /// The sensor is a head whose readings all come from one angle.
    Stalled,
    /// The sensor is a head that turns and pings without detecting the wall.
    Deaf,
    /// The sensor repeats its last reading.
    Hung,
    /// The sensor is a head that is distrusted.
    Distrusted,
    /// The sensor's readings arrive.
    Ok,
}

impl SensorState {
    /// Word used for the sensor's state in JSON.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Never => "never",
            Self::Silent => "silent",
            Self::Withheld => "withheld",
            Self::Stalled => "stalled",
            Self::Deaf => "deaf",
            Self::Hung => "hung",
            Self::Distrusted => "distrusted",
            Self::Ok => "ok",
        }
    }
}

/// The live state. Speeds are in m/s, lengths in m.
#[derive(Debug, Clone, Copy, PartialEq, Resource)]
pub struct LiveState {
    /// End of the tick that published the state. Ages are measured up to this time.
    pub now: MonoNs,
    /// Time of the advice update that made the state; `None` before the first update.
    pub at: Option<MonoNs>,
    /// Availability of a position.
    pub position: PositionState,
    /// Chainage of the vehicle; `None` without a position.
    pub chainage_m: Option<f64>,
    /// Standard deviations of the pose; `None` if the navigation method provides none.
    pub sd: Option<PoseSd>,
    /// Standard deviation of the position at one pass of a head relative to the next pass.
    pub pass_sd_m: f64,
    /// Time for which the vehicle should stay stationary to find the gyros' bias, s; 0 if that isn't needed.
    ///
    /// Soon after this time the heading is known.
    pub stand_s: u32,
    /// Speed along the tunnel, positive inwards; `None` without a position.
    pub speed_mps: Option<f64>,
    /// Band of the speed at the previous update.
    pub last_band: SpeedBand,
    /// Speed advice at the last update; `None` before the first.
    pub advice: Option<Advice>,
    /// Largest speed advised when the position was last reliable; `None` if it never was.
    pub sure_v_max_mps: Option<f64>,
    /// Coverage target, with the confidence of verdicts.
    pub target: Target,
    /// Length of the tunnel, m.
    pub length_m: f64,
    /// Largest distance of a head ahead of or behind the vehicle's origin, m.
    pub heads_reach_m: f64,
    /// Length of each verdict within the coverage extent.
    pub metres: Metres,
    /// Chainage at which the first missed stretch begins, m; `None` if no stretch is missed.
    pub missed_from_m: Option<f64>,
    /// Last judged stretch without a verdict.
    pub unsure: Option<Stretch>,
    /// Whether every part of the wall visible to the heads here has the verdict pass. The vehicle's chainage
    /// and the verdicts decide this.
    pub passed: bool,
    /// Chainage to which the vehicle goes back for a missed stretch, m; `None` unless the vehicle is on the
    /// way there.
    pub back_to_m: Option<f64>,
    /// Plan for the rest of the dive; `None` without a position or without missed stretches.
    pub plan: Option<DivePlan>,
    /// Observations about the dive that apply at present.
    pub(crate) observations: ActiveObservations,
    /// Bitmask of the sources that are profiling heads.
    pub heads: u64,
    /// Bitmask of the sources of turning heads.
    pub turning: u64,
    /// Bitmask of the sources of heads that turn and ping without detecting the wall.
    pub deaf: u64,
    /// Bitmask of the sources that repeat a reading.
    pub hung: u64,
    /// Number of sources of the dive.
    pub sources: u16,
    /// Receive time of each source's last reading.
    pub heard: [Option<MonoNs>; MAX_SOURCES],
    /// Packets of each source since its last reading.
    pub(crate) unread: [Option<UnreadSpan>; MAX_SOURCES],
}

stateful!(LiveState {
    state: now, at, position, chainage_m, sd, pass_sd_m, stand_s, speed_mps, last_band, advice, sure_v_max_mps, metres, missed_from_m, unsure, passed, back_to_m, plan, observations, turning, deaf, hung;
    slots: heard, unread;
    fixed: target, length_m, heads_reach_m, heads, sources;
});

impl LiveState {
    /// State before the first advice update, in a tunnel of unlimited length.
    pub(crate) fn new(target: Target, heads: u64, sources: u16) -> Self {
        Self {
            now: MonoNs(0),
            at: None,
            position: PositionState::None(NoFix::Heading),
            chainage_m: None,
            sd: None,
            pass_sd_m: 0.0,
            stand_s: 0,
            speed_mps: None,
            last_band: SpeedBand::default(),
            advice: None,
            sure_v_max_mps: None,
            target,
            length_m: f64::INFINITY,
            heads_reach_m: 0.0,
            metres: Metres::default(),
            missed_from_m: None,
            unsure: None,
            passed: false,
            back_to_m: None,
            plan: None,
            observations: [None; MOST_OBSERVATIONS],
            heads,
            turning: 0,
            deaf: 0,
            hung: 0,
            sources,
            heard: [None; MAX_SOURCES],
            unread: [None; MAX_SOURCES],
        }
    }

    /// Chainage of the tunnel's end if all heads are beyond this end, m; `None` if a head may be inside the tunnel.
    pub fn outside_m(&self) -> Option<f64> {
        let x_m = self.chainage_m?;
        let beyond = x_m > self.length_m + self.heads_reach_m;
        let before = x_m < -self.heads_reach_m;
        if beyond { Some(self.length_m) } else { before.then_some(0.0) }
    }

    /// Age of the state; `None` before the first advice update.
    pub fn age(&self) -> Option<DurNs> {
        self.at.map(|at| DurNs(self.now.since(at).0.max(0)))
    }

    /// Whether the state is shown as stale.
    pub fn is_old(&self) -> bool {
        self.age().is_some_and(|age| age.0 > OLD_AFTER.0)
    }

    /// Age of a source's last reading; `None` if there is none.
    pub fn age_of(&self, source: usize) -> Option<DurNs> {
        self.heard.get(source).copied().flatten().map(|heard| DurNs(self.now.since(heard).0.max(0)))
    }

    /// Records that a source delivered a reading at this time.
    pub(crate) fn hear(&mut self, source: SourceId, at: MonoNs) {
        if let Some(slot) = self.heard.get_mut(source.index()) {
            *slot = Some(at);
        }
        if let Some(slot) = self.unread.get_mut(source.index()) {
            *slot = None;
        }
    }

    /// Records that a packet gave no reading.
    pub(crate) fn hear_unread(&mut self, packet: &UnreadPacket) {
        let Some(slot) = self.unread.get_mut(packet.source.index()) else { return };
        let before = slot.filter(|span| (0..=OLD_AFTER.0).contains(&packet.received.since(span.to).0));
        *slot = Some(UnreadSpan::after(before, packet));
    }

    /// Withheld readings of a source whose packets have given no reading for longer than [`OLD_AFTER`].
    ///
    /// Once a sensor has delivered readings, messages of other devices on its line don't count.
    pub fn withheld(&self, source: usize) -> Option<WithheldReadings> {
        let UnreadSpan { from, to, readings } = self.unread.get(source).copied().flatten()?;
        // Since the last reading, so that a sensor is never called silent before it is called withheld.
        let since = self.heard.get(source).copied().flatten().unwrap_or(from);
        let is_long = self.now.since(since).0 > OLD_AFTER.0 && self.now.since(to).0 <= OLD_AFTER.0;
        let may_be_others =
            matches!(readings.reason, WithheldReason::NoMessage | WithheldReason::OtherDevice);
        (is_long && !(may_be_others && self.age_of(source).is_some())).then_some(readings)
    }

    /// State of the sensor with this source.
    pub fn sensor(&self, source: usize) -> SensorState {
        let bit = |set: u64| {
            u32::try_from(source).is_ok_and(|source| set.checked_shr(source).unwrap_or(0) & 1 == 1)
        };
        let distrusted = |known: &ActiveObservation| known.source.is_some_and(|of| of.index() == source);
        let has_reading = self.age_of(source).is_some_and(|age| age.0 <= OLD_AFTER.0);
        match self.age_of(source) {
            _ if !has_reading && self.withheld(source).is_some() => SensorState::Withheld,
            None => SensorState::Never,
            Some(_) if !has_reading => SensorState::Silent,
            Some(_) if self.observations.iter().flatten().any(distrusted) => SensorState::Distrusted,
            Some(_) if bit(self.deaf) => SensorState::Deaf,
            Some(_) if bit(self.hung) => SensorState::Hung,
            Some(_) if self.at.is_some() && bit(self.heads) && !bit(self.turning) => SensorState::Stalled,
            Some(_) => SensorState::Ok,
        }
    }

    /// Sensors that never delivered a reading or are silent, in the order of sources.
    pub fn silent(&self) -> impl Iterator<Item = usize> + '_ {
        let is_silent =
            |source: &usize| matches!(self.sensor(*source), SensorState::Never | SensorState::Silent);
        (0..usize::from(self.sources)).filter(is_silent)
    }

    /// Sensors that are in the given state, in the order of sources.
    pub fn sensors_that_are(&self, state: SensorState) -> impl Iterator<Item = usize> + '_ {
        (0..usize::from(self.sources)).filter(move |source| self.sensor(*source) == state)
    }

    /// Whether a profiling head delivers readings.
    pub fn has_sonar(&self) -> bool {
        let is_heard = |source: usize| self.age_of(source).is_some_and(|age| age.0 <= OLD_AFTER.0);
        (0..usize::from(self.sources)).any(|source| self.heads >> source & 1 == 1 && is_heard(source))
    }

    /// Largest speed advised, m/s; `None` if there is none.
    ///
    /// While the position is doubtful, the advice may rise with the position error, since less time between passes
    /// means a smaller error. A pilot must not be told to go faster then.
    pub fn v_max_mps(&self) -> Option<f64> {
        let advice = self.advice.as_ref().filter(|advice| advice.reason == Reason::HelixPitch)?;
        let sure_mps = self.sure_v_max_mps.filter(|_| self.position != PositionState::Ok);
        let v_max_mps = sure_mps.map_or(advice.v_max_mps, |sure_mps| sure_mps.min(advice.v_max_mps));
        Some(v_max_mps).filter(|v_max_mps| *v_max_mps >= LEAST_MPS)
    }

    /// The speed relative to v_max.
    pub(crate) fn speed_band(&self) -> SpeedBand {
        let share =
            self.speed_mps.zip(self.v_max_mps()).map_or(0.0, |(mps, v_max_mps)| mps.abs() / v_max_mps);
        SpeedBand::after(self.last_band, share)
    }

    /// Whether the vehicle drives back towards the portal.
    pub fn is_driving_back(&self) -> bool {
        self.speed_mps.is_some_and(|speed_mps| speed_mps < ASTERN_MPS)
    }

    /// Share of lost returns; `None` unless lost returns reduce the largest speed by at least a fifth.
    pub fn lost_share(&self) -> Option<f64> {
        /// Limit: share of the speed that remains if lost returns reduce the speed by a fifth.
        const LEFT: f64 = 0.8;
        let advice = self.advice.as_ref().filter(|_| self.v_max_mps().is_some())?;
        let margins = advice.margins?;
        (margins.losses_mps < LEFT * margins.position_mps).then_some(advice.lost_share)
    }

    /// Bitmask of the kinds of observations that apply at present.
    pub(crate) fn observation_bits(&self) -> u64 {
        self.observations.iter().flatten().fold(0, |bits, known| bits | 1 << known.kind as u64)
    }
}

/// Bitmask of the sources that belong to a set of heads. `sources` lists the source of each head, in order of
/// head number.
pub(crate) fn source_bits(sources: impl Iterator<Item = SourceId>, of: HeadSet) -> u64 {
    let numbered = sources.enumerate().filter(|(head, _)| of.has(*head));
    numbered.fold(0, |bits, (_, source)| bits | 1 << u64::from(source.0 % 64))
}
