//! Splits a loop into three parts for the threads of a replay: georeferencing pings, advising, and the rest.
//!
//! Results on the wall don't affect navigation, and the advice depends on situations only. Data therefore
//! flows in one direction. [`Placer::tick`] fills a [`PlacedTick`], [`Advising::advise`] computes its advice,
//! and [`Loop::tick_placed`] does the rest of the tick. If the ticks stay in order, the results equal those
//! of [`Loop::tick`] bit for bit, on whatever threads the parts run. Several loops that differ only in target
//! or sections can share one placer.

use bevy_ecs::component::{Component, Mutable};
use bevy_ecs::entity::Entity;
use bevy_ecs::prelude::Resource;
use bevy_ecs::schedule::Schedule;
use bevy_ecs::world::World;

use super::console::{Commands, Console, ReceivedCommand};
use super::entities::{
    Head, HiddenAngles, LossCount, MeasuredMotion, Mounted, Navigator, SensorDecoder, SensorHealth,
    VehicleState,
};
use super::merge::Inbox;
use super::messages::{
    AdviceList, Event, Events, Placed, PlacedEvents, PlacedList, Positioned, PositionedList,
};
use super::resources::{Digests, Tally, Target, TickTime, TunnelDesign, VehicleEntities};
use super::result_stream::ResultStream;
use super::ring::PortReader;
use super::run::Loop;
use super::stage::{self, PlacedElsewhere};
use super::stages::{self, Advisor, SoundSpeed};
use headrace_geometry::snapshot::{Restorer, Saver, SnapshotError, Stateful};
use headrace_geometry::time::MonoNs;
use headrace_sampling::advice::Advice;

/// Lists that the loop had before it was split. They have room for any tick, and go back into the loop when
/// it is joined.
#[derive(Debug, Resource)]
struct KeptLists {
    lists: Lists,
    advice: Vec<Advice>,
}

/// Part from packets to georeferenced pings: decoders, navigation, and motion of the heads.
pub struct Placer {
    world: World,
    schedule: Schedule,
    readers: Vec<PortReader>,
}

/// Part that computes the advice.
pub struct Advising {
    advisor: Advisor,
}

/// Data that the later stages of a tick need from the earlier ones.
///
/// The lists are reused from tick to tick, and grow as needed.
#[derive(Debug)]
pub struct PlacedTick {
    now: MonoNs,
    inbox: Inbox,
    lists: Lists,
    commands: Vec<ReceivedCommand>,
    tally: Tally,
    console: (u64, u64),
    poses: ResultStream,
    vehicle: VehicleState,
    health: Vec<SensorHealth>,
}

/// Lists that early stages fill and later stages read.
#[derive(Debug, Default)]
struct Lists {
    events: Vec<Event>,
    positioned: Vec<Positioned>,
    placed: Vec<Placed>,
    of_events: Vec<usize>,
}

impl Lists {
    fn swap(&mut self, world: &mut World, advice: &mut Vec<Advice>) {
        core::mem::swap(&mut world.resource_mut::<Events>().0, &mut self.events);
        core::mem::swap(&mut world.resource_mut::<PositionedList>().0, &mut self.positioned);
        core::mem::swap(&mut world.resource_mut::<PlacedList>().0, &mut self.placed);
        core::mem::swap(&mut world.resource_mut::<PlacedEvents>().0, &mut self.of_events);
        core::mem::swap(&mut world.resource_mut::<AdviceList>().0, advice);
    }

    fn copy_to(&self, world: &mut World, advice: &[Advice]) {
        refill(&mut world.resource_mut::<Events>().0, &self.events);
        refill(&mut world.resource_mut::<PositionedList>().0, &self.positioned);
        refill(&mut world.resource_mut::<PlacedList>().0, &self.placed);
        refill(&mut world.resource_mut::<PlacedEvents>().0, &self.of_events);
        refill(&mut world.resource_mut::<AdviceList>().0, advice);
    }
}

impl Default for PlacedTick {
    fn default() -> Self {
        Self {
            now: MonoNs(0),
            inbox: Inbox::growing(),
            lists: Lists::default(),
            commands: Vec::new(),
            tally: Tally::default(),
            console: (0, 0),
            poses: ResultStream::default(),
            vehicle: VehicleState::default(),
            health: Vec::new(),
        }
    }
}

