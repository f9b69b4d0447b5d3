//! What a scene says of its vehicle and tunnel, as far as effects go by it.

use headrace_sampling::head::{HeadProgram, HeadSpec};
use headrace_sampling::occlusion::Obstacle;
use headrace_sensor::device::Sense;
use headrace_vehicle::VehicleConfig;

use crate::trajectory::Ground;

/// What effects are checked against.
#[derive(Debug, Clone, PartialEq)]
pub struct Facts {
    /// The sensors, in the order of the vehicle file.
    pub sensors: Vec<SensorFacts>,
    /// Parts of the vehicle that may stand in a head's way.
    pub hull: Vec<Obstacle>,
    /// Whether a current would carry the vehicle.
    pub ground: Ground,
    /// Length of the tunnel, m.
    pub length_m: f64,
    /// The speed of sound that the vehicle file gives, m/s.
    pub sound_speed_mps: f64,
    /// How long the trajectory takes, without what effects make of it, s.
    pub duration_s: f64,
}

/// A sensor of the vehicle.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorFacts {
    /// Its id.
    pub id: String,
    /// What it senses.
    pub sense: Sense,
    /// A head's particulars.
    pub head: Option<HeadSpec>,
    /// What a head does.
    pub program: Option<HeadProgram>,
}

impl Facts {
    /// Those of a vehicle whose trajectory takes `duration_s`.
    pub(crate) fn new(
        vehicle: &VehicleConfig,
        programs: &[HeadProgram],
        ground: Ground,
        duration_s: f64,
    ) -> Self {
        let mut programs = programs.iter().copied();
        let sensors = vehicle.sensors.iter().zip(&vehicle.sensor_configs).map(|(sensor, config)| {
            let head = sensor.head();
            let program = head.and_then(|_| programs.next());
            SensorFacts { id: config.id.clone(), sense: sensor.sense(), head, program }
        });
        Self {
            sensors: sensors.collect(),
            hull: vehicle.hull.clone(),
            ground,
            length_m: vehicle.tunnel.length_m,
            sound_speed_mps: vehicle.site.sound_speed_mps,
            duration_s,
        }
    }
}
