//! Components of the vehicle's sensors: one entity a sensor.

use bevy_ecs::prelude::Component;

use super::reading::SourceId;
use crate::frames::Mount;
use crate::sampling::head::{HeadMode, HeadSpec};

/// Which source a sensor's readings come from, and how it sits on the vehicle.
#[derive(Debug, Clone, Copy, PartialEq, Component)]
pub struct Mounted {
    /// The source.
    pub source: SourceId,
    /// Position and angles.
    pub mount: Mount,
}

/// A mechanical profiling head, as configured.
#[derive(Debug, Clone, PartialEq, Component)]
pub struct SonarHead {
    /// How it sits and turns.
    pub spec: HeadSpec,
    /// The modes that it could be set to instead.
    pub modes: Vec<HeadMode>,
}

/// A fixed echosounder.
#[derive(Debug, Clone, Copy, PartialEq, Component)]
pub struct Echosounder {
    /// Readings of less confidence (0 to 1) are not used.
    pub min_confidence: f64,
}

/// A pressure sensor.
#[derive(Debug, Clone, Copy, PartialEq, Component)]
pub struct DepthSensor;

/// An inertial unit.
#[derive(Debug, Clone, Copy, PartialEq, Component)]
pub struct Imu;

/// A sonar that measures velocity over ground.
#[derive(Debug, Clone, Copy, PartialEq, Component)]
pub struct VelocityLog;

/// A cable counter.
#[derive(Debug, Clone, Copy, PartialEq, Component)]
pub struct Tether {
    /// Chainage of the vehicle where the counter reads zero, m.
    pub zero_at_m: f64,
    /// Metres of chainage for a metre of cable.
    pub scale: f64,
}
