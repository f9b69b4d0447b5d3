//! Scenes for cost measurements: TOML texts that may name vehicle and scene files embedded in the program.

use headrace_config::Document;
use headrace_sensor::device::DeviceKind;
use headrace_simulator::Scene;
use headrace_vehicle::VehicleConfig;

use crate::effort::Effort;
use crate::error::CostError;

/// Files built into the program, each with its name and text.
pub const FILES: [(&str, &str); 11] = [
    ("vita1.toml", include_str!("../../../deploy/vehicles/vita1.toml")),
    ("vita2-2.toml", include_str!("../../../deploy/vehicles/vita2-2.toml")),
    ("vita2-3.toml", include_str!("../../../deploy/vehicles/vita2-3.toml")),
    ("vita2-4.toml", include_str!("../../../deploy/vehicles/vita2-4.toml")),
    ("pipe.toml", include_str!("../../../deploy/vehicles/pipe.toml")),
    ("boulders.toml", include_str!("../../../deploy/scenes/boulders.toml")),
    ("collapse.toml", include_str!("../../../deploy/scenes/collapse.toml")),
    ("rehearsal.toml", include_str!("../../../deploy/scenes/rehearsal.toml")),
    ("drop-outs.toml", include_str!("../../../deploy/scenes/drop-outs.toml")),
    ("small-pipe.toml", include_str!("../../../deploy/scenes/small-pipe.toml")),
    ("vita1-field.toml", include_str!("../../../deploy/scenes/vita1-field.toml")),
];

/// Content of a built-in file, found by its name without folders.
///
/// Errors: no built-in file has that name.
pub fn file(name: &str) -> Result<&'static str, CostError> {
    let plain = name.rsplit('/').next().unwrap_or(name);
    let found = FILES.iter().find(|(known, _)| *known == plain).map(|(_, text)| *text);
    found.ok_or_else(|| CostError::NoFile {
        name: name.to_owned(),
        known: FILES.map(|(known, _)| known).join(", "),
    })
}

/// Inputs of a cost measurement.
#[derive(Clone, Copy)]
pub struct Inputs<'a> {
    /// Effort of the measurement: quick or full.
    pub effort: Effort,
    /// The kinds of devices that vehicle files may name.
    pub kinds: &'a [&'a dyn DeviceKind],
    /// Name and text of the user's own vehicle file, if any.
    pub vehicle: Option<(&'a str, &'a str)>,
}

impl Inputs<'_> {
    /// Parses a scene with a seed. Vehicle files, and the files that they name, are the built-in ones.
    ///
    /// Errors: the scene is invalid.
    pub fn scene(&self, text: &str, seed: u32) -> Result<Scene, CostError> {
        let load =
            |name: &str| file(name).map(|text| text.as_bytes().to_vec()).map_err(|why| why.to_string());
        let document = Document::new("a scene to measure", text);
        Ok(Scene::parse(document, self.kinds, &load, Some(u64::from(seed)))?)
    }

    /// Parses a scene with the given text as its vehicle file, whatever file the scene names.
    ///
    /// Errors: the scene or the vehicle is invalid.
    pub fn scene_of(&self, text: &str, vehicle: &str, seed: u32) -> Result<Scene, CostError> {
        let load = |_: &str| Ok(vehicle.as_bytes().to_vec());
        let document = Document::new("a scene to measure", text);
        Ok(Scene::parse(document, self.kinds, &load, Some(u64::from(seed)))?)
    }

    /// Parses a vehicle file's text.
    ///
    /// Errors: the vehicle is invalid.
    pub fn vehicle(&self, text: &str) -> Result<VehicleConfig, CostError> {
        let load = |name: &str| Err(format!("{name:?} isn't known here"));
        Ok(VehicleConfig::parse(Document::new("a vehicle to measure", text), self.kinds, &load)?)
    }
}
