//! How fast one may go.

use bevy_ecs::prelude::{Res, ResMut, Resource};

use crate::app::flow::{AdviceEntry, AdviceLog, Digests, Notice, Notices, Place, Placed, PlacedList};
use crate::sampling::advice::{self, StepMemory};

/// What is remembered from one advice to the next.
#[derive(Debug, Clone, Copy, Default, Resource)]
pub(in crate::app) struct Advisor(StepMemory);

pub(super) fn advise(
    placed: Res<'_, PlacedList>,
    context: Res<'_, Place>,
    mut advisor: ResMut<'_, Advisor>,
    mut log: ResMut<'_, AdviceLog>,
    mut notices: ResMut<'_, Notices>,
    mut digests: ResMut<'_, Digests>,
) {
    for item in &placed.0 {
        let Placed::Situation(at, situation) = item else { continue };
        let advice = advice::advise(situation, &context.profile, context.target_m, &mut advisor.0);
        digests.advice.integer(at.0).number(advice.v_max_mps).integer(advice.reason as u64);
        let chainage_m = situation.pose.map(|pose| pose.position.x());
        let entry = AdviceEntry { at: *at, chainage_m, speed_mps: situation.speed_mps, advice };
        log.take(entry);
        notices.0.push(Notice::Advice(entry));
    }
}
