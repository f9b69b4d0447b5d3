//! Devices that send nothing for a while.

use bevy_ecs::prelude::{Component, Query};
use headrace_config::{ConfigError, Section};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::device::Direction;

use super::effect::{Effect, EffectKind};
use super::line_delay::SENSES;
use super::targets::PerSensor;
use crate::builder::Builder;
use crate::clock::START;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::sensing::Line;
use crate::stages::Stage;

/// Nothing comes from a device from `from_s` (0) to `to_s` (the end) of the dive: a connector, a fuse, a switched-off head.
///
/// What would have come on its line then is gone; the device itself goes on, heads turn, counters count. Messages to
/// devices aren't affected.
pub(super) struct DeviceSilenceKind;

#[derive(Debug, Clone, Copy, Component)]
struct DeviceSilence {
    from: MonoNs,
    /// `None` for the end of the dive.
    to: Option<MonoNs>,
}

impl EffectKind for DeviceSilenceKind {
    fn name(&self) -> &'static str {
        "device_silence"
    }

    fn summary(&self) -> &'static str {
        "devices send nothing for a while"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        Ok(Box::new(PerSensor::read(tables, facts, &SENSES, |table| {
            let from_s = table.number("from_s", 0.0..=1e6)?.unwrap_or(0.0);
            let to_s = table.number("to_s", 0.0..=1e6)?;
            if to_s.is_some_and(|to_s| to_s <= from_s) {
                return Err(table.invalid("to_s", "must be larger than from_s"));
            }
            let at = |seconds: f64| START + DurNs::from_secs_f64(seconds);
            Ok(DeviceSilence { from: at(from_s), to: to_s.map(at) })
        })?))
    }
}

impl Effect for PerSensor<DeviceSilence> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, silence) in &self.0 {
            sim.insert(*source, *silence);
        }
        sim.system(Stage::Line, silence);
        Ok(())
    }
}

fn silence(mut lines: Query<'_, '_, (&mut Line, &DeviceSilence)>) {
    for (mut line, silence) in &mut lines {
        let is_lost = |at: MonoNs| silence.from <= at && silence.to.is_none_or(|to| at < to);
        line.messages.retain(|message| message.direction != Direction::Received || !is_lost(message.at));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing_motion::{Bench, refusal, same_in_any_slices};

    const KEYS: &str = "[effects.device_silence]\nsensors = [\"head_a\", \"imu\"]\nfrom_s = 1\nto_s = 2.5\n";

    #[test]
    fn nothing_comes_from_a_silent_device_and_all_else_comes_as_before() {
        let (plain, silent) = (Bench::turning(""), Bench::turning(KEYS));
        let span = START + DurNs::from_secs_f64(1.0)..START + DurNs::from_secs_f64(2.5);
        let mut gone = 0;
        for source in 0..plain.sensors() {
            let (all, left) = (plain.line(source), silent.line(source));
            let kept: Vec<_> =
                all.iter().filter(|m| m.1 == Direction::Sent || !span.contains(&m.0)).cloned().collect();
            if left.len() < all.len() {
                assert_eq!(left, kept, "source {source}");
                gone += 1;
            } else {
                assert_eq!(left, all, "source {source}");
            }
        }
        assert_eq!(gone, 2);
    }

    #[test]
    fn slices_make_no_difference_and_nonsense_is_refused() {
        same_in_any_slices(&Bench::turning(KEYS));
        same_in_any_slices(&Bench::turning("[effects.device_silence]\nfrom_s = 2\n"));
        let why = |keys: &str| refusal(&format!("[effects.device_silence]\n{keys}"));
        assert!(why("from_s = 3\nto_s = 2").contains("must be larger than from_s"));
        assert!(why("sensors = [\"nobody\"]").contains("this effect can act on"));
    }
}
