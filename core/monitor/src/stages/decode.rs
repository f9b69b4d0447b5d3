//! Converts bytes to readings.

use bevy_ecs::prelude::{Query, Res, ResMut};

use super::sound_speed::SoundSpeed;
use crate::console::{Commands, Console};
use crate::entities::{SensorDecoder, SensorHealth, widened};
use crate::merge::Inbox;
use crate::messages::{Event, Events};
use crate::resources::{Tally, VehicleEntities};

#[expect(clippy::too_many_arguments, reason = "a system's arguments are its inputs and outputs")]
pub(super) fn decode(
    inbox: Res<'_, Inbox>,
    entities: Res<'_, VehicleEntities>,
    mut sensors: Query<'_, '_, (&mut SensorDecoder, &mut SensorHealth)>,
    mut events: ResMut<'_, Events>,
    mut tally: ResMut<'_, Tally>,
    mut sound_speed: ResMut<'_, SoundSpeed>,
    mut console: ResMut<'_, Console>,
    mut commands: ResMut<'_, Commands>,
) {
    events.0.clear();
    commands.0.clear();
    for (source, packet) in inbox.iter() {
        // The console isn't a sensor, so it doesn't contribute to the dive's times and counts.
        if source == console.source {
            console.take(packet, events.0.len(), &mut commands);
            continue;
        }
        tally.packets += 1;
        tally.span = Some(widened(tally.span, packet.received));
        let before = events.0.len();
        let sensor = entities.of_source(source).and_then(|entity| sensors.get_mut(entity).ok());
        let Some((mut decoder, mut health)) = sensor else { continue };
        decoder.0.decode(packet, &mut |mut decoded| {
            sound_speed.pass(source, &mut decoded);
            events.0.push(Event {
                source,
                received: packet.received,
                valid_at: decoded.valid_at,
                reading: decoded.reading,
            });
        });
        health.count(packet.received, packet.bytes.len(), events.0.len() - before);
    }
}
