//! Facts about the vehicle and the tunnel of a scene, for checking effects.

use headrace_sampling::head::{HeadProgram, HeadSpec};
use headrace_sampling::occlusion::Obstacle;
use headrace_sensor::device::Sense;
use headrace_vehicle::VehicleConfig;

use crate::trajectory::Ground;

/// Facts about vehicle and tunnel. The effects of a scene are checked against them.
#[derive(Debug, Clone, PartialEq)]
pub struct Facts {
    /// The sensors, in the order of the vehicle file.
    pub sensors: Vec<SensorFacts>,
    /// Parts of the vehicle that may hide a head's view.
    pub hull: Vec<Obstacle>,
    /// Reference of the trajectory's speeds: either the tunnel, or the water, which carries the vehicle.
    pub ground: Ground,
    /// Length of the tunnel, m.
    pub length_m: f64,
    /// Speed of sound in the vehicle file, m/s.
    pub sound_speed_mps: f64,
    /// Duration of the vehicle's trajectory before effects change it, s.
    pub duration_s: f64,
}

/// Facts about a sensor of the vehicle.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorFacts {
    /// Id of the sensor.
    pub id: String,
    /// Quantity that the sensor measures.
    pub sense: Sense,
    /// Specification of the head, if the sensor is a head.
    pub head: Option<HeadSpec>,
    /// Program of the head, if the sensor is a head.
    pub program: Option<HeadProgram>,
}

impl Facts {
    /// Collects the facts for a vehicle with a trajectory of `duration_s`.
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
