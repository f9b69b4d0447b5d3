//! Assembles a simulation. Effects add their systems, components and random streams through this module only.

use bevy_ecs::entity::Entity;
use bevy_ecs::prelude::{Component, IntoScheduleConfigs, SystemSet, World};
use bevy_ecs::schedule::{Schedule, ScheduleConfigs};
use bevy_ecs::system::{IntoSystem, ScheduleSystem};

use headrace_geometry::frames::Mount;
use headrace_sampling::head::HeadProgram;

use crate::facts::Facts;
use crate::notes;
use crate::random::Stream;
use crate::sensing::{Mounted, Scenery};
use crate::stages::Stage;

/// Systems, components and random streams that one effect adds to a simulation. The lists are shown to users.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Added {
    /// Name of the effect, as used in scenes.
    pub effect: &'static str,
    /// Systems that the effect adds, each with its stage.
    pub systems: Vec<(Stage, String)>,
    /// Names of the base systems (the systems without effects) that the effect replaces.
    pub replaces: Vec<&'static str>,
    /// Components that the effect adds, each with the ids of the sensors that get the component.
    pub components: Vec<(String, Vec<String>)>,
    /// Sources for which the effect draws random numbers during the dive.
    pub streams: Vec<String>,
    /// Text about the effect's change to the vehicle's trajectory; `None` if the effect doesn't change it.
    pub trajectory: Option<String>,
}

/// Position of a system in the sequence in which the schedule runs all systems.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, SystemSet)]
struct Slot(usize);

type Configs = ScheduleConfigs<ScheduleSystem>;

/// Access to the heads' programs. Effects may change the programs before the heads are switched on.
pub struct Programs<'a> {
    pub(crate) facts: &'a mut Facts,
    pub(crate) seed: u64,
    pub(crate) effect: &'static str,
    /// Effects that drew random numbers before the dive, each with the id of the sensor for which it drew them.
    pub(crate) drawn: &'a mut Vec<(&'static str, String)>,
}

impl Programs<'_> {
    /// Stream of random numbers of the current effect for a sensor.
    pub fn stream(&mut self, source: usize) -> Stream {
        let id = self.facts.sensors.get(source).map_or_else(String::new, |sensor| sensor.id.clone());
        let stream = Stream::new(self.seed, self.effect, &id);
        self.drawn.push((self.effect, id));
        stream
    }

    /// Changes the program of a head.
    pub fn change(&mut self, source: usize, how: impl FnOnce(HeadProgram) -> HeadProgram) {
        if let Some(sensor) = self.facts.sensors.get_mut(source) {
            sensor.program = sensor.program.map(how);
        }
    }
}

/// A simulation that is being assembled from base systems and effects.
pub struct Builder<'a> {
    world: &'a mut World,
    facts: &'a Facts,
    seed: u64,
    entities: &'a [Entity],
    systems: Vec<(Stage, Option<u16>, Configs)>,
    /// Index of the effect that is being built; `None` for the base systems.
    current: Option<usize>,
    added: Vec<Added>,
    base_systems: Vec<(Stage, String)>,
}

impl<'a> Builder<'a> {
    pub(crate) fn new(world: &'a mut World, facts: &'a Facts, seed: u64, entities: &'a [Entity]) -> Self {
        Self {
            world,
            facts,
            seed,
            entities,
            systems: Vec::new(),
            current: None,
            added: Vec::new(),
            base_systems: Vec::new(),
        }
    }

