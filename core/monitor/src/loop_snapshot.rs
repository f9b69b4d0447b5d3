//! Snapshot of the loop's whole state, and its parts.

use core::any::TypeId;

use bevy_ecs::component::{Component, Mutable};
use bevy_ecs::entity::Entity;
use bevy_ecs::prelude::{Mut, Resource};
use bevy_ecs::world::World;

use super::advice_log::AdviceLog;
use super::alert_list::AlertList;
use super::alerts::Alerts;
use super::console::Console;
use super::entities::{
    HeadFrontier, HeadSweep, LossCount, MeasuredMotion, Navigator, SensorDecoder, SensorHealth, VehicleState,
};
use super::live_state::LiveState;
use super::notes::Notes;
use super::resources::{Coverage, Digests, Finder, Tally, TickTime, VehicleEntities};
use super::stages::{Advisor, Driving, SoundSpeed};
use headrace_geometry::snapshot::{Restorer, Saver, SnapshotError, Stateful};

/// A part of the state: name, type of the resource or component, and functions to save and restore it.
struct Part {
    kind: TypeId,
    name: &'static str,
    save: fn(&World, &mut Saver),
    restore: fn(&mut World, &mut Restorer<'_>) -> Result<(), SnapshotError>,
}

/// The parts, in snapshot order.
#[derive(Resource)]
pub(super) struct StateParts(Vec<Part>);

impl StateParts {
    /// Parts of the loop itself.
    pub(super) fn of_the_loop() -> Self {
        let mut parts = Self(Vec::new());
        parts.add_component::<Navigator>("navigation");
        parts.add_component::<VehicleState>("vehicle");
        parts.add_component::<Driving>("driving");
        parts.add_component::<SensorDecoder>("decoders");
        parts.add_component::<SensorHealth>("health of sensors");
        parts.add_component::<MeasuredMotion>("motion of heads");
        parts.add_component::<LossCount>("losses of heads");
        parts.add_component::<HeadSweep>("sweeps");
        parts.add_component::<HeadFrontier>("reach of heads");
        parts.add::<SoundSpeed>("speed of sound");
        parts.add::<Coverage>("coverage");
        parts.add::<Finder>("search for holes");
        parts.add::<Alerts>("alerts");
        parts.add::<AlertList>("list of alerts");
        parts.add::<Notes>("notes");
        parts.add::<Console>("console");
        parts.add::<Advisor>("advice");
        parts.add::<AdviceLog>("history of advice");
        parts.add::<LiveState>("live state");
        parts.add::<Digests>("digests");
        parts.add::<Tally>("tally");
        parts.add::<TickTime>("time");
        parts
    }

    /// Adds a plugin's resource.
    pub(super) fn add_of<T: Resource<Mutability = Mutable> + Stateful>(
        &mut self,
        name: &'static str,
        _resource: &T,
    ) {
        self.add::<T>(name);
    }

    /// Adds a resource. A resource that was added already is left out.
    fn add<T: Resource<Mutability = Mutable> + Stateful>(&mut self, name: &'static str) {
        self.add_part(Part {
            kind: TypeId::of::<T>(),
            name,
            save: |world, to| world.resource::<T>().save(to),
            restore: |world, from| world.resource_mut::<T>().restore(from),
        });
    }

    /// Adds a component of the vehicle and its sensors.
    fn add_component<T: Component<Mutability = Mutable> + Stateful>(&mut self, name: &'static str) {
        self.add_part(Part {
            kind: TypeId::of::<T>(),
            name,
            save: |world, to| {
                let all =
                    world.resource::<VehicleEntities>().all().filter_map(|entity| world.get::<T>(entity));
                to.each(all);
            },
            restore: |world, from| {
                let all: Vec<Entity> = world.resource::<VehicleEntities>().all().collect();
                all.into_iter().try_for_each(|entity| match world.get_mut::<T>(entity) {
                    Some(mut component) => component.restore(from),
                    None => Ok(()),
                })
            },
        });
    }

