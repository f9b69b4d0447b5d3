//! A world of the loop: entities, resources, the systems of each stage, and the state that snapshots contain.

use core::any::TypeId;

use bevy_ecs::component::{Component, Mutable};
use bevy_ecs::entity::Entity;
use bevy_ecs::prelude::Resource;
use bevy_ecs::schedule::{
    IntoScheduleConfigs, LogLevel, Schedule, ScheduleBuildSettings, SingleThreadedExecutor, SystemSet,
};
use bevy_ecs::system::ScheduleSystem;
use bevy_ecs::world::World;

use super::error::PluginError;
use super::stage::Stage;
use headrace_geometry::snapshot::{Restorer, Saver, SnapshotError, Stateful};

/// A world whose stages are of type `S`. Each stage has a schedule of its own.
pub struct Part<S> {
    pub(super) world: World,
    stages: Vec<Systems<S>>,
    /// Entities whose components are part of the saved state, in snapshot order.
    pub(super) entities: Vec<Entity>,
    state: Vec<StateKind>,
}

/// Systems of a stage, with their schedule.
struct Systems<S> {
    stage: S,
    schedule: Schedule,
    is_empty: bool,
}

/// A kind of saved state: name, type of the resource or component, and functions to save and restore it.
struct StateKind {
    kind: TypeId,
    name: &'static str,
    save: fn(&World, &[Entity], &mut Saver),
    restore: fn(&mut World, &[Entity], &mut Restorer<'_>) -> Result<(), SnapshotError>,
}

/// Order of the systems of a stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, SystemSet)]
enum Order {
    Within,
    After,
}

impl<S: Stage> Part<S> {
    pub(super) fn new() -> Self {
        let systems = |stage: &S| Systems { stage: *stage, schedule: schedule(), is_empty: true };
        let stages = S::ALL.iter().map(systems).collect();
        Self { world: World::new(), stages, entities: Vec::new(), state: Vec::new() }
    }

    /// Adds a resource for a plugin's own systems.
    pub fn insert_resource(&mut self, resource: impl Resource) {
        self.world.insert_resource(resource);
    }

    /// Adds a resource that affects results. Snapshots store it under this name.
    pub fn insert_state(
        &mut self,
        name: &'static str,
        resource: impl Resource<Mutability = Mutable> + Stateful,
    ) {
        self.add_state_of(name, &resource);
        self.world.insert_resource(resource);
    }

    fn add_state_of<T: Resource<Mutability = Mutable> + Stateful>(&mut self, name: &'static str, _: &T) {
        self.add_state(StateKind {
            kind: TypeId::of::<T>(),
            name,
            save: |world, _, to| world.resource::<T>().save(to),
            restore: |world, _, from| world.resource_mut::<T>().restore(from),
        });
    }

    /// Registers a component of the entities as state, which snapshots contain.
    pub(super) fn add_component_state<T: Component<Mutability = Mutable> + Stateful>(
        &mut self,
        name: &'static str,
    ) {
        self.add_state(StateKind {
            kind: TypeId::of::<T>(),
            name,
            save: |world, entities, to| to.each(entities.iter().filter_map(|entity| world.get::<T>(*entity))),
            restore: |world, entities, from| {
                entities.iter().try_for_each(|entity| match world.get_mut::<T>(*entity) {
                    Some(mut component) => component.restore(from),
                    None => Ok(()),
                })
            },
        });
    }

    fn add_state(&mut self, state: StateKind) {
        if self.state.iter().all(|other| other.kind != state.kind) {
            self.state.push(state);
        }
    }

    /// Adds systems to a stage. The caller must order systems of one stage that share data.
    pub fn add_systems<M>(&mut self, stage: S, systems: impl IntoScheduleConfigs<ScheduleSystem, M>) {
        self.schedule(stage).add_systems(systems.in_set(Order::Within));
    }

    /// Adds systems that run when a stage has finished, such as systems that measure its run time.
    pub fn add_systems_after<M>(&mut self, stage: S, systems: impl IntoScheduleConfigs<ScheduleSystem, M>) {
        self.schedule(stage).add_systems(systems.in_set(Order::After));
    }

