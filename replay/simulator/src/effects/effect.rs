//! What every effect is.

use headrace_config::{ConfigError, Section};

use crate::builder::{Builder, Programs};
use crate::error::SceneError;
use crate::facts::Facts;

/// An effect by its name in scenes.
pub trait EffectKind: Sync {
    /// Its name: `[effects.NAME]`.
    fn name(&self) -> &'static str;

    /// What it does, in a line.
    fn summary(&self) -> &'static str;

    /// Reads its tables; more than one where `[[effects.NAME]]` treats sensors differently.
    ///
    /// Errors: a key that is missing, unknown or out of range; sensors that aren't there.
    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError>;
}

/// An effect with its parameters.
pub trait Effect: Send + Sync {
    /// Changes what heads are told to do, before they are switched on.
    fn begin(&self, programs: &mut Programs<'_>) {
        let _ = programs;
    }

    /// Adds its systems, components and streams.
    ///
    /// Errors: it contradicts the rest of the scene.
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError>;
}
