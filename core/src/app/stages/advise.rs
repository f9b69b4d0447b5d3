//! How fast one may go.

use bevy_ecs::prelude::{Res, ResMut, Resource};

use crate::app::flow::{AdviceEntry, AdviceLog, Digests, Notice, Notices, Placed, PlacedList, Tally};
use crate::sampling::advice;
use crate::time::DurNs;

/// What gives the advice, and how long the dive may take from its first packet.
#[derive(Debug, Clone, Resource)]
pub(in crate::app) struct Advisor {
    pub(in crate::app) advisor: advice::Advisor,
    pub(in crate::app) dive_time: Option<DurNs>,
}

pub(super) fn advise(
    placed: Res<'_, PlacedList>,
    tally: Res<'_, Tally>,
    mut advisor: ResMut<'_, Advisor>,
    mut log: ResMut<'_, AdviceLog>,
    mut notices: ResMut<'_, Notices>,
    mut digests: ResMut<'_, Digests>,
) {
    let Advisor { advisor, dive_time } = &mut *advisor;
    for item in &placed.0 {
        let Placed::Situation(at, situation) = item else { continue };
        let begun = tally.span.map(|(first, _)| first);
        let left = dive_time.zip(begun).map(|(time, begun)| (time - at.since(begun)).as_secs_f64());
        let advice = advisor.advise(situation, left);
        digests.advice.integer(at.0).number(advice.v_max_mps).integer(advice.reason as u64);
        for other in advice.alternatives.iter().flatten() {
            digests.advice.number(other.v_max_mps);
        }
        let chainage_m = situation.pose.map(|pose| pose.position.x());
        let entry = AdviceEntry { at: *at, chainage_m, speed_mps: situation.speed_mps, advice };
        log.take(&entry);
        notices.0.push(Notice::Advice(entry));
    }
}
