//! The adviser: the ECS world that computes the speed advice at each update.
//!
//! Advice depends only on the situation of the vehicle and its heads, not on the verdicts.

#![allow(clippy::needless_pass_by_value, reason = "bevy hands systems their arguments by value")]

use std::sync::Arc;

use bevy_ecs::prelude::{Res, ResMut, Resource};

use super::advice_log::{AdviceEntry, AdviceLog};
use super::error::PluginError;
use super::merge::MAX_TICK_PACKETS;
use super::part::Part;
use super::placer::{Placed, PlacedTick};
use super::result_stream::{RecordKind, ResultStream};
use super::stage::AdviseStage;
use headrace_geometry::frames::Vec3;
use headrace_geometry::snapshot::{Restorer, Saver, SnapshotError, Stateful, stateful};
use headrace_geometry::time::{DiveClock, DurNs, MonoNs};
use headrace_sampling::advice::{self, Advice, Hysteresis, Remedy, ReturningHeads};
use headrace_sampling::passes::{Phasing, Situation};
use headrace_sampling::swing::{Looks, Swing};

/// Lowest speed for which the delay between two heads at different places along the hull is computed, m/s. It is
/// assumed for slower vehicles, because the delay grows without bound as the speed falls.
const SLOWEST_MPS: f64 = 0.05;

/// Part of the loop that computes the advice.
pub struct Adviser {
    part: Part<AdviseStage>,
    /// Empty placer results. The adviser holds them between two ticks, so that it holds no results of a past tick.
    nothing: Arc<Placed>,
}

/// Advice computed in one tick.
///
/// The list is reused from tick to tick. The list of a default value grows as needed.
#[derive(Debug, Default)]
pub struct Advised {
    /// Advice at each update, in order.
    pub entries: Vec<AdviceEntry>,
    pub(super) stream: ResultStream,
}

impl Advised {
    /// Returns the advice of an empty tick that follows this tick.
    pub(super) fn followed_by_nothing(&self) -> Self {
        let mut stream = self.stream.clone();
        stream.next_tick();
        Self { entries: Vec::new(), stream }
    }
}

/// Advice at each update of this tick, in order.
#[derive(Debug, Default, Resource)]
struct AdviceList(Vec<AdviceEntry>);

/// Result stream of the speed advice.
#[derive(Debug, Default, Resource)]
struct AdviceStream(ResultStream);

impl Stateful for AdviceStream {
    fn save(&self, to: &mut Saver) {
        self.0.save(to);
    }

    fn restore(&mut self, from: &mut Restorer<'_>) -> Result<(), SnapshotError> {
        self.0.restore(from)
    }
}

/// The advisor, and the maximum duration of the dive from its first packet.
#[derive(Debug, Clone, Resource)]
pub(super) struct Advisor {
    advisor: advice::Advisor,
    dive_time: Option<DurNs>,
    looks: Looks,
    returning: ReturningHeads,
    hysteresis: Hysteresis,
}

stateful!(Advisor { state: advisor, looks, returning, hysteresis; fixed: dive_time; });

impl Adviser {
    /// Creates the adviser. `keeps_results` says whether its stream keeps the contents of each tick.
    ///
    /// Errors: the order of two systems is ambiguous.
    pub(super) fn new(
        mut part: Part<AdviseStage>,
        advisor: Advisor,
        keeps_results: bool,
    ) -> Result<Self, PluginError> {
        let mut stream = ResultStream::default();
        if keeps_results {
            stream.keep();
        }
        let nothing = Arc::default();
        part.insert_resource(PlacedTick(Arc::clone(&nothing)));
        part.insert_resource(AdviceList::default());
        part.insert_state("advisor", advisor);
        part.insert_state("history of advice", AdviceLog::default());
        part.insert_state("stream of advice", AdviceStream(stream));
        part.add_systems(AdviseStage::Advise, advise);
        part.initialize()?;
        Ok(Self { part, nothing })
    }

    /// Computes the advice of a tick. Must be called once for each tick, in order.
    ///
    /// Allocates: never, if the list has room.
    pub fn tick(&mut self, placed: &Arc<Placed>, into: &mut Advised) {
        let Self { part, nothing } = self;
        part.world.resource_mut::<AdviceStream>().0.next_tick();
        if placed.updates().next().is_none() {
            into.entries.clear();
        } else {
            core::mem::swap(&mut part.world.resource_mut::<AdviceList>().0, &mut into.entries);
            part.world.resource_mut::<PlacedTick>().0 = Arc::clone(placed);
            part.run(AdviseStage::Advise);
            part.world.resource_mut::<PlacedTick>().0 = Arc::clone(nothing);
            core::mem::swap(&mut part.world.resource_mut::<AdviceList>().0, &mut into.entries);
        }
        self.report(into);
    }

    /// Creates the advice result that readers see before the first tick, with room for the advice of a tick of any
    /// size.
    /// Allocates: all memory of the list.
    pub(super) fn advised_with_room(&self) -> Advised {
        let mut advised = Advised { entries: Vec::with_capacity(MAX_TICK_PACKETS), ..Advised::default() };
        advised.stream.reserve_as(&self.part.world.resource::<AdviceStream>().0);
        self.report(&mut advised);
        advised
    }

