//! Interface that every effect implements.

use headrace_config::{ConfigError, Section};

use crate::builder::{Builder, Programs};
use crate::error::SceneError;
use crate::facts::Facts;

/// A kind of effect, such as `beam_cone`. Scenes identify a kind by its name.
pub trait EffectKind: Sync {
    /// Name of the effect: `[effects.NAME]`.
    fn name(&self) -> &'static str;

    /// One-line summary of the effect.
    fn summary(&self) -> &'static str;

    /// Reads the effect's tables. A scene has several `[[effects.NAME]]` tables if its keys differ between sensors or
    /// between stretches of the tunnel.
    ///
    /// Errors: a key is missing, unknown or out of range; a named sensor doesn't exist.
    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError>;
}

/// An effect with the parameters that a scene gives.
pub trait Effect: Send + Sync {
    /// Changes the heads' programs before the heads are switched on.
    fn begin(&self, programs: &mut Programs<'_>) {
        let _ = programs;
    }

    /// Adds the effect's systems, components and random streams.
    ///
    /// Errors: the effect is inconsistent with the rest of the scene.
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError>;
}
