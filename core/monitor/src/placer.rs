//! The placer: the ECS world that converts packets to readings, fixes and georeferenced pings.
//!
//! Its entities are the vehicle and its sensors. It uses no results of the adviser or the surveyor.

#![allow(clippy::needless_pass_by_value, reason = "bevy hands systems their arguments by value")]

pub(super) mod decode;
pub(super) mod georeference;
pub(super) mod navigate;
pub(super) mod sound_speed;

use std::sync::Arc;

use bevy_ecs::component::Component;
use bevy_ecs::prelude::Resource;

use super::entities::{
    LossCount, MeasuredMotion, Navigator, SensorDecoder, SensorHealth, VehicleEntities, VehicleState,
};
use super::error::PluginError;
use super::merge::{Inbox, MAX_TICK_BYTES, MAX_TICK_PACKETS};
use super::messages::{Event, PlacedItem, PlacedPing, Placement, Update};
use super::part::Part;
use super::result_stream::ResultStream;
use super::ring::PortReader;
use super::stage::{PlaceStage, Stage as _};
use crate::console::packets::{Commands, Console, ConsoleCounts};
use crate::unread::UnreadPacket;
use decode::{Events, Started, UnreadPackets};
use georeference::PlacedList;
use headrace_fusion::Navigation;
use headrace_geometry::snapshot::{Restorer, Saver, SnapshotError};
use headrace_geometry::time::{DiveClock, MonoNs};
use navigate::{Poses, PositionedList};
use sound_speed::SoundSpeed;

/// Capacity for the readings of one tick. The shortest frame of any device has over ten bytes.
pub(super) const MAX_TICK_READINGS: usize = MAX_TICK_BYTES / 8;

/// Part of the loop that converts packets to georeferenced pings.
pub struct Placer {
    part: Part<PlaceStage>,
    readers: Vec<PortReader>,
}

/// Results of the placer for a tick. The other parts of the loop read no other data of the placer.
///
/// The lists are reused from tick to tick. The lists of a default value grow as needed.
#[derive(Debug, Default)]
pub struct Placed {
    /// Packets of the tick, in the order of consumption.
    pub inbox: Inbox,
    /// Readings of the tick, in order.
    pub events: Vec<Event>,
    /// Packets of the tick that gave no reading, in order.
    pub(super) unread: Vec<UnreadPacket>,
    /// Georeferenced pings and advice updates of the tick, in order.
    pub items: Vec<PlacedItem>,
    /// Commands of the operator, in order.
    pub(super) commands: Commands,
    /// Clock of the dive.
    pub clock: DiveClock,
    /// Fix of the vehicle at the last advice update.
    pub vehicle: VehicleState,
    /// Traffic of each sensor so far, in the order of sources.
    pub health: Vec<SensorHealth>,
    /// Traffic of the operator's input so far.
    pub(super) console: ConsoleCounts,
    /// Result stream of the vehicle's poses at the advice updates.
    pub(super) poses: ResultStream,
}

impl Placed {
    /// Georeferenced pings of the tick, in order.
    pub fn pings(&self) -> impl Iterator<Item = &PlacedPing> {
        self.items.iter().filter_map(|item| match &item.placement {
            Placement::Ping(ping) => Some(ping),
            Placement::Update(_) => None,
        })
    }

    /// Advice updates of the tick, in order.
    pub fn updates(&self) -> impl Iterator<Item = &Update> {
        self.items.iter().filter_map(|item| match &item.placement {
            Placement::Update(update) => Some(update),
            Placement::Ping(_) => None,
        })
    }

    /// Number of the sensors' packets so far.
    pub fn packets(&self) -> u64 {
        self.health.iter().map(|sensor| sensor.packets).sum()
    }

    /// Latest receive time of the sensors' packets so far.
    pub fn last_received(&self) -> Option<MonoNs> {
        self.health.iter().filter_map(|sensor| sensor.span).map(|(_, last)| last).max()
    }

    /// Clears the lists of a tick, except its packets.
    fn clear(&mut self) {
        self.events.clear();
        self.unread.clear();
        self.items.clear();
        self.commands.0.clear();
    }

    /// Returns the placer's results for an empty tick after this one.
    pub(super) fn followed_by_nothing(&self) -> Self {
        let mut poses = self.poses.clone();
        poses.next_tick();
        let Self { clock, vehicle, console, .. } = *self;
        Self { clock, vehicle, health: self.health.clone(), console, poses, ..Self::default() }
    }
}

