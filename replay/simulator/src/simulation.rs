//! A simulated dive.
//!
//! The simulation is an ECS (entity component system): its world has an entity for each sensor. Base systems implement
//! the stages from polling the devices to encoding their messages. The systems of the scene's effects run between the
//! base systems. The schedule runs once per slice of the dive.

use bevy_ecs::entity::Entity;
use bevy_ecs::prelude::World;
use bevy_ecs::schedule::Schedule;
use headrace_geometry::frames::Pose;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::device::{Emulated, EmulatorSetup, Sense};
use headrace_sensor::measurement::{GroundVelocity, Inertia, Measurement, Payout, Pressure, Sounding};

use crate::builder::{Added, Builder, Programs};
use crate::clock::START;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::notes::{Before, LineBefore, Notes};
use crate::outbox::{Message, Outbox};
use crate::scene::Scene;
use crate::sensing::{
    Device, Echosounder, Head, Line, Mounted, Rays, Reach, Samples, Scenery, Slice, Source,
};
use crate::stages::{self, AIM_HELD, Frozen, Held, Stage};
use crate::trajectory::PilotAdvice;
use crate::truth::{self, TruthRow};

/// Length of a time slice. A second is long enough to make the overhead of the schedule negligible.
const SLICE: DurNs = DurNs(1_000_000_000);
/// Distance up to which walls are computed, as a multiple of a sonar's range. It is larger than 1 because effects may
/// shorten the reported range of a farther wall.
const REACH_SHARE: f64 = 1.25;
/// Largest range of an echosounder, m.
const ECHOSOUNDER_REACH_M: f64 = 100.0;

/// A time later than any time of a dive.
const NEVER: MonoNs = MonoNs(u64::MAX);

/// An on-board monitor whose advice the simulated pilot follows.
pub trait Adviser: Send {
    /// Processes a message that has crossed its line. Messages must be passed in order of time.
    fn hear(&mut self, message: &Message<'_>);

    /// Returns the advice given since the previous call, in order of time.
    fn advice(&mut self) -> Vec<PilotAdvice>;
}

/// Source of the requests that the devices receive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Asker {
    /// Emulated hosts send the requests.
    Itself,
    /// Emulated hosts send the requests. The simulation also keeps the ground truth.
    Noted,
    /// Real hosts send the requests.
    Hosts,
}

/// A simulated dive: messages in the order of (time, source, sequence).
pub struct Simulation {
    world: World,
    schedule: Schedule,
    entities: Vec<Entity>,
    end: MonoNs,
    slice: DurNs,
    outbox: Outbox,
    added: Vec<Added>,
    base: Vec<(Stage, String)>,
    truth: Option<Vec<TruthRow>>,
    adviser: Option<Box<dyn Adviser>>,
}

impl Simulation {
    /// Sets up the scene's devices in its tunnel. Heads follow the scene's programs.
    ///
    /// Errors: effects contradict each other or the scene, or the trajectory leads through a wall.
    pub fn new(scene: &Scene) -> Result<Self, SceneError> {
        Self::assemble(scene, Asker::Itself)
    }

    /// Creates a simulation with devices that serve real hosts.
    ///
    /// Hosts send bytes through [`Simulation::hear`], and [`Simulation::go_on`] advances the time. The vehicle is
    /// stationary until [`Simulation::set_out`].
    ///
    /// Errors: as for [`Simulation::new`].
    pub fn for_hosts(scene: &Scene) -> Result<Self, SceneError> {
        let mut simulation = Self::assemble(scene, Asker::Hosts)?;
        simulation.set_out(NEVER);
        Ok(simulation)
    }

    /// Creates a simulation that keeps its ground truth for [`Simulation::take_truth`].
    ///
    /// Errors: as for [`Simulation::new`].
    pub fn with_truth(scene: &Scene) -> Result<Self, SceneError> {
        Self::assemble(scene, Asker::Noted)
    }

