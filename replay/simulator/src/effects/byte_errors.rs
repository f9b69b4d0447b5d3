//! Bit errors, lost bytes and inserted bytes on a device's line.

use bevy_ecs::prelude::{Component, Query};
use headrace_config::{ConfigError, Section};
use headrace_geometry::math;
use headrace_sensor::device::Direction;

use super::effect::{Effect, EffectKind};
use super::keys;
use super::line_delay::SENSES;
use super::targets::PerSensor;
use crate::builder::Builder;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::random::Stream;
use crate::sensing::Line;
use crate::stages::Stage;

/// Changes bytes from devices at random: bits are flipped, bytes are lost, and other bytes are inserted.
///
/// Each byte is affected independently. `flipped_per_million`, `dropped_per_million` and `inserted_per_million` are the
/// rates, all zero by default. A message that loses all its bytes doesn't arrive. Bytes that hosts send to devices are
/// unchanged.
pub(super) struct ByteErrorsKind;

#[derive(Debug, Clone, Copy)]
struct Parameters {
    flipped: f64,
    dropped: f64,
    inserted: f64,
}

/// Selects the affected bytes. All bytes have the same probability. A single random number therefore determines how
/// many bytes pass until the next affected byte.
struct Hits {
    stream: Stream,
    kind: u64,
    /// Logarithm of the probability that a byte isn't affected; zero if no byte is ever affected.
    ln_missed: f64,
    count: u64,
    next: u64,
}

#[derive(Component)]
struct ByteErrors {
    flipped: Hits,
    dropped: Hits,
    inserted: Hits,
    /// Number of bytes that have crossed the line so far.
    seen: u64,
    rest: Line,
}

impl EffectKind for ByteErrorsKind {
    fn name(&self) -> &'static str {
        "byte_errors"
    }

    fn summary(&self) -> &'static str {
        "bytes on lines are corrupted, lost or inserted"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        Ok(Box::new(PerSensor::read(tables, facts, &SENSES, |table| {
            let share = |key| keys::or_zero(table, key, 0.0..=500_000.0).map(|millionths| millionths * 1e-6);
            let flipped = share("flipped_per_million")?;
            let dropped = share("dropped_per_million")?;
            let inserted = share("inserted_per_million")?;
            let values = [
                ("flipped_per_million", flipped),
                ("dropped_per_million", dropped),
                ("inserted_per_million", inserted),
            ];
            keys::some_not_zero(table, &values)?;
            Ok(Parameters { flipped, dropped, inserted })
        })?))
    }
}

impl Effect for PerSensor<Parameters> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, parameters) in &self.0 {
            let errors = ByteErrors::new(parameters, sim.stream(*source));
            sim.insert(*source, errors);
        }
        sim.system(Stage::Line, damage);
        Ok(())
    }
}

fn damage(mut lines: Query<'_, '_, (&mut Line, &mut ByteErrors)>) {
    for (mut line, mut errors) in &mut lines {
        errors.damage(&mut line);
    }
}

impl Hits {
    fn new(stream: Stream, kind: u64, share: f64) -> Self {
        let mut hits = Self { stream, kind, ln_missed: math::ln(1.0 - share), count: 0, next: 0 };
        hits.next = hits.gap();
        hits
    }

    /// Draws the number of unaffected bytes before the next affected one. The number is geometrically distributed.
    fn gap(&self) -> u64 {
        if self.ln_missed == 0.0 {
            return u64::MAX;
        }
        let [u, _] = self.stream.block(self.count, self.kind).uniform();
        math::floor_to_i64(math::ln(u) / self.ln_missed).unsigned_abs()
    }

    /// Returns a random number between 0 and 1 if this byte is affected; `None` otherwise. Must be called once for each
    /// byte, in order.
    fn hit(&mut self, byte: u64) -> Option<f64> {
        if byte < self.next {
            return None;
        }
        let [_, which] = self.stream.block(self.count, self.kind).uniform();
        self.count += 1;
        self.next = byte.saturating_add(1).saturating_add(self.gap());
        Some(which)
    }
}

impl ByteErrors {
    fn new(parameters: &Parameters, stream: Stream) -> Self {
        Self {
            flipped: Hits::new(stream, 0, parameters.flipped),
            dropped: Hits::new(stream, 1, parameters.dropped),
            inserted: Hits::new(stream, 2, parameters.inserted),
            seen: 0,
            rest: Line::default(),
        }
    }

