//! Speed advice.

use bevy_ecs::prelude::{Res, ResMut, Resource};

use crate::advice_log::{AdviceEntry, AdviceLog};
use crate::messages::{AdviceList, Notice, Notices, Placed, PlacedList};
use crate::resources::{Digests, Tally};
use crate::result_stream::{RecordKind, ResultStream};
use headrace_geometry::frames::Vec3;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sampling::advice::{self, Advice, Hysteresis, Remedy};
use headrace_sampling::passes::{Phasing, Situation};
use headrace_sampling::swing::{Looks, Swing};
use headrace_snapshot::stateful;

/// The least speed at which heads apart along the hull are taken to follow each other, m/s.
const SLOWEST_MPS: f64 = 0.05;

/// At this speed or faster a vehicle is under way, m/s.
const UNDER_WAY_MPS: f64 = 0.02;

/// The advisor, and the time limit of the dive from its first packet.
#[derive(Debug, Clone, Resource)]
pub(crate) struct Advisor {
    pub(crate) advisor: advice::Advisor,
    pub(crate) dive_time: Option<DurNs>,
    looks: Looks,
    hysteresis: Hysteresis,
    /// It went backwards when it was last under way.
    astern: bool,
}

stateful!(Advisor { state: advisor, looks, hysteresis, astern; fixed: dive_time; });

impl Advisor {
    /// Allocates: all that it will ever use.
    pub(crate) fn new(advisor: advice::Advisor, target_m: f64, dive_time: Option<DurNs>) -> Self {
        Self {
            advisor,
            dive_time,
            looks: Looks::default(),
            hysteresis: Hysteresis::new(target_m),
            astern: false,
        }
    }

    /// The advice at each beat of a tick, in order; `begun` is the receive time of the first packet.
    pub(crate) fn fill(&mut self, placed: &[Placed], begun: Option<MonoNs>, list: &mut Vec<Advice>) {
        list.clear();
        for item in placed {
            let Placed::Situation(at, situation, _) = item else { continue };
            list.push(self.advise(*at, situation, begun));
        }
    }

    /// Advice to show at a beat; `begun` is the receive time of the first packet.
    fn advise(&mut self, at: MonoNs, situation: &Situation, begun: Option<MonoNs>) -> Advice {
        let left = self.dive_time.zip(begun).map(|(time, begun)| (time - at.since(begun)).as_secs_f64());
        // On the way back heads apart along the hull are in phase at other speeds, which don't hold any more once it goes on.
        let astern = situation.speed_mps < 0.0;
        if situation.speed_mps.abs() > UNDER_WAY_MPS && astern != self.astern {
            self.astern = astern;
            self.hysteresis.forget();
        }
        let advice = self.advisor.advise(situation, swing(&mut self.looks, at, situation), left);
        self.hysteresis.show(at, advice)
    }
}

/// Swing of the vehicle between two passes.
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

/// Finds the advice at each beat. Without an advisor it has come with the tick: see [`crate::split`].
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