    fn assemble(scene: &Scene, asker: Asker) -> Result<Self, SceneError> {
        let noting = asker == Asker::Noted;
        let mut world = World::new();
        world.insert_resource(Slice { from: START, until: START });
        world.insert_resource(Scenery {
            environment: scene.environment.clone(),
            trajectory: scene.trajectory.clone(),
            site: scene.vehicle.site,
            sets_out: None,
        });
        let (facts, drawn) = programmed(scene);
        let entities = spawn_sensors(&mut world, scene, &facts, asker);
        if noting {
            world.insert_resource(Notes::default());
        }
        let mut sim = Builder::new(&mut world, &facts, scene.seed, &entities);
        for (kind, effect) in scene.active() {
            sim.effect(kind.name());
            sim.has_drawn(drawn.iter().filter(|(name, _)| *name == kind.name()).map(|(_, id)| id.clone()));
            effect.build(&mut sim)?;
        }
        sim.base();
        if asker == Asker::Hosts {
            // The system `freeze` must run after all effects on the cable counters, and before the counters encode
            // their counts.
            sim.system(Stage::Tell, stages::freeze);
        }
        add_base_systems(&mut sim);
        let (schedule, added, base) = sim.schedule(noting);
        let duration_s = match world.get_resource::<Scenery>() {
            Some(scenery) => {
                scenery.check()?;
                scenery.trajectory.duration_s()
            }
            None => 0.0,
        };
        let end = START + DurNs::from_secs_f64(duration_s);
        let truth = noting.then(Vec::new);
        let outbox = Outbox::new(entities.len());
        Ok(Self { world, schedule, entities, end, slice: SLICE, outbox, added, base, truth, adviser: None })
    }

    /// Makes the pilot listen to `adviser`.
    ///
    /// An adviser has an effect only if the trajectory is that of an advised pilot ([`Scene::is_advised`]). Without an
    /// adviser, an advised pilot gets no advice.
    #[must_use]
    pub fn advised_by(self, adviser: Box<dyn Adviser>) -> Self {
        Self { adviser: Some(adviser), ..self }
    }

    /// Time at the end of the dive.
    pub fn end(&self) -> MonoNs {
        self.end
    }

    /// Duration of the dive, s.
    pub fn duration_s(&self) -> f64 {
        self.scenery().map_or(0.0, |scenery| scenery.trajectory.duration_s())
    }

    /// True pose of the vehicle at time `at`.
    pub fn pose(&self, at: MonoNs) -> Option<Pose> {
        self.world.get_resource::<Scenery>().map(|scenery| scenery.pose(at))
    }

    /// The tunnel, the trajectory and the water.
    pub fn scenery(&self) -> Option<&Scenery> {
        self.world.get_resource::<Scenery>()
    }

    /// Systems, components and random streams added by each effect of the scene.
    pub fn added(&self) -> &[Added] {
        &self.added
    }

    /// The base systems of the simulation, without those that effects replace.
    pub fn base_systems(&self) -> &[(Stage, String)] {
        &self.base
    }

