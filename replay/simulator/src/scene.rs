//! `SCENE.toml`: a vehicle file, the true tunnel, a trajectory, and the effects to simulate.

use headrace_config as config;
use headrace_config::Document;
use headrace_config::Loader;
use headrace_sampling::head::HeadProgram;
use headrace_sensor::device::DeviceKind;
use headrace_vehicle::VehicleConfig;

use crate::effects::{self, Named};
use crate::environment::Environment;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::files::FileLoader;
use crate::trajectory::{self, Trajectory};

/// A parsed and checked scene.
pub struct Scene {
    /// Its display name.
    pub name: String,
    /// Text of its vehicle file, which goes into the log.
    pub vehicle_text: String,
    /// The vehicle.
    pub vehicle: VehicleConfig,
    /// Programs of its heads, in the order of the vehicle file.
    pub programs: Vec<HeadProgram>,
    /// Seed of the random numbers.
    pub seed: u64,
    pub(crate) environment: Environment,
    pub(crate) trajectory: Trajectory,
    pub(crate) facts: Facts,
    pub(crate) effects: Named,
}

impl Scene {
    /// Parses and checks a scene. `load` loads files that the scene or its vehicle file names; `seed` overrides the scene's.
    ///
    /// Errors: the first key that is missing, unknown or out of range; a trajectory that leaves the tunnel; an effect that
    /// applies to nothing.
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
        let environment =
            Environment::parse(root.section("tunnel")?, &tunnel.profile, tunnel.length_m, text, load)?;
        let section = root.required("trajectory", root.section("trajectory")?)?;
        let (trajectory, ground) =
            trajectory::parse(section, (&tunnel.profile, tunnel.length_m), seed, text)?;
        let facts = Facts::new(&vehicle, &programs, ground, trajectory.duration_s());
        let effects = effects::parse(root.section("effects")?, &facts)?;
        root.finish()?;
        Ok(Self { name, vehicle_text, vehicle, programs, seed, environment, trajectory, facts, effects })
    }

    /// Whether the pilot hears a monitor's advice ([`crate::Simulation::advised_by`]).
    pub fn is_advised(&self) -> bool {
        self.trajectory.is_advised()
    }

    /// Facts that its effects are checked against.
    pub fn facts(&self) -> &Facts {
        &self.facts
    }
}
