//! Interface of effects.

use headrace_config::{ConfigError, Section};

use crate::builder::{Builder, Programs};
use crate::error::SceneError;
use crate::facts::Facts;

/// A kind of effect, identified by its name in scenes.
pub trait EffectKind: Sync {
    /// Its name: `[effects.NAME]`.
    fn name(&self) -> &'static str;

    /// Summary of the effect on one line.
    fn summary(&self) -> &'static str;

    /// Reads its tables; there are several if `[[effects.NAME]]` differs by sensor.
    ///
    /// Errors: a key that is missing, unknown or out of range; sensors that don't exist.
    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError>;
}

/// An effect with its parameters.
pub trait Effect: Send + Sync {
    /// Changes the heads' programs before the heads are switched on.
    fn begin(&self, programs: &mut Programs<'_>) {
        let _ = programs;
    }

    /// Adds its systems, components and streams.
    ///
    /// Errors: it is inconsistent with the rest of the scene.
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError>;
}