    /// The next message, or `None` at the end of the dive.
    pub fn next_message(&mut self) -> Option<Message<'_>> {
        if !self.come() {
            return None;
        }
        let message = self.outbox.next()?;
        if let Some(adviser) = &mut self.adviser {
            adviser.hear(&message);
        }
        Some(message)
    }

    /// Returns the next message on any line, without removing it.
    pub fn peek_message(&mut self) -> Option<Message<'_>> {
        self.come().then(|| self.outbox.peek()).flatten()
    }

    /// Simulates until a message is available; false at the end of the dive.
    fn come(&mut self) -> bool {
        while !self.outbox.has_next() {
            if !self.next_slice() {
                return false;
            }
        }
        true
    }

    /// Ground truth of all measurements since the previous call. Empty unless the simulation was created by
    /// [`Simulation::with_truth`].
    pub fn take_truth(&mut self) -> Vec<TruthRow> {
        self.truth.as_mut().map(std::mem::take).unwrap_or_default()
    }

    /// Simulates a second of the dive for its ground truth and discards the messages. Returns false at the end of the
    /// dive.
    pub fn advance(&mut self) -> bool {
        let more = self.next_slice();
        if let Some(adviser) = &mut self.adviser {
            while let Some(message) = self.outbox.next() {
                adviser.hear(&message);
            }
        }
        self.outbox.skip();
        more
    }

    /// Passes bytes from a host to device number `source` of the vehicle file.
    ///
    /// `at` must not be before the end of the time that is already simulated.
    pub fn hear(&mut self, source: usize, at: MonoNs, bytes: &[u8]) {
        let Some(entity) = self.entities.get(source).copied() else { return };
        hear::<Sounding>(&mut self.world, entity, at, bytes);
        hear::<Pressure>(&mut self.world, entity, at, bytes);
        hear::<Inertia>(&mut self.world, entity, at, bytes);
        hear::<Payout>(&mut self.world, entity, at, bytes);
        hear::<GroundVelocity>(&mut self.world, entity, at, bytes);
    }

    /// Starts the vehicle's movement at `at`. The dive then ends at the end of the trajectory.
    pub fn set_out(&mut self, at: MonoNs) {
        if let Some(mut scenery) = self.world.get_resource_mut::<Scenery>() {
            scenery.sets_out = Some(at);
            self.end =
                if at == NEVER { NEVER } else { at + DurNs::from_secs_f64(scenery.trajectory.duration_s()) };
        }
    }

    /// Replaces device number `source` of the vehicle file by a device that is switched on now. A cable counter keeps
    /// its count.
    pub fn restart(&mut self, scene: &Scene, source: usize) {
        let (facts, _) = programmed(scene);
        let parts = (self.entities.get(source), scene.vehicle.sensors.get(source), facts.sensors.get(source));
        let (Some(entity), Some(sensor), Some(facts)) = parts else { return };
        let Some(slice) = self.world.get_resource::<Slice>() else { return };
        let site = scene.vehicle.site;
        let setup = EmulatorSetup { start: slice.until, head: facts.program, site, polled: false };
        let mut entity = self.world.entity_mut(*entity);
        match sensor.emulator(&setup) {
            Emulated::Head(device) | Emulated::Echosounder(device) => _ = entity.insert(Device(device)),
            Emulated::Depth(device) => _ = entity.insert(Device(device)),
            Emulated::Inertial(device) => _ = entity.insert(Device(device)),
            Emulated::VelocityLog(device) => _ = entity.insert(Device(device)),
            Emulated::Tether(_) => {}
        }
    }

    /// If `is_frozen`, makes the cable counters repeat their next count. Otherwise makes them count again. Returns the
    /// counters' numbers in the vehicle file.
    pub fn freeze_counters(&mut self, is_frozen: bool) -> Vec<usize> {
        let mut frozen = Vec::new();
        for (number, entity) in self.entities.iter().enumerate() {
            let mut entity = self.world.entity_mut(*entity);
            if !entity.contains::<Samples<Payout>>() {
                continue;
            }
            frozen.push(number);
            if !is_frozen {
                entity.remove::<Frozen>();
            } else if !entity.contains::<Frozen>() {
                entity.insert(Frozen::default());
            }
        }
        frozen
    }

    /// Simulates up to `until`, for real hosts. [`Simulation::waiting_message`] then returns the messages that crossed
    /// the lines before `until`.
    pub fn go_on(&mut self, until: MonoNs) {
        let Some(slice) = self.world.get_resource::<Slice>() else { return };
        if until > slice.until {
            self.simulate(until);
        }
    }

    /// The next message that has crossed its line. Does not advance the simulation.
    pub fn waiting_message(&mut self) -> Option<Message<'_>> {
        self.outbox.has_next().then(|| self.outbox.next()).flatten()
    }

    /// Simulates the next slice. Returns false at the end of the dive.
    fn next_slice(&mut self) -> bool {
        let Some(slice) = self.world.get_resource::<Slice>() else { return false };
        let soon = slice.until + self.slice;
        if let Some(mut scenery) =
            self.world.get_resource_mut::<Scenery>().filter(|s| s.trajectory.is_advised())
        {
            let advice = self.adviser.as_mut().map(|adviser| adviser.advice()).unwrap_or_default();
            scenery.trajectory.lead(advice, soon.since(START).as_secs_f64());
            self.end = START + DurNs::from_secs_f64(scenery.trajectory.duration_s());
        }
        let Some(slice) = self.world.get_resource::<Slice>() else { return false };
        // A slice doesn't include its end. One nanosecond is added, so that the last slice includes a measurement at
        // the very end of the dive.
        let last = self.end + DurNs(1);
        if slice.until >= last {
            return self.outbox.finish();
        }
        let until = (slice.until + self.slice).min(last);
        self.simulate(until);
        true
    }

    fn simulate(&mut self, until: MonoNs) {
        if let Some(mut slice) = self.world.get_resource_mut::<Slice>() {
            slice.from = slice.until;
            slice.until = until;
        }
        self.schedule.run(&mut self.world);
        if let Some(rows) = &mut self.truth {
            truth::collect(&mut self.world, &self.entities, rows);
        }
        for (source, entity) in self.entities.iter().enumerate() {
            if let Some(mut line) = self.world.get_mut::<Line>(*entity) {
                self.outbox.take(source, &mut line);
            }
        }
        self.outbox.release(until);
    }
}

