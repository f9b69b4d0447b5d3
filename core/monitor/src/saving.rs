//! The loop's state as a whole: what a snapshot has, part by part.

use core::any::TypeId;

use bevy_ecs::component::Mutable;
use bevy_ecs::prelude::{Mut, Resource};
use bevy_ecs::world::World;

use super::alerts::Alerts;
use super::flow::{
    AdviceLog, Coverage, Digests, Finder, HeadTable, Navigator, SourceTallies, Tally, TickTime,
};
use super::head::HeadTrack;
use super::stages::{Advisor, Decoders, Driving, HeadSweeps, WaterSound};
use headrace_snapshot::{Restorer, Saver, SnapshotError, Stateful};

/// A part of the state: its name, the resource that it is, and how it is saved and restored.
struct Part {
    resource: TypeId,
    name: &'static str,
    save: fn(&World, &mut Saver),
    restore: fn(&mut World, &mut Restorer<'_>) -> Result<(), SnapshotError>,
}

/// The parts, in the order in which snapshots have them.
#[derive(Resource)]
pub(super) struct Parts(Vec<Part>);

impl Parts {
    /// Those of the loop itself.
    pub(super) fn of_the_loop() -> Self {
        let mut parts = Self(Vec::new());
        parts.add::<Decoders>("decoders");
        parts.add::<WaterSound>("speed of sound");
        parts.add::<Navigator>("navigation");
        parts.0.push(Part {
            resource: TypeId::of::<HeadTable>(),
            name: "heads",
            save: save_heads,
            restore: restore_heads,
        });
        parts.add::<HeadSweeps>("sweeps");
        parts.add::<Driving>("driving");
        parts.add::<Coverage>("coverage");
        parts.add::<Finder>("search for holes");
        parts.add::<Alerts>("alerts");
        parts.add::<Advisor>("advice");
        parts.add::<AdviceLog>("history of advice");
        parts.add::<Digests>("digests");
        parts.add::<Tally>("tally");
        parts.add::<SourceTallies>("tallies of sources");
        parts.add::<TickTime>("time");
        parts
    }

    /// Adds the resource that a plugin brings.
    pub(super) fn add_of<T: Resource<Mutability = Mutable> + Stateful>(
        &mut self,
        name: &'static str,
        _resource: &T,
    ) {
        self.add::<T>(name);
    }

    /// Adds a resource; one that is there already is there once.
    pub(super) fn add<T: Resource<Mutability = Mutable> + Stateful>(&mut self, name: &'static str) {
        let save = |world: &World, to: &mut Saver| world.resource::<T>().save(to);
        let restore = |world: &mut World, from: &mut Restorer<'_>| world.resource_mut::<T>().restore(from);
        let resource = TypeId::of::<T>();
        if self.0.iter().all(|part| part.resource != resource) {
            self.0.push(Part { resource, name, save, restore });
        }
    }
}

/// Saves all parts.
pub(super) fn save(world: &World, to: &mut Saver) {
    for part in &world.resource::<Parts>().0 {
        to.part(part.name);
        (part.save)(world, to);
    }
}

/// Restores all parts.
pub(super) fn restore(world: &mut World, from: &mut Restorer<'_>) -> Result<(), SnapshotError> {
    world.resource_scope(|world, parts: Mut<'_, Parts>| {
        parts.0.iter().try_for_each(|part| {
            from.part(part.name)?;
            (part.restore)(world, from)
        })
    })
}

fn save_heads(world: &World, to: &mut Saver) {
    for (_, head) in world.resource::<HeadTable>().0.iter().flatten() {
        to.value(&world.get::<HeadTrack>(*head));
    }
}

fn restore_heads(world: &mut World, from: &mut Restorer<'_>) -> Result<(), SnapshotError> {
    world.resource_scope(|world, heads: Mut<'_, HeadTable>| {
        heads.0.iter().flatten().try_for_each(|(_, head)| {
            let track: Option<HeadTrack> = from.value()?;
            if let (Some(track), Some(mut place)) = (track, world.get_mut::<HeadTrack>(*head)) {
                *place = track;
            }
            Ok(())
        })
    })
}

#[cfg(test)]
mod tests {
    use super::super::flow::{
        Events, HiddenAngles, Notices, Place, PlacedList, PositionedList, Requests, SensorTable,
    };
    use super::super::merge::Inbox;
    use super::super::{App, Mission};
    use super::*;
    use headrace_fusion::direct::DirectNavigation;
    use headrace_geometry::site::Site;
    use headrace_geometry::tunnel::shapes;

    /// A resource that is new must be sorted: a part of the state; or made when the loop is armed, to stay as it is or to
    /// begin anew with every tick.
    #[test]
    fn every_resource_is_saved_or_known_to_be_no_state() {
        let profile = shapes::circle(3.0).unwrap();
        let navigation = DirectNavigation::new(profile.clone(), Site::default());
        let dive = App::new(Mission::new(profile, 1.0)).arm(Box::new(navigation)).unwrap();
        let mut bare = World::new();
        super::super::stage::schedule().run(&mut bare);
        let types = |world: &World| -> Vec<TypeId> {
            world.iter_resources().filter_map(|(_, info, _)| info.type_id()).collect()
        };
        let bevys_own = types(&bare);
        let no_state = [
            TypeId::of::<Parts>(),
            TypeId::of::<Inbox>(),
            TypeId::of::<Events>(),
            TypeId::of::<PositionedList>(),
            TypeId::of::<PlacedList>(),
            TypeId::of::<Requests>(),
            TypeId::of::<Notices>(),
            TypeId::of::<Place>(),
            TypeId::of::<SensorTable>(),
            TypeId::of::<HiddenAngles>(),
        ];
        let parts: Vec<TypeId> =
            dive.world().resource::<Parts>().0.iter().map(|part| part.resource).collect();
        let resources = types(dive.world());
        let sorted = [&parts[..], &no_state, &bevys_own].concat();
        let unsorted = resources.iter().filter(|id| !sorted.contains(id)).count();
        assert_eq!(unsorted, 0, "of {} resources; the rest are saved, or no state", resources.len());
        assert!(parts.iter().all(|part| resources.contains(part)));
    }
}