impl Placer {
    /// Processes the waiting packets up to georeferenced pings. `now` is the end of the tick's time.
    pub fn tick(&mut self, now: MonoNs, into: &mut PlacedTick) {
        let Self { world, schedule, readers } = self;
        world.resource_mut::<Digests>().next_tick();
        world.resource_mut::<Inbox>().fill(readers);
        schedule.run(world);
        into.now = now;
        world.resource_mut::<Inbox>().swap_packets(&mut into.inbox);
        core::mem::swap(&mut world.resource_mut::<Events>().0, &mut into.lists.events);
        core::mem::swap(&mut world.resource_mut::<PositionedList>().0, &mut into.lists.positioned);
        core::mem::swap(&mut world.resource_mut::<PlacedList>().0, &mut into.lists.placed);
        core::mem::swap(&mut world.resource_mut::<PlacedEvents>().0, &mut into.lists.of_events);
        // The commands are copied, since the capacity of the world's list limits the commands of a tick.
        into.commands.clone_from(&world.resource::<Commands>().0);
        into.tally = *world.resource::<Tally>();
        let counts = world.resource::<Console>().counts;
        into.console = (counts.packets, counts.invalid);
        into.poses.follow(&world.resource::<Digests>().poses);
        let entities = world.resource::<VehicleEntities>();
        into.vehicle = world.get::<VehicleState>(entities.vehicle).copied().unwrap_or_default();
        into.health.clear();
        into.health.extend(entities.by_source.iter().filter_map(|sensor| world.get::<SensorHealth>(*sensor)));
    }

    /// Whether packets are waiting in the rings.
    pub fn has_waiting(&self) -> bool {
        self.readers.iter().any(|reader| reader.peek().is_some())
    }

    /// Copies the state of another loop's placer.
    ///
    /// Errors: the other placer has other sensors or another navigation. This placer must not be used
    /// afterwards.
    pub fn take_over(&mut self, other: &Self) -> Result<(), SnapshotError> {
        let mut to = Saver::default();
        to.part("placer");
        for kind in STATE {
            (kind.save)(&other.world, &mut to);
        }
        let bytes = to.finish()?;
        let mut from = Restorer::new(&bytes);
        from.part("placer")?;
        STATE.iter().try_for_each(|kind| (kind.restore)(&mut self.world, &mut from))?;
        if from.is_empty() { Ok(()) } else { Err(from.unfit("it has extra bytes at its end".to_owned())) }
    }

    fn state_of<T: Component + Stateful>(world: &World, to: &mut Saver) {
        let entities = world.resource::<VehicleEntities>().all();
        to.each(entities.filter_map(|entity| world.get::<T>(entity)));
    }

    fn restore_of<T: Component<Mutability = Mutable> + Stateful>(
        world: &mut World,
        from: &mut Restorer<'_>,
    ) -> Result<(), SnapshotError> {
        let all: Vec<Entity> = world.resource::<VehicleEntities>().all().collect();
        all.into_iter().try_for_each(|entity| match world.get_mut::<T>(entity) {
            Some(mut component) => component.restore(from),
            None => Ok(()),
        })
    }
}