#[cfg(test)]
impl Simulation {
    /// Sets another length of slices. The length must not change any result.
    pub(crate) fn in_slices(self, slice: DurNs) -> Self {
        Self { slice, ..self }
    }

    /// Removes all sensors except `source` from the vehicle.
    fn keep_only(&mut self, source: usize) {
        for (other, entity) in self.entities.iter().enumerate() {
            if other != source {
                self.world.despawn(*entity);
            }
        }
    }

    /// All measurements of the sensor `source` in the dive. No other sensor is simulated.
    pub(crate) fn measurements_of<M: Measurement>(mut self, source: usize) -> Vec<M> {
        self.keep_only(source);
        let mut all: Vec<M> = Vec::new();
        while self.next_slice() {
            let samples = self.world.get::<Samples<M>>(self.entities[source]).unwrap();
            if samples.first == all.len() as u64 {
                all.extend_from_slice(&samples.list);
            }
        }
        all
    }
}

/// Passes bytes from a host to a device that measures `M`. If the device replies at once, the reply is put on its line.
fn hear<M: Measurement>(world: &mut World, entity: Entity, at: MonoNs, bytes: &[u8]) {
    let mut entity = world.entity_mut(entity);
    let Ok((mut device, mut line)) = entity.get_components_mut::<(&mut Device<M>, &mut Line)>() else {
        return;
    };
    device.0.hear(at, bytes, &mut |direction, at, bytes| line.send(at, direction, bytes, 0));
}

