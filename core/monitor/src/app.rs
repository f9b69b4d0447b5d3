//! Builder of the loop: sources, sensors and plugins.

use bevy_ecs::entity::Entity;

use super::entities::{HeadSpecification, Mounted, SensorDecoder, SensorHealth};
use super::error::PluginError;
use super::outlet::Outlet;
use super::part::Part;
use super::ring::{self, Port, PortReader};
use super::source::{SourceInfo, SourceSpec};
use super::stage::{AdviseStage, PlaceStage, SurveyStage};
use headrace_sensor::device::{Device, SensorInfo, SensorSpec};
use headrace_sensor::reading::{MAX_SOURCES, SourceId};
use headrace_vehicle::{CONSOLE_ID, Mission};

/// A plugin, which adds something to the loop, such as an outlet or a system.
pub trait Plugin {
    /// Registers sources and outlets, and resources and systems of the loop's worlds.
    ///
    /// Errors: a requirement of the plugin is missing or duplicated.
    fn build(&self, app: &mut App) -> Result<(), PluginError>;
}

/// Builder of the loop. [`App::arm`] makes it ready to run.
pub struct App {
    pub(super) mission: Mission,
    /// World that converts packets to georeferenced pings.
    pub placer: Part<PlaceStage>,
    /// World that converts georeferenced pings to verdicts on tunnel sections.
    pub surveyor: Part<SurveyStage>,
    /// World that computes the speed advice.
    pub adviser: Part<AdviseStage>,
    pub(super) outlets: Vec<Box<dyn Outlet>>,
    pub(super) keeps_results: bool,
    pub(super) sources: Vec<SourceInfo>,
    /// Entity of each source in the placer's world.
    pub(super) entities: Vec<Entity>,
    pub(super) ports: Vec<Port>,
    pub(super) readers: Vec<PortReader>,
}

impl App {
    /// Creates a loop without sources.
    pub fn new(mission: Mission) -> Self {
        Self {
            mission,
            placer: Part::new(),
            surveyor: Part::new(),
            adviser: Part::new(),
            outlets: Vec::new(),
            keeps_results: false,
            sources: Vec::new(),
            entities: Vec::new(),
            ports: Vec::new(),
            readers: Vec::new(),
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
        let entity = self.placer.world.spawn((
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
        let mut entity = self.placer.world.entity_mut(*entity);
        entity.insert(Mounted { source, info: SensorInfo { mount: sensor.mount, kind } });
        if let Some(spec) = device.head() {
            entity.insert(HeadSpecification::of(device, spec, &self.mission));
        }
        Ok(source)
    }

    /// Adds an outlet, which gets the results of every tick.
    pub fn add_outlet(&mut self, outlet: impl Outlet + 'static) {
        self.outlets.push(Box::new(outlet));
    }

    /// Makes the result streams keep the contents of every tick, for recording or comparison.
    pub fn keep_results(&mut self) {
        self.keeps_results = true;
    }

    /// Sources so far, in the order of their ids.
    pub fn sources(&self) -> &[SourceInfo] {
        &self.sources
    }
}
