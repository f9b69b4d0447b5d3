//! Bytes to readings.

use bevy_ecs::prelude::{Res, ResMut, Resource};

use crate::flow::{Event, Events, SourceTallies, SourceTally, Tally};
use crate::merge::Inbox;
use headrace_geometry::time::MonoNs;
use headrace_sensor::device::Decoder;
use headrace_sensor::reading::Packet;
use headrace_snapshot::{Restorer, Saver, SnapshotError, Stateful};

use super::sound::WaterSound;

/// The decoder of each source.
#[derive(Resource)]
pub(crate) struct Decoders(pub(crate) Vec<Box<dyn Decoder>>);

impl Stateful for Decoders {
    fn save(&self, to: &mut Saver) {
        to.each(self.0.iter().map(AsRef::as_ref));
    }

    fn restore(&mut self, from: &mut Restorer<'_>) -> Result<(), SnapshotError> {
        from.each(self.0.iter_mut().map(AsMut::as_mut))
    }
}

pub(super) fn decode(
    inbox: Res<'_, Inbox>,
    mut decoders: ResMut<'_, Decoders>,
    mut events: ResMut<'_, Events>,
    mut tally: ResMut<'_, Tally>,
    mut sources: ResMut<'_, SourceTallies>,
    mut sound: ResMut<'_, WaterSound>,
) {
    events.0.clear();
    for (source, packet) in inbox.iter() {
        tally.packets += 1;
        tally.span = Some(widened(tally.span, packet.received));
        let before = events.0.len();
        let Some(decoder) = decoders.0.get_mut(source.index()) else { continue };
        decoder.decode(packet, &mut |mut decoded| {
            sound.pass(source, &mut decoded);
            events.0.push(Event {
                source,
                received: packet.received,
                valid_at: decoded.valid_at,
                reading: decoded.reading,
            });
        });
        if let Some(of_source) = sources.0.get_mut(source.index()) {
            count(of_source, packet, events.0.len() - before);
        }
    }
}

fn count(tally: &mut SourceTally, packet: Packet<'_>, readings: usize) {
    tally.packets += 1;
    tally.bytes += packet.bytes.len() as u64;
    tally.readings += readings as u64;
    if let Some((_, last)) = tally.span {
        tally.longest_gap = tally.longest_gap.max(packet.received.since(last));
    }
    tally.span = Some(widened(tally.span, packet.received));
}

fn widened(span: Option<(MonoNs, MonoNs)>, at: MonoNs) -> (MonoNs, MonoNs) {
    span.map_or((at, at), |(first, last)| (first.min(at), last.max(at)))
}