/// Resource by which another world reads the tick's [`Placed`].
#[derive(Debug, Default, Resource)]
pub struct PlacedTick(pub(super) Arc<Placed>);

impl core::ops::Deref for PlacedTick {
    type Target = Placed;

    fn deref(&self) -> &Placed {
        &self.0
    }
}

impl Placer {
    /// Creates the placer from a world that has the entities of the sensors and of the vehicle.
    ///
    /// Errors: the order of two systems is ambiguous.
    pub(super) fn new(
        mut part: Part<PlaceStage>,
        readers: Vec<PortReader>,
        keeps_results: bool,
    ) -> Result<Self, PluginError> {
        let mut poses = Poses::default();
        if keeps_results {
            poses.0.keep();
        }
        part.insert_state("poses", poses);
        part.insert_state("clock of the dive", Started::default());
        // During a tick, these lists are swapped with those of `Placed`.
        part.insert_resource(Inbox::default());
        part.insert_resource(Events::default());
        part.insert_resource(UnreadPackets::default());
        part.insert_resource(PlacedList::default());
        part.insert_resource(Commands::default());
        part.insert_resource(PositionedList(Vec::with_capacity(2 * MAX_TICK_READINGS)));
        part.add_component_state::<Navigator>("navigation");
        part.add_component_state::<VehicleState>("vehicle");
        part.add_component_state::<SensorDecoder>("decoders");
        part.add_component_state::<SensorHealth>("health of sensors");
        part.add_component_state::<MeasuredMotion>("motion of heads");
        part.add_component_state::<LossCount>("losses of heads");
        part.add_systems(PlaceStage::Decode, decode::decode);
        part.add_systems(PlaceStage::Navigate, navigate::navigate);
        part.add_systems(PlaceStage::Georeference, georeference::georeference);
        part.initialize()?;
        Ok(Self { part, readers })
    }

    /// Processes waiting packets, at most `allowance_bytes` in total. Allocates: never, if the lists have room.
    pub fn tick(&mut self, allowance_bytes: usize, into: &mut Placed) {
        self.swap_lists(into);
        let Self { part, readers } = self;
        part.world.resource_mut::<Poses>().0.next_tick();
        part.world.resource_mut::<Inbox>().fill(readers, allowance_bytes);
        if part.world.resource::<Inbox>().is_empty() {
            self.swap_lists(into);
            into.clear();
        } else {
            for stage in PlaceStage::ALL {
                part.run(*stage);
            }
            self.swap_lists(into);
        }
        self.report(into);
        debug_assert!(
            into.items.is_sorted_by_key(|item| item.event),
            "items are in the order of their events"
        );
        debug_assert!(
            into.items.iter().all(|item| item.event <= into.events.len()),
            "items belong to events"
        );
        debug_assert!(into.commands.0.is_sorted_by_key(|command| command.before), "commands are in order");
    }

    /// Takes waiting packets, at most `allowance_bytes` in total, without processing them. Allocates: never.
    pub(super) fn receive(&mut self, allowance_bytes: usize, into: &mut Placed) {
        into.inbox.fill(&mut self.readers, allowance_bytes);
        into.clear();
    }

    /// Returns the results so far, with room for a tick of any size. Allocates: all memory of the lists.
    pub(super) fn placed_with_room(&self) -> Placed {
        let mut placed = Placed {
            inbox: Inbox::with_room(),
            events: Vec::with_capacity(MAX_TICK_READINGS),
            unread: Vec::with_capacity(MAX_TICK_PACKETS),
            items: Vec::with_capacity(2 * MAX_TICK_READINGS),
            ..Placed::default()
        };
        placed.poses.reserve_as(&self.part.world.resource::<Poses>().0);
        self.report(&mut placed);
        placed
    }

    fn swap_lists(&mut self, with: &mut Placed) {
        let world = &mut self.part.world;
        core::mem::swap(&mut *world.resource_mut::<Inbox>(), &mut with.inbox);
        core::mem::swap(&mut world.resource_mut::<Events>().0, &mut with.events);
        core::mem::swap(&mut world.resource_mut::<UnreadPackets>().0, &mut with.unread);
        core::mem::swap(&mut world.resource_mut::<PlacedList>().0, &mut with.items);
        core::mem::swap(&mut *world.resource_mut::<Commands>(), &mut with.commands);
    }