/// Facts about the scene's vehicle and tunnel, with the heads' programs as changed by effects. Also returns the random
/// streams that these effects used.
fn programmed(scene: &Scene) -> (Facts, Vec<(&'static str, String)>) {
    let (mut facts, mut drawn) = (scene.facts.clone(), Vec::new());
    for (kind, effect) in scene.active() {
        let (effect_name, seed) = (kind.name(), scene.seed);
        effect.begin(&mut Programs { facts: &mut facts, seed, effect: effect_name, drawn: &mut drawn });
    }
    (facts, drawn)
}

fn spawn_sensors(world: &mut World, scene: &Scene, facts: &Facts, asker: Asker) -> Vec<Entity> {
    let (noting, polled) = (asker == Asker::Noted, asker != Asker::Hosts);
    let sensors = scene.vehicle.sensors.iter().zip(&scene.vehicle.sensor_configs).zip(&facts.sensors);
    let site = scene.vehicle.site;
    let mut entities = Vec::new();
    for (number, ((sensor, config), facts)) in (0..).zip(sensors) {
        let setup = EmulatorSetup { start: START, head: facts.program, site, polled };
        let entity = world.spawn((Source(number), Mounted(config.mount), Line::default())).id();
        if noting {
            world.entity_mut(entity).insert(LineBefore::default());
        }
        match sensor.emulator(&setup) {
            Emulated::Head(device) => {
                spawn_device(world, entity, Device(device), noting);
                let mut head = world.entity_mut(entity);
                head.insert((Rays::default(), Held::default()));
                if let Some(spec) = facts.head {
                    let [_, reach_m] = spec.reach_m(site.sound_speed_mps);
                    head.insert((Head(spec), Reach(reach_m * REACH_SHARE)));
                }
            }
            Emulated::Echosounder(device) => {
                spawn_device(world, entity, Device(device), noting);
                let parts = (Echosounder, Rays::default(), Reach(ECHOSOUNDER_REACH_M));
                world.entity_mut(entity).insert(parts);
            }
            Emulated::Depth(device) => spawn_device(world, entity, Device(device), noting),
            Emulated::Inertial(device) => spawn_device(world, entity, Device(device), noting),
            Emulated::VelocityLog(device) => spawn_device(world, entity, Device(device), noting),
            Emulated::Tether(device) => spawn_device(world, entity, Device(device), noting),
        }
        entities.push(entity);
    }
    entities
}

fn spawn_device<M: Measurement>(world: &mut World, entity: Entity, device: Device<M>, noting: bool) {
    world.entity_mut(entity).insert((device, Samples::<M>::default()));
    if noting {
        world.entity_mut(entity).insert(Before::<M>::default());
    }
}

/// Adds systems for the vehicle's sensors, except those that effects replace.
fn add_base_systems(sim: &mut Builder<'_>) {
    let has = |sense: Sense| sim.facts().sensors.iter().any(|sensor| sensor.sense == sense);
    let [head, echosounder, depth, inertial, velocity, tether] =
        [Sense::Head, Sense::Echosounder, Sense::Depth, Sense::Inertial, Sense::Velocity, Sense::Tether]
            .map(has);
    if head && !sim.replaced(AIM_HELD) {
        sim.system(Stage::Aim, stages::aim_held);
    }
    if echosounder {
        sim.system(Stage::Aim, stages::aim_echosounders);
    }
    if head || echosounder {
        sim.system(Stage::Begin, stages::begin::<Sounding>);
        sim.system(Stage::Look, stages::look);
        sim.system(Stage::Tell, stages::tell::<Sounding>);
    }
    if depth {
        sim.system(Stage::Begin, stages::begin::<Pressure>);
        sim.system(Stage::Feel, stages::feel_pressure);
        sim.system(Stage::Tell, stages::tell::<Pressure>);
    }
    if inertial {
        sim.system(Stage::Begin, stages::begin::<Inertia>);
        sim.system(Stage::Feel, stages::feel_motion);
        sim.system(Stage::Tell, stages::tell::<Inertia>);
    }
    if velocity {
        sim.system(Stage::Begin, stages::begin::<GroundVelocity>);
        sim.system(Stage::Feel, stages::feel_velocity);
        sim.system(Stage::Tell, stages::tell::<GroundVelocity>);
    }
    if tether {
        sim.system(Stage::Begin, stages::begin::<Payout>);
        sim.system(Stage::Feel, stages::feel_cable);
        sim.system(Stage::Tell, stages::tell::<Payout>);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing_motion::Bench;

    /// Readings of the cable counter during the next half second of a simulation with real hosts, m.
    fn counts_m(simulation: &mut Simulation, tether: usize, at: &mut MonoNs) -> Vec<f64> {
        *at = *at + DurNs(500_000_000);
        simulation.go_on(*at);
        let samples = simulation.world.get::<Samples<Payout>>(simulation.entities[tether]).unwrap();
        samples.list.iter().map(|payout| payout.chainage_m).collect()
    }

    #[test]
    fn frozen_cable_counter_repeats_its_count_until_released() {
        let bench = Bench::turning("");
        let mut simulation = Simulation::for_hosts(&bench.scene()).unwrap();
        simulation.set_out(START);
        let (tether, mut at) = (bench.source("tether"), START);
        let mut count = |simulation: &mut Simulation| counts_m(simulation, tether, &mut at);
        let is_moving = |counts: &[f64]| counts.windows(2).all(|pair| pair[0] < pair[1]);
        assert!(is_moving(&count(&mut simulation)));
        assert_eq!(simulation.freeze_counters(true), [tether]);
        let frozen = [count(&mut simulation), count(&mut simulation)].concat();
        assert!(frozen.len() > 10 && frozen.iter().all(|m| m.to_bits() == frozen[0].to_bits()), "{frozen:?}");
        assert_eq!(simulation.freeze_counters(false), [tether]);
        let after = count(&mut simulation);
        assert!(is_moving(&after) && after[0] > frozen[0] + 0.05, "{after:?}");
    }

    #[test]
    fn restarted_echosounder_forgets_the_request_for_continuous_pings() {
        let bench = Bench::turning("");
        let scene = bench.scene();
        let mut simulation = Simulation::for_hosts(&scene).unwrap();
        let (ping, mut at) = (bench.source("ping"), START);
        // Message 1400 of the Ping protocol, addressed to all devices. It has a profile's id and a checksum.
        simulation.hear(ping, at, &[0x42, 0x52, 2, 0, 0x78, 0x05, 0, 255, 0x14, 0x05, 0x2B, 0x02]);
        let mut pings = |simulation: &mut Simulation| {
            counts_m(simulation, bench.source("tether"), &mut at);
            simulation.world.get::<Samples<Sounding>>(simulation.entities[ping]).unwrap().list.len()
        };
        assert!(pings(&mut simulation) > 1);
        simulation.restart(&scene, ping);
        assert_eq!(pings(&mut simulation), 0);
    }
}
