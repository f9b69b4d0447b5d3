//! `SCENE.toml`: a vehicle file, a trajectory, and the effects to simulate.

use headrace_core::app::device::DeviceKind;
use headrace_core::config::vehicle::Loader;
use headrace_core::config::{ConfigError, Document, Section, VehicleConfig};
use headrace_core::sampling::head::HeadProgram;
use headrace_core::sampling::layout;

use super::trajectory::{Leg, Trajectory};

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
    /// Its way.
    pub trajectory: Trajectory,
}

/// What is wrong with a scene.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// A key of the scene or of its vehicle file.
    #[error(transparent)]
    Config(#[from] ConfigError),
}

/// A dive may begin and end as much as 20 m outside the tunnel.
const CHAINAGE_M: std::ops::RangeInclusive<f64> = -20.0..=1.0e6;

impl Scene {
    /// Parses and checks a scene. `load` gives the text of a file that the scene or its vehicle file names.
    ///
    /// Errors: the first key that is missing, unknown or out of range; a trajectory that leaves the tunnel.
    pub fn parse(
        document: Document<'_>,
        kinds: &[&dyn DeviceKind],
        load: Loader<'_>,
    ) -> Result<Self, SceneError> {
        let root = document.root()?;
        let name = root.text("name")?.unwrap_or_else(|| "unnamed scene".to_owned());
        let file = root.required("vehicle", root.text("vehicle")?)?;
        let vehicle_text = load(&file).map_err(|why| root.invalid("vehicle", &why))?;
        let vehicle = VehicleConfig::parse(Document::new(&file, &vehicle_text), kinds, load)?;
        let heads = vehicle.heads();
        let programs = if heads.is_empty() {
            Vec::new()
        } else {
            layout::programs(&heads, vehicle.layout, vehicle.planned_speed_mps).map_err(|why| {
                root.invalid("vehicle", &format!("describes heads that no program fits: {why}"))
            })?
        };
        let section = root.required("trajectory", root.section("trajectory")?)?;
        let trajectory = parse_trajectory(section, &vehicle)?;
        if let Some(effects) = root.section("effects")?
            && let Some(effect) = effects.keys().first()
        {
            let problem = "is no effect that can be simulated; this version has none";
            return Err(effects.invalid(effect, problem).into());
        }
        root.finish()?;
        Ok(Self { name, vehicle_text, vehicle, programs, trajectory })
    }
}

fn parse_trajectory(section: Section<'_>, vehicle: &VehicleConfig) -> Result<Trajectory, ConfigError> {
    let start_m = section.number("start_m", CHAINAGE_M)?.unwrap_or(0.0);
    let reference = vehicle.tunnel.profile.reference();
    let place_m = match section.numbers("place_m", -200.0..=200.0)?.as_deref() {
        None => reference,
        Some([y, z]) => [*y, *z],
        Some(_) => return Err(section.invalid("place_m", "must be two numbers [y, z]")),
    };
    if !vehicle.tunnel.profile.contains(place_m) {
        return Err(section.invalid("place_m", "must be inside the tunnel's profile"));
    }
    let mut legs = Vec::new();
    let mut chainage_m = start_m;
    for leg in section.sections("legs")? {
        let distance_m = leg.required("distance_m", leg.number("distance_m", 0.01..=1.0e6)?)?;
        let speed_mps = leg.required("speed_mps", leg.number("speed_mps", -5.0..=5.0)?)?;
        if speed_mps.abs() < 1e-3 {
            return Err(leg.invalid("speed_mps", "must be at least 0.001 either way, or the leg has no end"));
        }
        chainage_m += distance_m * speed_mps.signum();
        if !(CHAINAGE_M.start()..=&(vehicle.tunnel.length_m - CHAINAGE_M.start())).contains(&&chainage_m) {
            let problem =
                format!("ends at chainage {chainage_m} m; the tunnel is {} m long", vehicle.tunnel.length_m);
            return Err(leg.invalid("distance_m", &problem));
        }
        leg.finish()?;
        legs.push(Leg { distance_m, speed_mps });
    }
    if legs.is_empty() {
        return Err(
            section.invalid("legs", "has no leg; at least one table headed [[trajectory.legs]] is needed")
        );
    }
    section.finish()?;
    Ok(Trajectory { start_m, place_m, legs })
}