    fn add_part(&mut self, part: Part) {
        if self.0.iter().all(|other| other.kind != part.kind) {
            self.0.push(part);
        }
    }
}

/// Saves all parts.
pub(super) fn save(world: &World, to: &mut Saver) {
    for part in &world.resource::<StateParts>().0 {
        to.part(part.name);
        (part.save)(world, to);
    }
}

/// Restores all parts.
pub(super) fn restore(world: &mut World, from: &mut Restorer<'_>) -> Result<(), SnapshotError> {
    world.resource_scope(|world, parts: Mut<'_, StateParts>| {
        parts.0.iter().try_for_each(|part| {
            from.part(part.name)?;
            (part.restore)(world, from)
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::console::Commands;
    use crate::entities::{Head, HeadSpecification, HiddenAngles, Mounted};
    use crate::head_descriptions::HeadDescriptions;
    use crate::merge::Inbox;
    use crate::messages::{
        AdviceList, Events, JudgedStates, Notices, PlacedEvents, PlacedList, PositionedList, Requests,
    };
    use crate::resources::{Target, TunnelDesign};
    use crate::stages::RunInputs;
    use crate::{App, SourceSpec};
    use headrace_fusion::direct::DirectNavigation;
    use headrace_geometry::site::Site;
    use headrace_geometry::tunnel::shapes;
    use headrace_sensor::codec::CodecCounts;
    use headrace_sensor::device::{Decoder, SensorInfo, SensorKind};
    use headrace_sensor::reading::{Decoded, Packet};
    use headrace_vehicle::Mission;
    use serde::{Deserialize, Serialize};

    /// A decoder that never gives a reading.
    #[derive(Serialize, Deserialize)]
    struct Silent;

    impl Decoder for Silent {
        fn decode(&mut self, _: Packet<'_>, _: &mut dyn FnMut(Decoded)) {}

        fn counts(&self) -> CodecCounts {
            CodecCounts::default()
        }
    }

    /// Every resource or component must be listed.
    ///
    /// It is either a part of the state, or it is constant since arming or reset every tick.
    #[test]
    fn every_resource_and_component_is_saved_or_listed_as_stateless() {
        let profile = shapes::circle(3.0).unwrap();
        let navigation = DirectNavigation::new(profile.clone(), Site::default());
        let mut app = App::new(Mission::new(profile, 1.0));
        for (id, kind) in [("head", SensorKind::Head), ("depth", SensorKind::Depth)] {
            let (id, decoder) = (id.to_owned(), Box::new(Silent));
            let spec =
                SourceSpec { id, plugin: String::new(), connect: String::new(), decoder, ring_bytes: 64 };
            let source = app.add_source(spec).unwrap();
            let sensor = app.entities[source.index()];
            let info = SensorInfo { kind, ..SensorInfo::other() };
            app.world.entity_mut(sensor).insert(Mounted { source, info });
        }
        let mut dive = app.arm(Box::new(navigation)).unwrap();
        let mut bare = World::new();
        crate::stage::schedule().run(&mut bare);
        let bevys_own = resources(&bare);
        let no_state = [
            TypeId::of::<StateParts>(),
            TypeId::of::<VehicleEntities>(),
            TypeId::of::<Inbox>(),
            TypeId::of::<Events>(),
            TypeId::of::<PositionedList>(),
            TypeId::of::<PlacedList>(),
            TypeId::of::<Requests>(),
            TypeId::of::<JudgedStates>(),
            TypeId::of::<PlacedEvents>(),
            TypeId::of::<AdviceList>(),
            TypeId::of::<RunInputs>(),
            TypeId::of::<Commands>(),
            TypeId::of::<Notices>(),
            TypeId::of::<TunnelDesign>(),
            TypeId::of::<Target>(),
            TypeId::of::<HeadDescriptions>(),
            TypeId::of::<Mounted>(),
            TypeId::of::<Head>(),
            TypeId::of::<HeadSpecification>(),
            TypeId::of::<HiddenAngles>(),
        ];
        let world = &mut dive.world;
        let parts: Vec<TypeId> = world.resource::<StateParts>().0.iter().map(|part| part.kind).collect();
        let found = [resources(world), components(world)].concat();
        let sorted = [&parts[..], &no_state, &bevys_own].concat();
        let unsorted = found.iter().filter(|id| !sorted.contains(id)).count();
        assert_eq!(unsorted, 0, "unlisted of {}; the rest are saved, or listed as no state", found.len());
        assert!(parts.iter().all(|part| found.contains(part)));
    }

    fn resources(world: &World) -> Vec<TypeId> {
        world.iter_resources().filter_map(|(_, info, _)| info.type_id()).collect()
    }

    fn components(world: &World) -> Vec<TypeId> {
        let entities = world.resource::<VehicleEntities>().all();
        let ids = entities.flat_map(|entity| world.entity(entity).archetype().components().to_vec());
        ids.filter_map(|id| world.components().get_info(id)?.type_id()).collect()
    }
}
