//! Speed advice.

use bevy_ecs::prelude::{Res, ResMut, Resource};

use crate::advice_log::{AdviceEntry, AdviceLog};
use crate::messages::{AdviceList, Notice, Notices, Placed, PlacedList};
use crate::resources::{Digests, Tally};
use crate::result_stream::{RecordKind, ResultStream};
use headrace_geometry::frames::Vec3;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sampling::advice::{self, Advice, Hysteresis, Remedy};
use headrace_sampling::passes::{Phasing, Situation};
use headrace_sampling::swing::{Looks, Swing};

/// Minimum speed assumed for heads apart along the hull, m/s. It limits the time between their visits of a
/// place.
const SLOWEST_MPS: f64 = 0.05;

/// The advisor, and the maximum duration of the dive from its first packet.
#[derive(Debug, Clone, Resource)]
pub(crate) struct Advisor {
    pub(crate) advisor: advice::Advisor,
    pub(crate) dive_time: Option<DurNs>,
    looks: Looks,
    hysteresis: Hysteresis,
}

stateful!(Advisor { state: advisor, looks, hysteresis; fixed: dive_time; });

impl Advisor {
    /// Allocates: at startup, all memory of the advisor.
    pub(crate) fn new(advisor: advice::Advisor, target_m: f64, dive_time: Option<DurNs>) -> Self {
        Self { advisor, dive_time, looks: Looks::default(), hysteresis: Hysteresis::new(target_m) }
    }

    /// Computes the advice for each update of a tick, in order. `begun` is the receive time of the first
    /// packet.
    pub(crate) fn fill(&mut self, placed: &[Placed], begun: Option<MonoNs>, list: &mut Vec<Advice>) {
        list.clear();
        for item in placed {
            let Placed::Situation(at, situation, _) = item else { continue };
            list.push(self.advise(*at, situation, begun));
        }
    }

    /// Advice to show at an update. `begun` is the receive time of the first packet.
    fn advise(&mut self, at: MonoNs, situation: &Situation, begun: Option<MonoNs>) -> Advice {
        let left = self.dive_time.zip(begun).map(|(time, begun)| (time - at.since(begun)).as_secs_f64());
        let was_astern = self.advisor.is_astern();
        let advice = self.advisor.advise(situation, swing(&mut self.looks, at, situation), left);
        // On the way back, heads apart along the hull are in phase at other speeds. Advice from before the
        // vehicle turned round is no longer valid.
        if self.advisor.is_astern() != was_astern {
            self.hysteresis.forget();
        }
        self.hysteresis.show(at, advice)
    }
}

/// Rotation of the vehicle between two passes.
fn swing(looks: &mut Looks, at: MonoNs, situation: &Situation) -> Swing {
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

/// Computes the advice for each update.
///
/// Without an advisor, the advice has come with the tick: see [`crate::split`].
pub(super) fn find(
    placed: Res<'_, PlacedList>,
    tally: Res<'_, Tally>,
    advisor: Option<ResMut<'_, Advisor>>,
    mut list: ResMut<'_, AdviceList>,
) {
    let Some(mut advisor) = advisor else { return };
    advisor.fill(&placed.0, tally.span.map(|(first, _)| first), &mut list.0);
}

/// Publishes the advice.
pub(super) fn tell(
    placed: Res<'_, PlacedList>,
    list: Res<'_, AdviceList>,
    mut log: ResMut<'_, AdviceLog>,
    mut notices: ResMut<'_, Notices>,
    mut digests: ResMut<'_, Digests>,
) {
    let situations = placed.0.iter().filter_map(|item| match item {
        Placed::Situation(at, situation, _) => Some((at, situation)),
        Placed::Ping(_) => None,
    });
    for ((at, situation), advice) in situations.zip(&list.0) {
        let advice = *advice;
        digest(&mut digests.advice, *at, &advice);
        let chainage_m = situation.pose.map(|pose| pose.position.x());
        let entry = AdviceEntry { at: *at, chainage_m, speed_mps: situation.speed_mps, advice };
        log.take(&entry);
        notices.0.push(Notice::Advice(entry));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{mount, pinged, pipe, pose, situation, task};
    use crate::messages::Doubts;
    use headrace_geometry::frames::{Mount, Pose, Rot};
    use headrace_geometry::math;
    use headrace_sampling::head::{HeadBody, HeadMotion, HeadSpec};

    fn at(seconds: f64) -> MonoNs {
        MonoNs(0) + DurNs::from_secs_f64(seconds)
    }

    /// Two heads that turn in 8 s. Along the hull they are this far apart, m.
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
    fn every_update_within_a_tick_gets_advice_with_the_time_left() {
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
        let doubts = Doubts { cable: None, setting: None, stand_s: 0, hung: 0 };
        let beat = |seconds: f64| Placed::Situation(at(seconds), two_heads(0.0), doubts);
        let placed = [beat(30.0), Placed::Ping(pinged(5.0, 1.0)), beat(30.2)];
        let left_s = |dive_s: Option<f64>, begun_s: Option<f64>| {
            let (mut advisor, mut list) = (new(dive_s.map(DurNs::from_secs_f64)), Vec::new());
            for _ in 0..2 {
                advisor.fill(&placed, begun_s.map(at), &mut list);
            }
            list.iter().map(|advice| advice.left.time_s).collect::<Vec<_>>()
        };
        assert_eq!(left_s(Some(100.0), Some(10.0)), [Some(80.0), Some(79.8)], "only of this tick");
        assert_eq!(left_s(None, Some(10.0)), [None, None]);
        assert_eq!(left_s(Some(100.0), None), [None, None], "the dive hasn't begun");
    }

    /// The vehicle yaws by 0.01 rad/s. Heads 180 degrees apart pass every 4 s. At 0.1 m/s, heads 0.8 m apart
    /// reach the same place 8 s after one another.
    #[test]
    fn swing_is_measured_between_passes_and_between_heads_along_the_hull() {
        let swung = |apart_m: f64, speed_mps: f64| {
            let mut looks = Looks::default();
            let mut last = Swing::default();
            for beat in 0..150 {
                let seconds = 0.2 * f64::from(beat);
                let attitude = Rot::from_roll_pitch_yaw(0.0, 0.0, 0.01 * seconds);
                let pose = Some(Pose { attitude, ..pose(5.0) });
                let turned = Situation { pose, speed_mps, ..two_heads(apart_m) };
                last = swing(&mut looks, at(seconds), &turned);
            }
            last
        };
        // The tolerance is one update.
        let near = |found: f64, expected: f64| (found - expected).abs() < 0.05 * expected;
        for (apart_m, speed_mps) in [(0.8, 0.1), (0.8, -0.1), (0.8, 0.2)] {
            let found = swung(apart_m, speed_mps);
            assert!(near(found.rate_radps, 0.01) && near(found.apart_rate_radps, 0.01), "{found:?}");
        }
        let side_by_side = swung(0.0, 0.1);
        assert!(near(side_by_side.rate_radps, 0.01) && side_by_side.apart_rate_radps.abs() <= 0.0);
        // For a stationary vehicle a speed of 0.05 m/s is assumed, so the heads are 16 s apart. Only the last
        // half minute counts.
        let at_rest = swung(0.8, 0.0);
        assert!(near(at_rest.apart_rate_radps, 0.01) && near(at_rest.most_rad, 0.298), "{at_rest:?}");
    }
}
