//! `SCENE.toml`: a vehicle file, the true tunnel, a trajectory, and the effects to simulate.

use headrace_config as config;
use headrace_config::{ConfigError, ConfigErrors, Document, Loader, Section};
use headrace_sampling::head::HeadProgram;
use headrace_sensor::device::DeviceKind;
use headrace_vehicle::VehicleConfig;

use crate::effects::{self, Effect, EffectKind, Named};
use crate::environment::Environment;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::file_loader::FileLoader;
use crate::implied_effects::{self, Called, Choice, Described, Tables, Take};
use crate::trajectory::{self, Ground, Trajectory};

/// Maximum duration that a simulated dive may have, s.
const LONGEST_S: f64 = 1e9;

/// A parsed and checked scene.
pub struct Scene {
    /// Name of the scene for display.
    pub name: String,
    /// Text of the vehicle file, which is written to the log.
    pub vehicle_text: String,
    /// The vehicle, as parsed from its file.
    pub vehicle: VehicleConfig,
    /// Programs of the heads, in the order of the vehicle file.
    pub programs: Vec<HeadProgram>,
    /// Seed of the scene's random numbers.
    pub seed: u64,
    pub(crate) environment: Environment,
    pub(crate) trajectory: Trajectory,
    pub(crate) facts: Facts,
    pub(crate) effects: Named,
    called: Vec<Called>,
    /// Names of effects that are currently left out of the simulation.
    without: Vec<String>,
}

impl Scene {
    /// Parses and checks a scene.
    ///
    /// `load` loads files that the scene or its vehicle file names. `seed` overrides the seed in the scene.
    ///
    /// Errors: keys in the scene or in its vehicle file are missing, unknown or out of range (the error lists all of
    /// them), the trajectory leaves the tunnel, or an effect applies to nothing.
    pub fn parse(
        document: Document<'_>,
        kinds: &[&dyn DeviceKind],
        load: FileLoader<'_>,
        seed: Option<u64>,
    ) -> Result<Self, SceneError> {
        Self::parse_taking(document, kinds, load, seed, None)
    }

    /// Parses a scene like [`Scene::parse`]. `take` overrides the scene's own key `take`, which decides whether implied
    /// effects are simulated.
    ///
    /// Errors: see [`Scene::parse`].
    pub fn parse_taking(
        document: Document<'_>,
        kinds: &[&dyn DeviceKind],
        load: FileLoader<'_>,
        seed: Option<u64>,
        take: Option<Take>,
    ) -> Result<Self, SceneError> {
        let mut of_vehicle = None;
        let scene = document.read(|root| Self::from_root(root, kinds, load, (seed, take), &mut of_vehicle));
        match (scene, of_vehicle) {
            (Err(errors), Some(others)) => Err(errors.and(others).into()),
            (scene, _) => Ok(scene?),
        }
    }

