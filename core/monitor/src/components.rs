//! Components of the vehicle's sensors: one entity a sensor.

use bevy_ecs::prelude::Component;

use headrace_sampling::head::{HeadMode, HeadSpec};
use headrace_sensor::device::SensorInfo;
use headrace_sensor::reading::SourceId;

/// Which source a sensor's readings come from, how it sits on the vehicle, and what it is.
#[derive(Debug, Clone, Copy, PartialEq, Component)]
pub struct Mounted {
    /// The source.
    pub source: SourceId,
    /// Mount and kind.
    pub info: SensorInfo,
}

/// A mechanical profiling head, as configured.
#[derive(Debug, Clone, PartialEq, Component)]
pub struct SonarHead {
    /// How it sits and turns.
    pub spec: HeadSpec,
    /// The modes that it could be set to instead.
    pub modes: Vec<HeadMode>,
}
