//! `SCENE.toml`: a vehicle file, a tunnel as it truly is, a trajectory, and the effects to simulate.

use headrace_config as config;
use headrace_config::Loader;
use headrace_config::{ConfigError, Document};
use headrace_sampling::head::{HeadProgram, HeadSpec};
use headrace_sampling::occlusion::Obstacle;
use headrace_sensor::device::{DeviceKind, Sense};
use headrace_vehicle::VehicleConfig;

use super::effects::{self, Named};
use super::surroundings::Surroundings;
use super::way::{self, Ground, Way};

/// Gives the content of a file that a scene names.
pub type FileLoader<'a> = &'a dyn Fn(&str) -> Result<Vec<u8>, String>;

/// A scene, checked.
pub struct Scene {
    /// What people call it.
    pub name: String,
    /// Text of its vehicle file, which goes into the log.
    pub vehicle_text: String,
    /// The vehicle.
    pub vehicle: VehicleConfig,
    /// What its heads do, in the order of the vehicle file.
    pub programs: Vec<HeadProgram>,
    /// Where the random numbers begin.
    pub seed: u64,
    pub(super) surroundings: Surroundings,
    pub(super) way: Way,
    pub(super) facts: Facts,
    pub(super) effects: Named,
}

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
    /// Time from the start to the end of the way as the trajectory has it, s.
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

/// What is wrong with a scene.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// A key of the scene or of its vehicle file.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The vehicle's way leads through something.
    #[error(
        "simulating the way: after {after_s:.1} s, at chainage {chainage_m:.2} m, y {y_m:.2} m, z {z_m:.2} m, it leads \
         through {what}"
    )]
    Blocked {
        /// Seconds after the start.
        after_s: f64,
        /// Where: chainage, left, up, m.
        chainage_m: f64,
        /// Left of the axis.
        y_m: f64,
        /// Above the floor.
        z_m: f64,
        /// What is there.
        what: String,
    },
    /// An effect that contradicts the rest.
    #[error("simulating {effect}: it {problem}")]
    Effect {
        /// Its name.
        effect: &'static str,
        /// What is wrong.
        problem: String,
    },
}

impl Scene {
    /// Parses and checks a scene. `load` gives the content of a file that the scene or its vehicle file names; `seed`
    /// outweighs the scene's own.
    ///
    /// Errors: the first key that is missing, unknown or out of range; a trajectory that leaves the tunnel; an effect
    /// without anything to act on.
    pub fn parse(
        document: Document<'_>,
        kinds: &[&dyn DeviceKind],
        load: FileLoader<'_>,
        seed: Option<u64>,
    ) -> Result<Self, SceneError> {
        let text = |name: &str| String::from_utf8(load(name)?).map_err(|_| "is no text".to_owned());
        let text: Loader<'_> = &text;
        let root = document.root()?;
        let name = root.text("name")?.unwrap_or_else(|| "unnamed scene".to_owned());
        let own_seed = root.integer("seed", 0..=i64::MAX)?.and_then(|seed| u64::try_from(seed).ok());
        let seed = seed.or(own_seed).unwrap_or(1);
        let file = root.required("vehicle", root.text("vehicle")?)?;
        let mut vehicle_text = text(&file).map_err(|why| root.invalid("vehicle", &why))?;
        if let Some(changes) = root.section("vehicle_changes")? {
            vehicle_text = config::changed(&vehicle_text, &changes)?;
        }
        let vehicle = VehicleConfig::parse(Document::new(&file, &vehicle_text), kinds, text)?;
        let programs = vehicle.programs().map_err(|why| {
            root.invalid("vehicle", &format!("describes heads that no program fits: {why}"))
        })?;
        let tunnel = &vehicle.tunnel;
        let surroundings =
            Surroundings::parse(root.section("tunnel")?, &tunnel.profile, tunnel.length_m, text, load)?;
        let section = root.required("trajectory", root.section("trajectory")?)?;
        let (way, ground) = way::parse(section, (&tunnel.profile, tunnel.length_m), seed, text)?;
        let facts = Facts::new(&vehicle, &programs, ground, way.duration_s());
        let effects = effects::parse(root.section("effects")?, &facts)?;
        root.finish()?;
        Ok(Self { name, vehicle_text, vehicle, programs, seed, surroundings, way, facts, effects })
    }
}

impl Scene {
    /// What its effects are checked against.
    pub fn facts(&self) -> &Facts {
        &self.facts
    }
}

impl Facts {
    fn new(vehicle: &VehicleConfig, programs: &[HeadProgram], ground: Ground, duration_s: f64) -> Self {
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