    /// Damages the messages on the line. A message keeps its index even if it loses all its bytes, because the outbox,
    /// which sends the messages, drops empty ones later.
    fn damage(&mut self, line: &mut Line) {
        let mut rest = std::mem::take(&mut self.rest);
        rest.clear();
        for message in &line.messages {
            let (from, to) = message.bytes;
            let bytes = line.bytes.get(from..to).unwrap_or_default();
            let begin = rest.bytes.len();
            match message.direction {
                Direction::Sent => rest.bytes.extend_from_slice(bytes),
                Direction::Received => self.pass(bytes, &mut rest.bytes),
            }
            let mut message = *message;
            message.bytes = (begin, rest.bytes.len());
            rest.messages.push(message);
        }
        std::mem::swap(line, &mut rest);
        self.rest = rest;
    }

    fn pass(&mut self, bytes: &[u8], rest: &mut Vec<u8>) {
        for byte in bytes {
            if let Some(which) = self.inserted.hit(self.seen) {
                rest.push(below(256.0, which));
            }
            let flipped = self.flipped.hit(self.seen).map_or(0, |which| 1 << below(8.0, which));
            if self.dropped.hit(self.seen).is_none() {
                rest.push(byte ^ flipped);
            }
            self.seen += 1;
        }
    }
}

/// Maps `which`, a number in (0, 1), to an integer in [0, `count`).
fn below(count: f64, which: f64) -> u8 {
    u8::try_from(math::floor_to_i64(count * which)).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use headrace_geometry::time::MonoNs;

    use super::*;
    use crate::testing_motion::{Bench, refusal, same_in_any_slices};

    const BYTES: usize = 1_000_000;

    fn through(flipped: f64, dropped: f64, inserted: f64) -> Vec<u8> {
        let parameters = Parameters { flipped, dropped, inserted };
        let mut errors = ByteErrors::new(&parameters, Stream::new(8, "byte_errors", "depth"));
        let mut line = Line::default();
        for sample in 0..BYTES / 10 {
            line.send(MonoNs(sample as u64), Direction::Received, &[0; 10], sample);
            line.send(MonoNs(sample as u64), Direction::Sent, &[7; 3], sample);
        }
        errors.damage(&mut line);
        let sent = line.messages.iter().filter(|m| m.direction == Direction::Sent);
        assert!(sent.into_iter().all(|m| line.bytes[m.bytes.0..m.bytes.1] == [7; 3]));
        let received = line.messages.iter().filter(|m| m.direction == Direction::Received);
        received.flat_map(|m| line.bytes[m.bytes.0..m.bytes.1].to_vec()).collect()
    }

    fn near(count: usize, share: f64) {
        let wanted = share * BYTES as f64;
        assert!((count as f64 - wanted).abs() < 5.0 * math::sqrt(wanted * (1.0 - share)), "{count} {wanted}");
    }

    #[test]
    fn number_of_affected_bytes_matches_the_rate() {
        let flipped = through(0.003, 0.0, 0.0);
        assert!(flipped.len() == BYTES && flipped.iter().all(|byte| byte.count_ones() <= 1));
        near(flipped.iter().filter(|byte| **byte != 0).count(), 0.003);
        for bit in 0..8 {
            near(flipped.iter().filter(|byte| **byte >> bit == 1).count(), 0.003 / 8.0);
        }
        near(BYTES - through(0.0, 0.3, 0.0).len(), 0.3);
        let more = through(0.0, 0.0, 0.01);
        near(more.len() - BYTES, 0.01);
        near(more.iter().filter(|byte| **byte != 0).count(), 0.01 * 255.0 / 256.0);
    }

    #[test]
    fn message_that_loses_all_its_bytes_never_arrives() {
        let keys = "[effects.byte_errors]\ndropped_per_million = 500000\n";
        let lost = Bench::turning(keys).messages();
        assert!(lost.iter().all(|message| !message.3.is_empty()));
        assert!(lost.len() < Bench::turning("").messages().len());
    }

    #[test]
    fn time_slice_length_does_not_change_results() {
        let keys = "[effects.byte_errors]\ndropped_per_million = 9000\nflipped_per_million = 9000\n\
                    inserted_per_million = 9000\n";
        same_in_any_slices(&Bench::turning(keys));
        assert!(refusal("[effects.byte_errors]\n").contains("must not be zero"));
    }
}
