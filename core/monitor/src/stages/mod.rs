//! Systems of the core, one file per stage.

#![allow(clippy::needless_pass_by_value, reason = "bevy hands systems their arguments by value")]

mod advise;
mod alerting;
mod cover;
mod decode;
mod doubt;
mod driving;
mod georeference;
mod judge;
mod lacking;
mod live;
mod navigate;
mod samples;
mod sound_speed;
mod walls;
mod way;

use bevy_ecs::schedule::{IntoScheduleConfigs, Schedule};

use super::stage::Stage;

pub(super) use advise::Advisor;
pub(super) use alerting::RunInputs;
pub(super) use driving::Driving;
pub(super) use judge::{Results, judge_one};
pub(super) use sound_speed::SoundSpeed;
pub(super) use walls::end_returns;

/// Adds the core's systems to their stages.
pub(super) fn add(schedule: &mut Schedule) {
    add_placing(schedule);
    schedule.add_systems((
        cover::cover.in_set(Stage::Cover),
        (advise::find, advise::tell, live::live).chain().in_set(Stage::Advise),
    ));
}

/// Adds the systems that place pings.
pub(super) fn add_placing(schedule: &mut Schedule) {
    schedule.add_systems((
        decode::decode.in_set(Stage::Decode),
        navigate::navigate.in_set(Stage::Navigate),
        georeference::georeference.in_set(Stage::Georeference),
    ));
}
