//! Delay of messages from devices.

use bevy_ecs::prelude::{Component, Query};
use headrace_config::{ConfigError, Section};
use headrace_geometry::math;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::device::{Direction, Sense};

use super::effect::{Effect, EffectKind};
use super::keys;
use super::targets::PerSensor;
use crate::builder::Builder;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::random::Stream;
use crate::sensing::Line;
use crate::stages::Stage;

/// Quantities whose sensors may have delayed messages.
pub(super) const SENSES: [Sense; 6] =
    [Sense::Head, Sense::Echosounder, Sense::Depth, Sense::Inertial, Sense::Velocity, Sense::Tether];

/// Messages from a device arrive late, in addition to the latency in the vehicle file.
///
/// `latency_ms` delays all messages. In addition, a random time delays each message. This time is exponentially
/// distributed with mean `jitter_ms`. No message overtakes the previous one on its line; at the earliest, both arrive
/// together. Messages to devices aren't delayed.
pub(super) struct LineDelayKind;

#[derive(Debug, Clone, Copy)]
struct Parameters {
    latency_s: f64,
    jitter_s: f64,
}

#[derive(Component)]
struct LineDelay {
    parameters: Parameters,
    stream: Stream,
    received: u64,
    last: MonoNs,
}

impl EffectKind for LineDelayKind {
    fn name(&self) -> &'static str {
        "line_delay"
    }

    fn summary(&self) -> &'static str {
        "messages arrive late"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        Ok(Box::new(PerSensor::read(tables, facts, &SENSES, |table| {
            let latency_ms = keys::or_zero(table, "latency_ms", 0.0..=10_000.0)?;
            let jitter_ms = keys::or_zero(table, "jitter_ms", 0.0..=10_000.0)?;
            keys::some_not_zero(table, &[("latency_ms", latency_ms), ("jitter_ms", jitter_ms)])?;
            Ok(Parameters { latency_s: latency_ms * 1e-3, jitter_s: jitter_ms * 1e-3 })
        })?))
    }
}

impl Effect for PerSensor<Parameters> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, parameters) in &self.0 {
            let delay = LineDelay {
                parameters: *parameters,
                stream: sim.stream(*source),
                received: 0,
                last: MonoNs(0),
            };
            sim.insert(*source, delay);
        }
        sim.system(Stage::Line, delay);
        Ok(())
    }
}

fn delay(mut lines: Query<'_, '_, (&mut Line, &mut LineDelay)>) {
    for (mut line, mut delay) in &mut lines {
        for message in line.messages.iter_mut().filter(|m| m.direction == Direction::Received) {
            message.at = delay.next(message.at);
        }
    }
}

impl LineDelay {
    fn next(&mut self, at: MonoNs) -> MonoNs {
        let Parameters { latency_s, jitter_s } = self.parameters;
        let mut late_s = latency_s;
        if jitter_s > 0.0 {
            let [u, _] = self.stream.at(self.received).uniform();
            late_s -= jitter_s * math::ln(u);
        }
        self.received += 1;
        self.last = self.last.max(at + DurNs::from_secs_f64(late_s));
        self.last
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing_motion::{Bench, refusal, same_in_any_slices};

    const KEYS: &str = "[effects.line_delay]\nlatency_ms = 40\njitter_ms = 3\n";

    #[test]
    fn received_messages_are_late_and_keep_their_order() {
        let bench = Bench::turning("");
        let late = Bench::turning(KEYS);
        for source in 0..bench.sensors() {
            let (plain, late) = (bench.line(source), late.line(source));
            let received = |messages: &[(MonoNs, Direction, Vec<u8>)]| {
                messages.iter().filter(|m| m.1 == Direction::Received).cloned().collect::<Vec<_>>()
            };
            let sent = |messages: &[(MonoNs, Direction, Vec<u8>)]| {
                messages.iter().filter(|m| m.1 == Direction::Sent).cloned().collect::<Vec<_>>()
            };
            assert_eq!(sent(&plain), sent(&late));
            let (plain, late) = (received(&plain), received(&late));
            assert_eq!(plain.len(), late.len());
            assert!(late.windows(2).all(|w| w[0].0 <= w[1].0));
            for (plain, late) in plain.iter().zip(&late) {
                assert_eq!(plain.2, late.2);
                assert!(late.0 >= plain.0 + DurNs::from_millis(40));
            }
        }
    }

    /// The messages are so far apart that a delayed message never holds up the next one. Mean and variance of the delay
    /// are then those of an exponential distribution.
    #[test]
    fn message_delay_jitter_is_exponentially_distributed() {
        let parameters = Parameters { latency_s: 0.0, jitter_s: 0.003 };
        let stream = Stream::new(4, "line_delay", "head");
        let mut delay = LineDelay { parameters, stream, received: 0, last: MonoNs(0) };
        let count = 100_000_u64;
        let (mut sum, mut squares) = (0.0, 0.0);
        for k in 0..count {
            let at = MonoNs(k * 1_000_000_000);
            let late_s = delay.next(at).since(at).as_secs_f64() / 0.003;
            (sum, squares) = (sum + late_s, squares + late_s * late_s);
        }
        let n = count as f64;
        assert!((sum / n - 1.0).abs() < 5.0 / math::sqrt(n));
        assert!((squares / n - 2.0).abs() < 5.0 * math::sqrt(20.0 / n));
    }

    #[test]
    fn time_slice_length_does_not_change_results() {
        same_in_any_slices(&Bench::turning(KEYS));
        assert!(refusal("[effects.line_delay]\n").contains("jitter_ms must not be zero"));
    }
}