    /// Facts about the scene's vehicle and tunnel.
    pub fn facts(&self) -> &'a Facts {
        self.facts
    }

    /// Stream of random numbers of the current effect for a sensor.
    pub fn stream(&mut self, source: usize) -> Stream {
        let id = self.facts.sensors.get(source).map_or("", |sensor| sensor.id.as_str());
        self.stream_for(id)
    }

    /// Stream of random numbers of the current effect for a source that isn't a sensor.
    pub fn stream_for(&mut self, what: &str) -> Stream {
        let seed = self.seed;
        let effect = self.now().map_or("", |now| {
            now.streams.push(what.to_owned());
            now.effect
        });
        Stream::new(seed, effect, what)
    }

    /// Records sources for which the effect drew random numbers before the simulation was assembled.
    pub(crate) fn has_drawn(&mut self, sources: impl Iterator<Item = String>) {
        if let Some(now) = self.now() {
            now.streams.extend(sources);
        }
    }

    /// Returns the mount of a sensor on the vehicle. The effects built so far may have changed it.
    pub fn mount(&self, source: usize) -> Option<Mount> {
        self.world.get::<Mounted>(*self.entities.get(source)?).map(|mounted| mounted.0)
    }

    /// Adds a component of the current effect to a sensor.
    pub fn insert<C: Component>(&mut self, source: usize, component: C) {
        let Some(entity) = self.entities.get(source) else { return };
        self.world.entity_mut(*entity).insert(component);
        let id = self.facts.sensors.get(source).map_or_else(String::new, |sensor| sensor.id.clone());
        let name = short_name(core::any::type_name::<C>());
        let Some(now) = self.now() else { return };
        match now.components.iter_mut().find(|(known, _)| *known == name) {
            Some((_, sensors)) => sensors.push(id),
            None => now.components.push((name, vec![id])),
        }
    }

    /// Adds a system to a stage. It runs after the stage's existing systems.
    pub fn system<Marker>(
        &mut self,
        stage: Stage,
        system: impl IntoSystem<(), (), Marker> + IntoScheduleConfigs<ScheduleSystem, Marker>,
    ) {
        let name = short_name(core::any::type_name_of_val(&system));
        let effect = self.current.and_then(|index| u16::try_from(index).ok());
        match self.now() {
            Some(now) => now.systems.push((stage, name)),
            None => self.base_systems.push((stage, name)),
        }
        self.systems.push((stage, effect, system.into_configs()));
    }

    /// The scene's tunnel and the vehicle's trajectory, for effects that change the tunnel or the trajectory. `what`
    /// describes the change.
    pub fn scenery(&mut self, what: String) -> Option<bevy_ecs::change_detection::Mut<'_, Scenery>> {
        if let Some(now) = self.now() {
            now.trajectory = Some(what);
        }
        self.world.get_resource_mut::<Scenery>()
    }

    /// Duration of the dive, s, on the trajectory as changed by the effects built so far.
    pub fn duration_s(&self) -> f64 {
        self.world.get_resource::<Scenery>().map_or(0.0, |scenery| scenery.trajectory.duration_s())
    }

    /// Replaces the base system named `base`. That system is then not added.
    pub fn replace(&mut self, base: &'static str) {
        if let Some(now) = self.now() {
            now.replaces.push(base);
        }
    }

    /// Whether any effect of the scene replaces the base system named `base`.
    pub(crate) fn replaced(&self, base: &str) -> bool {
        self.added.iter().any(|added| added.replaces.contains(&base))
    }

    /// Begins the effect named `effect`. Systems and components that are added from here on belong to this effect.
    pub(crate) fn effect(&mut self, effect: &'static str) {
        self.current = Some(self.added.len());
        self.added.push(Added { effect, ..Added::default() });
    }

    /// Begins the base systems. Systems that are added from here on belong to no effect.
    pub(crate) fn base(&mut self) {
        self.current = None;
    }

    fn now(&mut self) -> Option<&mut Added> {
        self.current.and_then(|index| self.added.get_mut(index))
    }

    /// Makes the schedule: all systems in one chain, by stage, with base systems first.
    ///
    /// If `noting` is set, a recorder follows each system and records what the system changed.
    pub(crate) fn schedule(self, noting: bool) -> (Schedule, Vec<Added>, Vec<(Stage, String)>) {
        let mut schedule = Schedule::default();
        schedule.set_executor(bevy_ecs::schedule::SingleThreadedExecutor::new());
        let mut systems = self.systems;
        systems.sort_by_key(|(stage, effect, _)| (*stage, effect.is_some(), *effect));
        let mut slots = 0;
        let mut add = |schedule: &mut Schedule, configs: Configs| {
            schedule.add_systems(configs.in_set(Slot(slots)));
            if slots > 0 {
                schedule.configure_sets(Slot(slots).after(Slot(slots - 1)));
            }
            slots += 1;
        };
        for (_, effect, configs) in systems {
            add(&mut schedule, configs);
            if noting {
                add(&mut schedule, notes::note(effect).into_configs());
            }
        }
        (schedule, self.added, self.base_systems)
    }
}

/// Shortens the path of a type to its last two segments, and the path of its type parameter to the last segment.
fn short_name(name: &str) -> String {
    let last = |path: &str, count: usize| {
        let parts: Vec<&str> = path.rsplit("::").take(count).collect();
        parts.into_iter().rev().collect::<Vec<_>>().join("::")
    };
    match name.split_once('<') {
        Some((plain, inner)) => format!("{}<{}>", last(plain, 2), last(inner.trim_end_matches('>'), 1)),
        None => last(name, 2),
    }
}
