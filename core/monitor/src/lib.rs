//! The loop: sources, merge, stages, and what plugins add to them.

#![cfg_attr(not(test), warn(clippy::cast_possible_truncation))]
#![cfg_attr(test, allow(clippy::cast_possible_truncation))]

pub mod alerts;
pub mod components;
pub mod digest;
pub mod flow;
pub mod head;
pub mod merge;
pub mod outlet;
pub mod plugin;
pub mod report;
pub mod ring;
pub mod run;
mod saving;
pub mod smoothing;
pub mod stage;
mod stages;
pub mod trail;
pub mod what_if;
pub mod words;

use bevy_ecs::component::Mutable;
use bevy_ecs::prelude::Resource;
use bevy_ecs::schedule::{IntoScheduleConfigs, Schedule};
use bevy_ecs::system::ScheduleSystem;
use bevy_ecs::world::World;

use components::{Mounted, SonarHead};
use flow::Digests;
use headrace_fusion::Navigation;
use headrace_sensor::device::{Decoder, Device, SensorInfo, SensorSpec};
use headrace_sensor::reading::{MAX_SOURCES, SourceId};
use headrace_snapshot::Stateful;
use headrace_vehicle::Mission;
use plugin::{Plugin, PluginError};
use ring::{Port, PortReader};
use run::Loop;
use saving::Parts;
use stage::Stage;

/// A source of bytes, as a plugin registers it.
pub struct SourceSpec {
    /// Name, also of its channel in the log.
    pub id: String,
    /// Kind of device.
    pub plugin: String,
    /// Where it is connected, as written in the vehicle file.
    pub connect: String,
    /// Bytes to readings.
    pub decoder: Box<dyn Decoder>,
    /// Bytes that the ring before the loop holds.
    pub ring_bytes: usize,
}

/// A source without its decoder: what reports and logs say of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SourceInfo {
    /// Name.
    pub id: String,
    /// Kind of device.
    pub plugin: String,
    /// Where it is connected.
    pub connect: String,
}

/// The loop while it is put together. [`App::arm`] turns it into one that runs.
pub struct App {
    mission: Mission,
    world: World,
    schedule: Schedule,
    sources: Vec<SourceInfo>,
    decoders: Vec<Box<dyn Decoder>>,
    ports: Vec<Port>,
    readers: Vec<PortReader>,
}

impl App {
    /// A loop without sources.
    pub fn new(mission: Mission) -> Self {
        let mut schedule = stage::schedule();
        stages::add(&mut schedule);
        let mut world = World::new();
        world.insert_resource(Parts::of_the_loop());
        Self {
            mission,
            world,
            schedule,
            sources: Vec::new(),
            decoders: Vec::new(),
            ports: Vec::new(),
            readers: Vec::new(),
        }
    }

    /// Adds a plugin.
    ///
    /// Errors: what the plugin needs isn't there, or is there twice.
    pub fn add_plugin(&mut self, plugin: &(impl Plugin + ?Sized)) -> Result<&mut Self, PluginError> {
        plugin.build(self)?;
        Ok(self)
    }

    /// Registers a source; its port fills the ring that the loop reads.
    ///
    /// Errors: an id that is there already, or more than [`MAX_SOURCES`].
    pub fn add_source(&mut self, spec: SourceSpec) -> Result<SourceId, PluginError> {
        if self.sources.iter().any(|other| other.id == spec.id) {
            return Err(PluginError::DuplicateSource { id: spec.id });
        }
        let id = u16::try_from(self.sources.len()).ok().filter(|id| usize::from(*id) < MAX_SOURCES);
        let id = id.ok_or_else(|| PluginError::TooManySources { id: spec.id.clone(), max: MAX_SOURCES })?;
        let (port, reader) = ring::ring(spec.ring_bytes);
        self.sources.push(SourceInfo { id: spec.id, plugin: spec.plugin, connect: spec.connect });
        self.decoders.push(spec.decoder);
        self.ports.push(port);
        self.readers.push(reader);
        Ok(SourceId(id))
    }

    /// Adds a sensor: its source, and an entity with its mount and what it is.
    ///
    /// Errors: as for [`App::add_source`].
    pub fn add_device(&mut self, device: &dyn Device) -> Result<SourceId, PluginError> {
        let SensorSpec { sensor, kind, decoder, ring_bytes } = device.specification();
        let source = self.add_source(SourceSpec {
            id: sensor.id,
            plugin: sensor.plugin,
            connect: sensor.connect,
            decoder,
            ring_bytes,
        })?;
        let mut entity = self.world.spawn(Mounted { source, info: SensorInfo { mount: sensor.mount, kind } });
        if let Some(spec) = device.head() {
            let modes = device.modes(None).unwrap_or_default();
            entity.insert(SonarHead { spec, modes });
        }
        Ok(source)
    }

    /// Adds a resource for a plugin's own systems.
    pub fn insert_resource(&mut self, resource: impl Resource) {
        self.world.insert_resource(resource);
    }

    /// Adds a resource of which results depend: snapshots have it as the part of this name.
    pub fn insert_state(
        &mut self,
        name: &'static str,
        resource: impl Resource<Mutability = Mutable> + Stateful,
    ) {
        self.world.resource_mut::<Parts>().add_of(name, &resource);
        self.world.insert_resource(resource);
    }

    /// Keeps the words of all results, tick by tick, for those who record or compare them.
    pub fn keep_results(&mut self) {
        let mut digests = Digests::default();
        digests.keep();
        self.world.insert_resource(digests);
    }

    /// Adds systems to a stage. Two of one stage that touch the same data must be ordered by whoever adds them.
    pub fn add_systems<M>(&mut self, stage: Stage, systems: impl IntoScheduleConfigs<ScheduleSystem, M>) {
        self.schedule.add_systems(systems.in_set(stage));
    }

    /// The sources so far, in the order of their ids.
    pub fn sources(&self) -> &[SourceInfo] {
        &self.sources
    }

    /// Allocates all that the loop will ever need and makes it ready to run. From here on no tick allocates or locks.
    ///
    /// Errors: more heads than the loop's tables hold, or systems whose order matters but isn't stated.
    pub fn arm(self, navigation: Box<dyn Navigation>) -> Result<Loop, PluginError> {
        Loop::new(self, navigation)
    }
}