/// Functions that save and restore the components of one type in a [`Placer`].
struct PlacerState {
    save: fn(&World, &mut Saver),
    restore: fn(&mut World, &mut Restorer<'_>) -> Result<(), SnapshotError>,
}

/// State that [`Loop::join`] takes back. The speed of sound of the readings is handled separately.
const STATE: [PlacerState; 6] = [
    PlacerState { save: Placer::state_of::<Navigator>, restore: Placer::restore_of::<Navigator> },
    PlacerState { save: Placer::state_of::<SensorDecoder>, restore: Placer::restore_of::<SensorDecoder> },
    PlacerState { save: Placer::state_of::<SensorHealth>, restore: Placer::restore_of::<SensorHealth> },
    PlacerState { save: Placer::state_of::<MeasuredMotion>, restore: Placer::restore_of::<MeasuredMotion> },
    PlacerState { save: Placer::state_of::<LossCount>, restore: Placer::restore_of::<LossCount> },
    PlacerState {
        save: |world, to| world.resource::<SoundSpeed>().save(to),
        restore: |world, from| world.resource_mut::<SoundSpeed>().restore(from),
    },
];

impl Advising {
    /// Advice for a tick. Every tick must be passed once and in order.
    pub fn advise(&mut self, tick: &PlacedTick, into: &mut Vec<Advice>) {
        let begun = tick.tally.span.map(|(first, _)| first);
        self.advisor.fill(&tick.lists.placed, begun, into);
    }
}

impl Loop {
    /// Splits off parts of this loop for other threads, until [`Loop::join`] puts them back.
    ///
    /// Returns `None` if a plugin has systems in a stage that georeferences pings, or if the loop is already
    /// split. While the loop is split, [`Loop::tick_placed`] replaces [`Loop::tick`], and the loop can't be
    /// saved. The placer then has the state of decoders and navigation, so [`Loop::fix`] and
    /// [`Loop::consistency`] panic.
    pub fn split(&mut self) -> Option<(Placer, Advising)> {
        if self.is_split() || self.has_own_placing {
            return None;
        }
        let (world, readers) = self.split_world();
        let placing = placing_world(world);
        let mut schedule = stage::schedule();
        stages::add_placing(&mut schedule);
        let advisor = world.remove_resource::<Advisor>()?;
        let (mut lists, mut advice) = (Lists::default(), Vec::new());
        lists.swap(world, &mut advice);
        lists.copy_to(world, &advice);
        world.insert_resource(KeptLists { lists, advice });
        world.insert_resource(PlacedElsewhere);
        Some((Placer { world: placing, schedule, readers: core::mem::take(readers) }, Advising { advisor }))
    }

    /// Whether parts of the loop are split off.
    pub fn is_split(&self) -> bool {
        self.resource::<PlacedElsewhere>().is_some()
    }

    /// Runs the later stages of a tick with the tick's advice.
    ///
    /// Returns false if a lagging outlet holds back the tick's packets. The call then counts as a tick
    /// without packets. Pass the same tick again a little later.
    pub fn tick_placed(&mut self, tick: &PlacedTick, advice: &[Advice]) -> bool {
        self.tick_with(tick, &mut |world| tick.lists.copy_to(world, advice))
    }

    /// Runs the later stages of a tick that no other loop needs. The tick's lists are swapped with those of
    /// the previous tick.
    pub fn tick_taken(&mut self, tick: &mut PlacedTick, advice: &mut Vec<Advice>) -> bool {
        let mut lists = core::mem::take(&mut tick.lists);
        let is_taken = self.tick_with(tick, &mut |world| lists.swap(world, advice));
        tick.lists = lists;
        is_taken
    }

    fn tick_with(&mut self, tick: &PlacedTick, hand_over_lists: &mut dyn FnMut(&mut World)) -> bool {
        let ticks = self.ticks();
        let (world, _) = self.split_world();
        *world.resource_mut::<TickTime>() = TickTime { index: ticks, now: tick.now };
        world.resource_mut::<Digests>().next_tick();
        let is_taken = world.resource_mut::<Inbox>().take_packets(&tick.inbox);
        if is_taken {
            hand_over_lists(world);
            hand_over(world, tick);
        } else {
            world.resource_mut::<Events>().0.clear();
            world.resource_mut::<Commands>().0.clear();
            world.resource_mut::<PositionedList>().0.clear();
            world.resource_mut::<PlacedList>().0.clear();
            world.resource_mut::<PlacedEvents>().0.clear();
            world.resource_mut::<AdviceList>().0.clear();
        }
        self.run_stages();
        is_taken
    }

