//! Converts the bytes of sensor packets to readings.

use bevy_ecs::prelude::{Query, Res, ResMut, Resource};
use bevy_ecs::system::SystemParam;

use super::sound_speed::SoundSpeed;
use crate::console::packets::{Commands, Console};
use crate::entities::{SensorDecoder, SensorHealth, VehicleEntities};
use crate::merge::{Inbox, MAX_TICK_PACKETS};
use crate::messages::Event;
use crate::unread::UnreadPacket;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::DiveClock;
use headrace_sensor::withheld::WithheldReason;

/// Readings of this tick, in order.
#[derive(Debug, Default, Resource)]
pub(super) struct Events(pub(super) Vec<Event>);

/// Packets of this tick that gave no reading, in order.
#[derive(Debug, Default, Resource)]
pub(super) struct UnreadPackets(pub(super) Vec<UnreadPacket>);

/// Clock of the dive. It starts with the first packet of a sensor.
#[derive(Debug, Default, Resource)]
pub(super) struct Started {
    pub(super) clock: DiveClock,
}

stateful!(Started { state: clock; });

/// Readings of this tick, its packets without a reading, and the dive's clock.
#[derive(SystemParam)]
pub(super) struct Outcomes<'w> {
    events: ResMut<'w, Events>,
    unread: ResMut<'w, UnreadPackets>,
    started: ResMut<'w, Started>,
}

/// The operator's input, as a source of commands.
#[derive(SystemParam)]
pub(super) struct Operator<'w> {
    console: ResMut<'w, Console>,
    commands: ResMut<'w, Commands>,
}

pub(super) fn decode(
    inbox: Res<'_, Inbox>,
    entities: Res<'_, VehicleEntities>,
    mut sensors: Query<'_, '_, (&mut SensorDecoder, &mut SensorHealth)>,
    mut sound_speed: ResMut<'_, SoundSpeed>,
    mut outcomes: Outcomes<'_>,
    mut operator: Operator<'_>,
) {
    let Outcomes { events, unread, started } = &mut outcomes;
    events.0.clear();
    unread.0.clear();
    operator.commands.0.clear();
    for (source, packet) in inbox.iter() {
        // The console isn't a sensor, so it doesn't contribute to the dive's times and counts.
        let Operator { console, commands } = &mut operator;
        if source == console.source {
            console.take(packet, [events.0.len(), unread.0.len()], commands);
            continue;
        }
        let before = events.0.len();
        let sensor = entities.of_source(source).and_then(|entity| sensors.get_mut(entity).ok());
        debug_assert!(sensor.is_some(), "source {} of a packet has no decoder", source.0);
        let Some((mut decoder, mut health)) = sensor else { continue };
        started.clock.start(packet.received);
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
        let withheld = decoder.0.withheld().saturating_sub(health.withheld);
        health.withheld += withheld;
        if events.0.len() == before && unread.0.len() < MAX_TICK_PACKETS {
            let reason = decoder.0.withheld_reason().filter(|_| withheld > 0);
            unread.0.push(UnreadPacket {
                before,
                source,
                received: packet.received,
                withheld: u32::try_from(withheld).unwrap_or(u32::MAX),
                reason: reason.unwrap_or(WithheldReason::NoMessage),
            });
        }
    }
}
