//! Each ping starts from the vehicle's pose at the time of the ping.

use headrace_config::{ConfigError, Section};
use headrace_sensor::device::Sense;

use super::effect::{Effect, EffectKind};
use super::targets::targets;
use crate::builder::Builder;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::stages::{AIM_HELD, Stage, aim_moving};

/// Each ping starts from the vehicle's pose at the time of the ping.
///
/// Without this effect, all pings of a turn start from the pose at the turn's beginning, as in simulators that take a
/// whole scan at once.
pub(super) struct MotionWithinTurnKind;

struct Moving;

impl EffectKind for MotionWithinTurnKind {
    fn name(&self) -> &'static str {
        "motion_within_turn"
    }

    fn summary(&self) -> &'static str {
        "the vehicle moves while a head turns; without this effect, all pings of a turn are sent from the pose at its start"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        for table in tables {
            targets(&table, facts, &[Sense::Head])?;
            table.finish()?;
        }
        Ok(Box::new(Moving))
    }
}

impl Effect for Moving {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        sim.replace(AIM_HELD);
        sim.system(Stage::Aim, aim_moving);
        Ok(())
    }
}