    /// Puts the parts back into the loop, after the last tick that they have processed.
    pub fn join(&mut self, placer: Placer, advising: Advising) {
        let Placer { world: mut placing, readers, .. } = placer;
        let (world, own) = self.split_world();
        *own = readers;
        world.remove_resource::<PlacedElsewhere>();
        if let Some(KeptLists { mut lists, mut advice }) = world.remove_resource() {
            lists.swap(world, &mut advice);
            lists.copy_to(world, &advice);
        }
        world.insert_resource(advising.advisor);
        let (from, to) =
            (placing.resource::<VehicleEntities>().clone(), world.resource::<VehicleEntities>().clone());
        for (from, to) in from.all().zip(to.all()) {
            move_component::<Navigator>(&mut placing, from, world, to);
            move_component::<SensorDecoder>(&mut placing, from, world, to);
            move_component::<SensorHealth>(&mut placing, from, world, to);
            move_component::<MeasuredMotion>(&mut placing, from, world, to);
            move_component::<LossCount>(&mut placing, from, world, to);
        }
        world.insert_resource(placing.resource::<SoundSpeed>().clone());
    }
}

/// World of a loop's [`Placer`].
fn placing_world(world: &mut World) -> World {
    let mut placing = World::new();
    let of = world.resource::<VehicleEntities>().clone();
    let mut copies = of.all().map(|entity| {
        let copy = placing.spawn_empty().id();
        move_component::<Navigator>(world, entity, &mut placing, copy);
        move_component::<SensorDecoder>(world, entity, &mut placing, copy);
        copy_component::<VehicleState>(world, entity, &mut placing, copy);
        copy_component::<Mounted>(world, entity, &mut placing, copy);
        copy_component::<SensorHealth>(world, entity, &mut placing, copy);
        copy_component::<Head>(world, entity, &mut placing, copy);
        copy_component::<MeasuredMotion>(world, entity, &mut placing, copy);
        copy_component::<LossCount>(world, entity, &mut placing, copy);
        copy_component::<HiddenAngles>(world, entity, &mut placing, copy);
        copy
    });
    let vehicle = copies.next();
    let by_source: Vec<Entity> = copies.collect();
    let number = |head: &Entity| of.by_source.iter().position(|sensor| sensor == head);
    let heads = of.heads.iter().filter_map(|head| by_source.get(number(head)?).copied()).collect();
    let entities = VehicleEntities { vehicle: vehicle.unwrap_or(of.vehicle), by_source, heads };
    placing.insert_resource(entities);
    placing.insert_resource(Inbox::growing());
    placing.insert_resource(Events(Vec::new()));
    placing.insert_resource(Commands::new());
    placing.insert_resource(PositionedList(Vec::new()));
    placing.insert_resource(PlacedList(Vec::new()));
    placing.insert_resource(PlacedEvents(Vec::new()));
    placing.insert_resource(*world.resource::<Tally>());
    placing.insert_resource(world.resource::<SoundSpeed>().clone());
    placing.insert_resource(*world.resource::<Target>());
    placing.insert_resource(world.resource::<TunnelDesign>().clone());
    let Console { source, counts } = *world.resource::<Console>();
    placing.insert_resource(Console { source, counts });
    let poses = world.resource::<Digests>().poses.clone();
    placing.insert_resource(Digests { poses, ..Digests::default() });
    placing
}

/// Copies the counts and other small data of a tick's earlier stages into the world.
fn hand_over(world: &mut World, tick: &PlacedTick) {
    refill(&mut world.resource_mut::<Commands>().0, &tick.commands);
    let mut tally = world.resource_mut::<Tally>();
    (tally.packets, tally.span) = (tick.tally.packets, tick.tally.span);
    let counts = &mut world.resource_mut::<Console>().counts;
    (counts.packets, counts.invalid) = tick.console;
    world.resource_mut::<Digests>().poses.follow(&tick.poses);
    let vehicle = world.resource::<VehicleEntities>().vehicle;
    if let Some(mut state) = world.get_mut::<VehicleState>(vehicle) {
        *state = tick.vehicle;
    }
    for (source, health) in tick.health.iter().enumerate() {
        let sensor = world.resource::<VehicleEntities>().by_source.get(source).copied();
        if let Some(mut to) = sensor.and_then(|sensor| world.get_mut::<SensorHealth>(sensor)) {
            *to = *health;
        }
    }
}

fn refill<T: Copy>(list: &mut Vec<T>, with: &[T]) {
    list.clear();
    list.extend_from_slice(with);
}

fn move_component<T: Component>(from: &mut World, at: Entity, to: &mut World, entity: Entity) {
    if let Some(component) = from.entity_mut(at).take::<T>() {
        to.entity_mut(entity).insert(component);
    }
}

fn copy_component<T: Component + Clone>(from: &World, at: Entity, to: &mut World, entity: Entity) {
    if let Some(component) = from.get::<T>(at).cloned() {
        to.entity_mut(entity).insert(component);
    }
}