    /// Copies the state that other parts of the loop read.
    pub(super) fn report(&self, into: &mut Advised) {
        into.stream.follow(&self.part.world.resource::<AdviceStream>().0);
    }

    /// History of the speed advice.
    pub fn log(&self) -> &AdviceLog {
        self.part.world.resource()
    }

    pub(super) fn save(&self, to: &mut Saver) {
        self.part.save(to);
    }

    pub(super) fn restore(&mut self, from: &mut Restorer<'_>) -> Result<(), SnapshotError> {
        self.part.restore(from)
    }
}

/// Computes the advice for each update.
fn advise(
    placed: Res<'_, PlacedTick>,
    mut advisor: ResMut<'_, Advisor>,
    mut log: ResMut<'_, AdviceLog>,
    mut list: ResMut<'_, AdviceList>,
    mut stream: ResMut<'_, AdviceStream>,
) {
    list.0.clear();
    for update in placed.updates() {
        let (at, situation) = (update.at, &update.situation);
        let advice = advisor.advise(at, situation, placed.clock);
        debug_assert!(
            advice.v_max_mps.is_finite() && advice.v_max_mps >= 0.0,
            "advised {} m/s",
            advice.v_max_mps
        );
        digest(&mut stream.0, at, &advice);
        let chainage_m = situation.pose.map(|pose| pose.position.x());
        let entry = AdviceEntry { at, chainage_m, speed_mps: situation.speed_mps, advice };
        log.take(&entry);
        list.0.push(entry);
    }
}

impl Advisor {
    /// Creates the state of the advisor. Allocates: at startup, all memory of the advisor.
    pub(super) fn new(advisor: advice::Advisor, target_m: f64, dive_time: Option<DurNs>) -> Self {
        let (looks, returning) = (Looks::default(), ReturningHeads::default());
        Self { advisor, dive_time, looks, returning, hysteresis: Hysteresis::new(target_m) }
    }

    /// Advice to show at an update.
    fn advise(&mut self, at: MonoNs, situation: &Situation, clock: DiveClock) -> Advice {
        let left = self.dive_time.map(|all| (all - clock.time(at)).as_secs_f64());
        let was_astern = self.advisor.is_astern();
        let situation = &self.returning.left_out(at, situation);
        let advice = self.advisor.advise(situation, swing(&mut self.looks, at, situation), left);
        // Heads at different places along the hull are in phase at other speeds when the vehicle goes back than
        // when it goes forward. Advice from before the reversal is no longer valid.
        if self.advisor.is_astern() != was_astern {
            self.hysteresis.forget();
        }
        self.hysteresis.show(at, Phasing::of(situation).in_step(), advice)
    }
}

/// Rotation of the vehicle between two passes of heads over the same wall.
fn swing<'a>(looks: &'a mut Looks, at: MonoNs, situation: &Situation) -> Swing<'a> {
    if let Some(pose) = situation.pose {
        looks.keep(at, pose.attitude * Vec3::new(1.0, 0.0, 0.0));
    }
    let phasing = Phasing::of(situation);
    let passes = phasing.at(situation.speed_mps);
    let apart_s = phasing.apart_m() / situation.speed_mps.abs().max(SLOWEST_MPS);
    looks.swing(at, passes.gap_s(passes.heads()).unwrap_or(0.0), apart_s)
}

fn digest(stream: &mut ResultStream, at: MonoNs, advice: &Advice) {
    let [width_m, arc_m] = advice.unseen_m.unwrap_or_default();
    stream
        .record(RecordKind::Advice)
        .integer(at.0)
        .number(advice.v_max_mps)
        .integer(advice.reason as u64)
        .integer(u64::from(advice.will_exceed))
        .number(advice.phase_error_rad.unwrap_or(0.0))
        .number(advice.t_y_m)
        .number(width_m)
        .number(arc_m)
        .integer(advice.remedy.map_or(0, Remedy::number))
        .text(if let Some(Remedy::Mode(name)) = &advice.remedy { name.as_str() } else { "" });
    for other in advice.alternatives.iter().flatten() {
        stream.number(other.v_max_mps);
    }
}

#[cfg(test)]
mod tests {
    use core::any::TypeId;

    use super::*;
    use crate::fixtures::{armed, mount, pinged, pipe, pose, situation, task};
    use crate::messages::{Doubts, PlacedItem, Placement, Update};
    use headrace_fusion::NoFix;
    use headrace_geometry::frames::{Mount, Pose, Rot};
    use headrace_geometry::math;
    use headrace_sampling::head::{HeadBody, HeadMotion, HeadSpec};

    fn at(seconds: f64) -> MonoNs {
        MonoNs(0) + DurNs::from_secs_f64(seconds)
    }

