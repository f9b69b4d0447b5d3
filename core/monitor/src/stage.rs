//! The stages of a tick, in order, and the schedule that chains them.

use bevy_ecs::schedule::{
    IntoScheduleConfigs, LogLevel, Schedule, ScheduleBuildSettings, SingleThreadedExecutor, SystemSet,
};

/// A stage of the tick. Systems of one stage see what all earlier stages have done with the tick's packets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, SystemSet)]
pub enum Stage {
    /// Bytes to readings.
    Decode,
    /// Readings to fixes.
    Navigate,
    /// Returns to points on the wall.
    Georeference,
    /// Georeferenced pings to samples, passes and sections; judges sections as soon as they are due.
    Cover,
    /// For plugins that read the verdicts before the advice.
    Judge,
    /// Speed advice.
    Advise,
    /// Results to the outlets.
    Publish,
}

impl Stage {
    /// All of them, in their order.
    pub const ALL: [Self; 7] = [
        Self::Decode,
        Self::Navigate,
        Self::Georeference,
        Self::Cover,
        Self::Judge,
        Self::Advise,
        Self::Publish,
    ];

    /// The stage after this one.
    pub fn next(self) -> Option<Self> {
        Self::ALL.into_iter().skip_while(|stage| *stage != self).nth(1)
    }
}

/// An empty schedule of the chained stages: single-threaded; an ambiguous order of systems is an error.
pub(super) fn schedule() -> Schedule {
    let mut schedule = Schedule::default();
    schedule.set_executor(SingleThreadedExecutor::new());
    schedule.set_build_settings(ScheduleBuildSettings {
        ambiguity_detection: LogLevel::Error,
        ..ScheduleBuildSettings::default()
    });
    for stage in Stage::ALL {
        if let Some(next) = stage.next() {
            schedule.configure_sets((stage, next).chain());
        }
    }
    schedule
}
