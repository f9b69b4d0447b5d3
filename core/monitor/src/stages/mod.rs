//! Systems of the core, one file per stage.

#![allow(clippy::needless_pass_by_value, reason = "bevy hands systems their arguments by value")]

mod advise;
mod alerting;
mod cover;
mod coverage_extent;
mod decode;
mod driving;
mod georeference;
mod judge;
mod live;
mod missing_samples;
mod navigate;
mod navigation_alerts;
mod outlier_filter;
mod samples;
mod sound_speed;

use bevy_ecs::schedule::{IntoScheduleConfigs, Schedule};

use super::stage::Stage;

pub(super) use advise::Advisor;
pub(super) use alerting::RunInputs;
pub(super) use driving::Driving;
pub(super) use judge::{Results, judge_one};
pub(super) use outlier_filter::end_returns;
pub(super) use sound_speed::SoundSpeed;

/// Adds the core's systems to their stages.
pub(super) fn add(schedule: &mut Schedule) {
    add_placing(schedule);
    schedule.add_systems((
        cover::cover.in_set(Stage::Cover),
        (advise::find, advise::tell, live::live).chain().in_set(Stage::Advise),
    ));
}

/// Adds the core's systems up to georeferencing.
pub(super) fn add_placing(schedule: &mut Schedule) {
    schedule.add_systems((
        decode::decode.in_set(Stage::Decode),
        navigate::navigate.in_set(Stage::Navigate),
        georeference::georeference.in_set(Stage::Georeference),
    ));
}
