//! Builder of the loop: sources, sensors and plugins.

use bevy_ecs::component::Mutable;
use bevy_ecs::entity::Entity;
use bevy_ecs::prelude::Resource;
use bevy_ecs::schedule::{IntoScheduleConfigs, Schedule};
use bevy_ecs::system::ScheduleSystem;
use bevy_ecs::world::World;

use super::entities::{HeadSpecification, Mounted, SensorDecoder, SensorHealth};
use super::error::PluginError;
use super::loop_snapshot::StateParts;
use super::resources::Digests;
use super::ring::{self, Port, PortReader};
use super::stage::{self, Stage};
use super::stages;
use headrace_geometry::snapshot::Stateful;
use headrace_sensor::device::{Decoder, Device, SensorInfo, SensorSpec};
use headrace_sensor::reading::{MAX_SOURCES, SourceId};
use headrace_vehicle::{CONSOLE_ID, Mission};

/// A source of bytes, as a plugin registers it.
pub struct SourceSpec {
    /// Name of the source, and of its channel in the log.
    pub id: String,
    /// Kind of device.
    pub plugin: String,
    /// Connection as written in the vehicle file.
    pub connect: String,
    /// Decoder from bytes to readings.
    pub decoder: Box<dyn Decoder>,
    /// Capacity of the source's ring, bytes.
    pub ring_bytes: usize,
}

/// A source without its decoder, as listed in reports and logs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SourceInfo {
    /// Name.
    pub id: String,
    /// Kind of device.
    pub plugin: String,
    /// Connection.
    pub connect: String,
}

/// An addition to the loop, such as an outlet or a stage.
pub trait Plugin {
    /// Registers sources, components, systems in a named stage, and outlets.
    ///
    /// Errors: a requirement of the plugin is missing or duplicated.
    fn build(&self, app: &mut App) -> Result<(), PluginError>;
}

/// Builder of the loop. [`App::arm`] makes it ready to run.
pub struct App {
    pub(super) mission: Mission,
    pub(super) world: World,
    pub(super) schedule: Schedule,
    pub(super) sources: Vec<SourceInfo>,
    /// Entity of each source.
    pub(super) entities: Vec<Entity>,
    pub(super) ports: Vec<Port>,
    pub(super) readers: Vec<PortReader>,
    /// Whether a plugin has systems in the stages that georeference pings.
    pub(super) has_own_placing: bool,
}

impl App {
    /// Creates a loop without sources.
    pub fn new(mission: Mission) -> Self {
        let mut schedule = stage::schedule();
        stages::add(&mut schedule);
        let mut world = World::new();
        world.insert_resource(StateParts::of_the_loop());
        Self {
            mission,
            world,
            schedule,
            sources: Vec::new(),
            entities: Vec::new(),
            ports: Vec::new(),
            readers: Vec::new(),
            has_own_placing: false,
        }
    }

    /// Adds a plugin.
    ///
    /// Errors: a requirement of the plugin is missing or duplicated.
    pub fn add_plugin(&mut self, plugin: &(impl Plugin + ?Sized)) -> Result<&mut Self, PluginError> {
        plugin.build(self)?;
        Ok(self)
    }

    /// Registers a source, and creates the ring that its port fills and the loop reads.
    ///
    /// Errors: the id exists already or is reserved for the console, or there are more than [`MAX_SOURCES`].
    pub fn add_source(&mut self, spec: SourceSpec) -> Result<SourceId, PluginError> {
        if spec.id == CONSOLE_ID {
            return Err(PluginError::ReservedSource { id: spec.id });
        }
        if self.sources.iter().any(|other| other.id == spec.id) {
            return Err(PluginError::DuplicateSource { id: spec.id });
        }
        let id = u16::try_from(self.sources.len()).ok().filter(|id| usize::from(*id) < MAX_SOURCES);
        let id = id.ok_or_else(|| PluginError::TooManySources { id: spec.id.clone(), max: MAX_SOURCES })?;
        let (port, reader) = ring::ring(spec.ring_bytes);
        self.sources.push(SourceInfo { id: spec.id, plugin: spec.plugin, connect: spec.connect });
        self.ports.push(port);
        self.readers.push(reader);
        let source = SourceId(id);
        let entity = self.world.spawn((
            Mounted { source, info: SensorInfo::other() },
            SensorDecoder(spec.decoder),
            SensorHealth::default(),
        ));
        self.entities.push(entity.id());
        Ok(source)
    }

    /// Adds a sensor: its source, and an entity with its mount and kind.
    ///
    /// Errors: see [`App::add_source`].
    pub fn add_device(&mut self, device: &dyn Device) -> Result<SourceId, PluginError> {
        let SensorSpec { sensor, kind, decoder, ring_bytes } = device.specification();
        let source = self.add_source(SourceSpec {
            id: sensor.id,
            plugin: sensor.plugin,
            connect: sensor.connect,
            decoder,
            ring_bytes,
        })?;
        let Some(entity) = self.entities.get(source.index()) else { return Ok(source) };
        let mut entity = self.world.entity_mut(*entity);
        entity.insert(Mounted { source, info: SensorInfo { mount: sensor.mount, kind } });
        if let Some(spec) = device.head() {
            entity.insert(HeadSpecification::of(device, spec, &self.mission));
        }
        Ok(source)
    }

    /// Adds a resource for a plugin's own systems.
    pub fn insert_resource(&mut self, resource: impl Resource) {
        self.world.insert_resource(resource);
    }

    /// Adds a resource that affects results. Snapshots store it as a part with this name.
    pub fn insert_state(
        &mut self,
        name: &'static str,
        resource: impl Resource<Mutability = Mutable> + Stateful,
    ) {
        self.world.resource_mut::<StateParts>().add_of(name, &resource);
        self.world.insert_resource(resource);
    }

    /// Keeps the contents of the result streams of every tick, for recording or comparison.
    pub fn keep_results(&mut self) {
        let mut digests = Digests::default();
        digests.keep();
        self.world.insert_resource(digests);
    }

    /// Adds systems to a stage. The caller must order systems of one stage that share data.
    pub fn add_systems<M>(&mut self, stage: Stage, systems: impl IntoScheduleConfigs<ScheduleSystem, M>) {
        self.has_own_placing |= stage.is_placing();
        self.schedule.add_systems(systems.in_set(stage));
    }

    /// Adds systems between a stage and the next, such as measurements of the finished stage.
    pub fn add_systems_after<M>(
        &mut self,
        stage: Stage,
        systems: impl IntoScheduleConfigs<ScheduleSystem, M>,
    ) {
        self.has_own_placing |= stage.is_placing();
        match stage.next() {
            Some(next) => self.schedule.add_systems(systems.after(stage).before(next)),
            None => self.schedule.add_systems(systems.after(stage)),
        };
    }

    /// Sources so far, in the order of their ids.
    pub fn sources(&self) -> &[SourceInfo] {
        &self.sources
    }
}
