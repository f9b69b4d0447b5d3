//! The stages of a tick, in order, and the schedule that chains them.

use bevy_ecs::prelude::{Res, Resource};
use bevy_ecs::schedule::{
    IntoScheduleConfigs, LogLevel, Schedule, ScheduleBuildSettings, SingleThreadedExecutor, SystemSet,
};

/// A stage of a tick. Systems of a stage see all results that earlier stages have computed from the tick's
/// packets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, SystemSet)]
pub enum Stage {
    /// Converts bytes to readings.
    Decode,
    /// Converts readings to fixes.
    Navigate,
    /// Converts returns to points on the wall.
    Georeference,
    /// Converts georeferenced pings to samples, passes and sections. Judges sections as soon as they are due.
    Cover,
    /// Reserved for plugins that read the verdicts before the advice.
    Judge,
    /// Computes the speed advice.
    Advise,
    /// Publishes results to the outlets.
    Publish,
}

impl Stage {
    /// All stages, in order.
    pub const ALL: [Self; 7] = [
        Self::Decode,
        Self::Navigate,
        Self::Georeference,
        Self::Cover,
        Self::Judge,
        Self::Advise,
        Self::Publish,
    ];

    /// Whether the stage georeferences pings or is needed before that. A replay may run these stages on
    /// another thread.
    pub(super) fn is_placing(self) -> bool {
        matches!(self, Self::Decode | Self::Navigate | Self::Georeference)
    }

    /// Next stage.
    pub fn next(self) -> Option<Self> {
        Self::ALL.into_iter().skip_while(|stage| *stage != self).nth(1)
    }
}

/// Marks a world whose pings are georeferenced by another part of a split loop. Each tick then brings the
/// lists of these stages.
#[derive(Debug, Resource)]
pub(super) struct PlacedElsewhere;

/// Set of the stages up to georeferencing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, SystemSet)]
struct Placing;

/// Empty schedule of the chained stages: single-threaded, with an ambiguous order of systems as an error.
pub(super) fn schedule() -> Schedule {
    let mut schedule = Schedule::default();
    schedule.set_executor(SingleThreadedExecutor::new());
    schedule.set_build_settings(ScheduleBuildSettings {
        ambiguity_detection: LogLevel::Error,
        ..ScheduleBuildSettings::default()
    });
    schedule
        .configure_sets(Placing.run_if(|elsewhere: Option<Res<'_, PlacedElsewhere>>| elsewhere.is_none()));
    for stage in Stage::ALL {
        if stage.is_placing() {
            schedule.configure_sets(stage.in_set(Placing));
        }
        if let Some(next) = stage.next() {
            schedule.configure_sets((stage, next).chain());
        }
    }
    schedule
}
