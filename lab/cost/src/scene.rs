//! Scenes to measure on: text, with the vehicle and scene files that come with the program.

use headrace_config::Document;
use headrace_sensor::device::DeviceKind;
use headrace_simulator::Scene;
use headrace_vehicle::VehicleConfig;

use crate::effort::Effort;
use crate::error::CostError;

/// Files that come with the program, by name.
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

/// A file that comes with the program, by its name without folders.
///
/// Errors: there is none of that name.
pub fn file(name: &str) -> Result<&'static str, CostError> {
    let plain = name.rsplit('/').next().unwrap_or(name);
    let found = FILES.iter().find(|(known, _)| *known == plain).map(|(_, text)| *text);
    found.ok_or_else(|| CostError::NoFile {
        name: name.to_owned(),
        known: FILES.map(|(known, _)| known).join(", "),
    })
}

/// What is measured with.
#[derive(Clone, Copy)]
pub struct Inputs<'a> {
    /// How much is measured.
    pub effort: Effort,
    /// The kinds of devices that vehicle files may name.
    pub kinds: &'a [&'a dyn DeviceKind],
    /// A vehicle file of the user's own: its name and text.
    pub vehicle: Option<(&'a str, &'a str)>,
}

impl Inputs<'_> {
    /// A scene with a seed. Its vehicle, and files that this one names, are those that come with the program.
    ///
    /// Errors: a scene that is wrong.
    pub fn scene(&self, text: &str, seed: u32) -> Result<Scene, CostError> {
        let load =
            |name: &str| file(name).map(|text| text.as_bytes().to_vec()).map_err(|why| why.to_string());
        let document = Document::new("a scene to measure", text);
        Ok(Scene::parse(document, self.kinds, &load, Some(u64::from(seed)))?)
    }

    /// A scene whose vehicle file is this text, whatever name the scene calls it by.
    ///
    /// Errors: a scene or a vehicle that is wrong.
    pub fn scene_of(&self, text: &str, vehicle: &str, seed: u32) -> Result<Scene, CostError> {
        let load = |_: &str| Ok(vehicle.as_bytes().to_vec());
        let document = Document::new("a scene to measure", text);
        Ok(Scene::parse(document, self.kinds, &load, Some(u64::from(seed)))?)
    }

    /// A vehicle file's text, understood.
    ///
    /// Errors: a vehicle that is wrong.
    pub fn vehicle(&self, text: &str) -> Result<VehicleConfig, CostError> {
        let load = |name: &str| Err(format!("{name:?} isn't known here"));
        Ok(VehicleConfig::parse(Document::new("a vehicle to measure", text), self.kinds, &load)?)
    }
}
