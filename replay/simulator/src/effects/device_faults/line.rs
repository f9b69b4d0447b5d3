//! Messages of devices with a fault.

use bevy_ecs::prelude::{Component, Query};
use headrace_geometry::math;
use headrace_sensor::device::Direction;

use super::span::Span;
use crate::random::Stream;
use crate::sensing::Line;

/// Makes a device's line silent, or replaces its bytes with random bytes.
#[derive(Component)]
pub(super) struct BrokenLine {
    span: Span,
    /// Source of the random bytes; `None` for a silent line.
    stream: Option<Stream>,
    /// Number of random bytes sent so far.
    said: u64,
}

impl BrokenLine {
    pub(super) fn silent(span: Span) -> Self {
        Self { span, stream: None, said: 0 }
    }

    pub(super) fn babbling(span: Span, stream: Stream) -> Self {
        Self { span, stream: Some(stream), said: 0 }
    }

    fn break_line(&mut self, line: &mut Line) {
        let Line { messages, bytes } = line;
        let received = messages.iter_mut().filter(|message| message.direction == Direction::Received);
        for message in received.filter(|message| self.span.holds(message.at)) {
            let (from, to) = message.bytes;
            let Some(stream) = self.stream else {
                // Messages without bytes keep their indices, and the outbox drops them.
                message.bytes = (from, from);
                continue;
            };
            for byte in bytes.get_mut(from..to).unwrap_or_default() {
                let [u, _] = stream.at(self.said).uniform();
                *byte = u8::try_from(math::floor_to_i64(256.0 * u)).unwrap_or_default();
                self.said += 1;
            }
        }
    }
}

pub(super) fn break_lines(mut lines: Query<'_, '_, (&mut Line, &mut BrokenLine)>) {
    for (mut line, mut broken) in &mut lines {
        broken.break_line(&mut line);
    }
}