    /// Copies the state that other parts of the loop read.
    pub(super) fn report(&self, into: &mut Placed) {
        let world = &self.part.world;
        let entities = world.resource::<VehicleEntities>();
        into.clock = world.resource::<Started>().clock;
        into.vehicle = world.get::<VehicleState>(entities.vehicle).copied().unwrap_or_default();
        into.health.clear();
        into.health.extend(entities.by_source.iter().filter_map(|sensor| world.get::<SensorHealth>(*sensor)));
        into.console = world.resource::<Console>().counts;
        into.poses.follow(&world.resource::<Poses>().0);
    }

    /// Whether packets are waiting in the rings.
    pub fn has_waiting(&self) -> bool {
        self.readers.iter().any(|reader| reader.peek().is_some())
    }

    /// Copies the state of the placer of another loop.
    ///
    /// Errors: the other placer has other sensors or another navigation. After an error, this placer must not be
    /// used.
    pub fn take_over(&mut self, other: &Self) -> Result<(), SnapshotError> {
        let mut to = Saver::default();
        to.part("placer");
        other.part.save(&mut to);
        let bytes = to.finish()?;
        let mut from = Restorer::new(&bytes);
        from.part("placer")?;
        self.part.restore(&mut from)?;
        if from.is_empty() { Ok(()) } else { Err(from.unfit("it has extra bytes at its end".to_owned())) }
    }

    /// Ends navigation at the end of a dive.
    pub(super) fn end(&mut self) {
        let world = &mut self.part.world;
        let vehicle = world.resource::<VehicleEntities>().vehicle;
        if let Some(mut navigator) = world.get_mut::<Navigator>(vehicle) {
            navigator.navigation.end();
        }
    }

    /// Navigation state of the vehicle.
    pub(super) fn navigation(&self) -> &dyn Navigation {
        let vehicle = self.part.world.entity(self.part.world.resource::<VehicleEntities>().vehicle);
        #[expect(clippy::expect_used, reason = "arming adds it, and nothing removes it")]
        vehicle.get::<Navigator>().expect("the vehicle has a navigator since arming").navigation.as_ref()
    }

    /// A component of every sensor, in the order of sources.
    pub(super) fn of_sensors<T: Component>(&self) -> impl Iterator<Item = &T> + Clone {
        let world = &self.part.world;
        world.resource::<VehicleEntities>().by_source.iter().filter_map(|entity| world.get(*entity))
    }

    /// Minimum and maximum speed of sound used for ranges, m/s.
    pub(super) fn sound_speeds_mps(&self) -> [f64; 2] {
        self.part.world.resource::<SoundSpeed>().span_mps()
    }

    /// A resource that a plugin has added.
    pub fn resource<T: Resource>(&self) -> Option<&T> {
        self.part.resource()
    }

    pub(super) fn save(&self, to: &mut Saver) {
        self.part.save(to);
    }

    pub(super) fn restore(&mut self, from: &mut Restorer<'_>) -> Result<(), SnapshotError> {
        self.part.restore(from)
    }

    /// Drops the packets waiting in the rings.
    pub(super) fn drop_waiting(&mut self) {
        self.readers.iter_mut().for_each(PortReader::clear);
    }
}

#[cfg(test)]
mod tests {
    use core::any::TypeId;

    use super::*;
    use crate::entities::{Head, HiddenAngles, Mounted};
    use crate::fixtures::armed;
    use crate::resources::{Plan, TunnelDesign};

    /// The types listed in this test are constant after arming, or are set anew in each tick, so snapshots omit them.
    #[test]
    fn snapshots_contain_all_state_of_the_placer() {
        let (placer, _) = armed().split().unwrap();
        placer.part.has_state_but_for(&[
            TypeId::of::<Head>(),
            TypeId::of::<HiddenAngles>(),
            TypeId::of::<Mounted>(),
            TypeId::of::<Plan>(),
            TypeId::of::<TunnelDesign>(),
            TypeId::of::<VehicleEntities>(),
            TypeId::of::<Commands>(),
            TypeId::of::<Events>(),
            TypeId::of::<UnreadPackets>(),
            TypeId::of::<Inbox>(),
            TypeId::of::<PlacedList>(),
            TypeId::of::<PositionedList>(),
        ]);
    }
}