    /// Situation of two heads that turn in 8 s and are mounted `apart_m` metres apart along the hull.
    fn two_heads(apart_m: f64) -> Situation {
        let mut situation = Situation { configured: 2, ..situation(Some(5.0)) };
        for (number, slot) in situation.heads.iter_mut().take(2).enumerate() {
            *slot = Some(HeadMotion {
                mount: Mount {
                    position: Vec3::new(apart_m * number as f64, 0.0, 0.0),
                    rotation: Rot::identity(),
                },
                angle_rad: math::TAU / 2.0 * number as f64,
                rate_radps: math::TAU / 8.0,
                step_rad: 0.0157,
                sector_rad: None,
            });
        }
        situation
    }

    #[test]
    fn advice_at_each_update_states_the_dive_time_left_at_that_update() {
        let head = HeadSpec {
            mount: mount(),
            step_rad: 0.0157,
            ping_period_s: 0.02,
            range_m: [0.2, 10.0],
            sound_speed_mps: 1447.0,
            beam_rad: 0.024,
            body: HeadBody { radius_m: 0.0, ahead_m: 0.0, behind_m: 0.0 },
        };
        let heads = [(head, Vec::new()), (head, Vec::new())];
        let new =
            |dive_time| Advisor::new(advice::Advisor::new(&pipe(), task(), &heads, &[]), 0.5, dive_time);
        let doubts = Doubts { cable: None, setting: None, unverified_mounts: false, stand_s: 0, hung: 0 };
        let update = |seconds: f64| {
            let (fix, situation) = (Err(NoFix::Heading), two_heads(0.0));
            Placement::Update(Update { at: at(seconds), situation, doubts, fix, sd: None })
        };
        let placed = [update(30.0), Placement::Ping(pinged(5.0, 1.0)), update(30.2)];
        let left_s = |dive_s: Option<f64>, begun_s: Option<f64>| {
            let advisor = new(dive_s.map(DurNs::from_secs_f64));
            let mut adviser = Adviser::new(Part::new(), advisor, false).unwrap();
            let clock = DiveClock::new(begun_s.map(at));
            let items = placed.map(|placement| PlacedItem { event: 0, placement }).to_vec();
            let placed = Arc::new(Placed { items, clock, ..Placed::default() });
            let mut advised = Advised::default();
            for _ in 0..2 {
                adviser.tick(&placed, &mut advised);
            }
            advised.entries.iter().map(|entry| entry.advice.left.time_s).collect::<Vec<_>>()
        };
        assert_eq!(left_s(Some(100.0), Some(10.0)), [Some(80.0), Some(79.8)], "entries of this tick only");
        assert_eq!(left_s(None, Some(10.0)), [None, None]);
        assert_eq!(left_s(Some(100.0), None), [Some(100.0); 2], "the dive hasn't begun");
    }

    /// The vehicle yaws by 0.01 rad/s. Two heads at opposite angles turn in 8 s, so one of them passes any place every
    /// 4 s. At 0.1 m/s, the rear one of two heads 0.8 m apart reaches a place 8 s after the front one.
    #[test]
    fn swing_covers_the_time_between_passes_and_the_delay_between_heads() {
        let swung = |apart_m: f64, speed_mps: f64| {
            let mut looks = Looks::default();
            let mut last = Swing::default();
            for update in 0..150 {
                let seconds = 0.2 * f64::from(update);
                let attitude = Rot::from_roll_pitch_yaw(0.0, 0.0, 0.01 * seconds);
                let pose = Some(Pose { attitude, ..pose(5.0) });
                let turned = Situation { pose, speed_mps, ..two_heads(apart_m) };
                last = Swing { history: None, ..swing(&mut looks, at(seconds), &turned) };
            }
            last
        };
        // The tolerance of 5 % is one advice update (0.2 s) in the 4 s between two passes.
        let near = |found: f64, expected: f64| (found - expected).abs() < 0.05 * expected;
        for (apart_m, speed_mps) in [(0.8, 0.1), (0.8, -0.1), (0.8, 0.2)] {
            let found = swung(apart_m, speed_mps);
            assert!(near(found.rate_radps, 0.01) && near(found.apart_rate_radps, 0.01), "{found:?}");
        }
        let side_by_side = swung(0.0, 0.1);
        assert!(near(side_by_side.rate_radps, 0.01) && side_by_side.apart_rate_radps.abs() <= 0.0);
        // For a stationary vehicle a speed of 0.05 m/s is assumed, so the second head arrives 16 s after the first
        // head. Only the rotation within the most recent 30 s counts.
        let at_rest = swung(0.8, 0.0);
        assert!(near(at_rest.apart_rate_radps, 0.01) && near(at_rest.most_rad, 0.298), "{at_rest:?}");
    }

    /// The types listed in this test are constant after arming, or are set anew in each tick, so snapshots omit them.
    #[test]
    fn snapshots_contain_all_state_of_the_adviser() {
        let (_, adviser) = armed().split().unwrap();
        adviser.part.has_state_but_for(&[TypeId::of::<AdviceList>(), TypeId::of::<PlacedTick>()]);
    }
}