    /// A resource of this world.
    pub fn resource<T: Resource>(&self) -> Option<&T> {
        self.world.get_resource::<T>()
    }

    fn schedule(&mut self, stage: S) -> &mut Schedule {
        let found = self.stages.iter_mut().find(|other| other.stage == stage);
        #[expect(clippy::expect_used, reason = "Part::new gives each stage a schedule")]
        let systems = found.expect("every stage has a schedule");
        systems.is_empty = false;
        &mut systems.schedule
    }

    /// Builds the schedules, and runs them once without input, because the first run allocates.
    ///
    /// Errors: the order of two systems that share data is ambiguous.
    pub(super) fn initialize(&mut self) -> Result<(), PluginError> {
        let Self { world, stages, .. } = self;
        stages.iter_mut().try_for_each(|Systems { stage, schedule, .. }| {
            let built = schedule.initialize(world);
            let why = |error| PluginError::Schedule { why: format!("stage {stage:?}: {error:?}") };
            built.map(|_| ()).map_err(why)
        })?;
        for stage in S::ALL {
            self.run(*stage);
        }
        Ok(())
    }

    /// Runs the systems of a stage.
    pub(super) fn run(&mut self, stage: S) {
        let Self { world, stages, .. } = self;
        // Empty schedules are skipped, because running them takes time, too.
        if let Some(systems) = stages.iter_mut().find(|other| other.stage == stage && !other.is_empty) {
            systems.schedule.run(world);
        }
    }

    /// Saves the state to a snapshot.
    pub(super) fn save(&self, to: &mut Saver) {
        for state in &self.state {
            to.part(state.name);
            (state.save)(&self.world, &self.entities, to);
        }
    }

    /// Restores the state from a snapshot.
    ///
    /// Errors: the snapshot comes from another vehicle or version.
    pub(super) fn restore(&mut self, from: &mut Restorer<'_>) -> Result<(), SnapshotError> {
        let Self { world, entities, state, .. } = self;
        state.iter().try_for_each(|state| {
            from.part(state.name)?;
            (state.restore)(world, entities, from)
        })
    }
}

#[cfg(test)]
impl<S: Stage> Part<S> {
    /// Panics unless each resource and each component of the entities is either state or among the given
    /// types.
    ///
    /// The given types must be constant after arming, or set anew in each tick.
    pub(super) fn has_state_but_for(&self, others: &[TypeId]) {
        let mut bare = World::new();
        schedule().run(&mut bare);
        let kinds = |world: &World| -> Vec<TypeId> {
            world.iter_resources().filter_map(|(_, info, _)| info.type_id()).collect()
        };
        let components = self.entities.iter().flat_map(|entity| {
            let ids = self.world.entity(*entity).archetype().components().to_vec();
            ids.into_iter().filter_map(|id| self.world.components().get_info(id)?.type_id())
        });
        let found: Vec<TypeId> = kinds(&self.world).into_iter().chain(components).collect();
        let state: Vec<TypeId> = self.state.iter().map(|state| state.kind).collect();
        let listed = [&state[..], others, &kinds(&bare)].concat();
        let unlisted = found.iter().filter(|kind| !listed.contains(kind)).count();
        assert_eq!(unlisted, 0, "types that are neither state nor listed, of {}", found.len());
        assert!(state.iter().chain(others).all(|kind| found.contains(kind)), "a listed type is missing");
    }
}

/// Empty, single-threaded schedule that reports an ambiguous order of systems as an error.
fn schedule() -> Schedule {
    let mut schedule = Schedule::default();
    schedule.set_executor(SingleThreadedExecutor::new());
    schedule.set_build_settings(ScheduleBuildSettings {
        ambiguity_detection: LogLevel::Error,
        ..ScheduleBuildSettings::default()
    });
    schedule.configure_sets((Order::Within, Order::After).chain());
    schedule
}
