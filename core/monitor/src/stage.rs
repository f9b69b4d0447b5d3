//! The stages of each world, in order.

use bevy_ecs::schedule::SystemSet;

/// A stage of a world. Its systems see all results of the world's earlier stages.
///
/// In a tick without input for a stage, the stage doesn't run.
pub trait Stage: SystemSet + Copy + PartialEq {
    /// All stages of the world, in the order in which they run.
    const ALL: &'static [Self];
}

/// Stages of the placer: from packets to georeferenced pings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, SystemSet)]
pub enum PlaceStage {
    /// Converts the bytes of sensor packets to readings.
    Decode,
    /// Converts readings to fixes of the vehicle.
    Navigate,
    /// Converts returns to points on the wall.
    Georeference,
}

impl Stage for PlaceStage {
    const ALL: &'static [Self] = &[Self::Decode, Self::Navigate, Self::Georeference];
}

/// Stages of the surveyor: from georeferenced pings to verdicts.
///
/// Verdicts decide which sections are due for judging next. The surveyor therefore stops at each ping that makes
/// sections due, and at each advice update. The stages from [`Self::Walk`] to [`Self::Report`] run once per stop.
/// [`Self::Classify`] runs once per tick with pings or updates, [`Self::Surveyed`] once per tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, SystemSet)]
pub enum SurveyStage {
    /// Decides which returns are wall.
    Classify,
    /// Converts pings to samples and passes, up to the next ping that makes sections due for judging, or the
    /// next advice update.
    Walk,
    /// Judges the sections that are due.
    Judge,
    /// Reports metres by verdict and the observations that hold, if the surveyor has stopped at an advice
    /// update.
    Report,
    /// Reserved for plugins that read the verdicts.
    Surveyed,
}

impl SurveyStage {
    /// Stages that run each time the surveyor stops to judge sections or to process an advice update, in
    /// order.
    pub(super) const OF_STOP: [Self; 3] = [Self::Walk, Self::Judge, Self::Report];
}

impl Stage for SurveyStage {
    const ALL: &'static [Self] = &[Self::Classify, Self::Walk, Self::Judge, Self::Report, Self::Surveyed];
}

/// The only stage of the adviser.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, SystemSet)]
pub enum AdviseStage {
    /// Computes the speed advice at each update.
    Advise,
}

impl Stage for AdviseStage {
    const ALL: &'static [Self] = &[Self::Advise];
}