    /// Parses the scene's tables. Errors in the vehicle file are added to the list `of_vehicle`.
    fn from_root(
        root: &Section<'_>,
        kinds: &[&dyn DeviceKind],
        load: FileLoader<'_>,
        (seed, take): (Option<u64>, Option<Take>),
        of_vehicle: &mut Option<ConfigErrors>,
    ) -> Result<Self, ConfigError> {
        let text = |name: &str| String::from_utf8(load(name)?).map_err(|_| "is not a text".to_owned());
        let text: Loader<'_> = &text;
        let name = root.text("name")?.unwrap_or_else(|| "unnamed scene".to_owned());
        let own_seed = root.integer("seed", 0..=i64::MAX)?.and_then(|seed| u64::try_from(seed).ok());
        let seed = seed.or(own_seed).unwrap_or(1);
        let file = root.text("vehicle")?;
        let changes = root.section("vehicle_changes")?;
        let (tunnel, trajectory) = (root.section("tunnel")?, root.section("trajectory")?);
        let effects = root.section("effects")?;
        let described = Tables::of(root, tunnel.as_ref())?;
        root.finish()?;
        let (file, trajectory) = (root.required("vehicle", file), root.required("trajectory", trajectory));
        let file = file?;
        let mut vehicle_text = text(&file).map_err(|why| root.invalid("vehicle", &why))?;
        if let Some(changes) = changes {
            vehicle_text = config::changed(&vehicle_text, &changes)?;
        }
        let vehicle = VehicleConfig::parse(Document::new(&file, &vehicle_text), kinds, text);
        let vehicle = vehicle.map_err(|errors| {
            let problem = match errors.errors().len() {
                1 => "has an error".to_owned(),
                count => format!("has {count} errors"),
            };
            *of_vehicle = Some(errors);
            root.invalid("vehicle", &problem)
        })?;
        let programs = vehicle.programs().map_err(|why| {
            root.invalid("vehicle", &format!("describes heads without a possible program: {why}"))
        })?;
        let (design, length_m) = (&vehicle.tunnel.profile, vehicle.tunnel.length_m);
        let environment = root.part(|| Environment::parse(tunnel, design, length_m, text, load))?;
        let trajectory = root.part(|| trajectory::parse(&trajectory?, (design, length_m), seed, text))?;
        // If the trajectory is invalid, effects are still checked, with an assumed duration.
        let known = trajectory.as_ref().map(|(trajectory, ground)| (*ground, trajectory.duration_s()));
        let (ground, duration_s) = known.unwrap_or((Ground::Water, LONGEST_S));
        let facts = Facts::new(&vehicle, &programs, ground, duration_s);
        let described = root.part(|| Described::read(described, length_m))?;
        let choice = root.part(|| Choice::read(effects.as_ref(), take))?;
        let effects = root.part(|| effects::parse(effects, &facts))?;
        let (trajectory, _) = root.required("trajectory", trajectory)?;
        let environment = root.required("tunnel", environment)?;
        let effects = root.required("effects", effects)?;
        let (described, choice) = (root.required("water", described)?, root.required("effects", choice)?);
        let mut called = implied_effects::called(&described, &vehicle, &facts, &environment);
        choice.decide(&mut called, |name| effects.has(name));
        let effects = effects.and(&implied_effects::taken(&called), &facts)?;
        let without = Vec::new();
        Ok(Self {
            name,
            vehicle_text,
            vehicle,
            programs,
            seed,
            environment,
            trajectory,
            facts,
            effects,
            called,
            without,
        })
    }

    /// Whether the pilot follows a monitor's advice ([`crate::Simulation::advised_by`]).
    pub fn is_advised(&self) -> bool {
        self.trajectory.is_advised()
    }

    /// Effects that the scene implies. Each tells whether and how it is simulated.
    pub fn called(&self) -> &[Called] {
        &self.called
    }

    /// Names of the effects that are simulated, in the order of [`effects::KINDS`].
    pub fn simulated(&self) -> Vec<&'static str> {
        self.active().map(|(kind, _)| kind.name()).collect()
    }

    /// Leaves the effects named `names` out of the simulation. Effects that an earlier call left out are restored.
    pub fn leave_out(&mut self, names: &[&str]) {
        self.without = names.iter().map(|name| (*name).to_owned()).collect();
    }

    /// The effects that are simulated. Effects that [`Scene::leave_out`] names are missing.
    pub(crate) fn active(&self) -> impl Iterator<Item = (&'static dyn EffectKind, &dyn Effect)> {
        let is_in = |kind: &dyn EffectKind| self.without.iter().all(|name| name != kind.name());
        self.effects
            .0
            .iter()
            .filter(move |(kind, _)| is_in(*kind))
            .map(|(kind, effect)| (*kind, effect.as_ref()))
    }

    /// Facts about vehicle and tunnel, for checking effects.
    pub fn facts(&self) -> &Facts {
        &self.facts
    }
}
