//! The loop: sources, merge, stages, and what plugins add to them.

pub mod components;
pub mod device;
pub mod plugin;
pub mod reading;
pub mod ring;

use bevy_ecs::bundle::Bundle;
use bevy_ecs::world::World;

use device::Decoder;
use plugin::PluginError;
use reading::SourceId;
use ring::{Port, PortReader};

/// The most sources that one loop takes.
pub const MAX_SOURCES: usize = 64;

/// A source of bytes, as a plugin registers it.
pub struct SourceSpec {
    /// Name, also of its channel in the log.
    pub id: String,
    /// Kind of device.
    pub plugin: &'static str,
    /// Where it is connected, as written in the vehicle file.
    pub connect: String,
    /// Bytes to readings.
    pub decoder: Box<dyn Decoder>,
    /// Bytes that the ring before the loop holds.
    pub ring_bytes: usize,
}

/// The loop while it is put together. `arm` turns it into one that runs.
#[derive(Default)]
pub struct App {
    world: World,
    sources: Vec<SourceSpec>,
    ports: Vec<Port>,
    readers: Vec<PortReader>,
}

impl App {
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
        self.sources.push(spec);
        self.ports.push(port);
        self.readers.push(reader);
        Ok(SourceId(id))
    }

    /// Adds an entity: a sensor with its components.
    pub fn spawn(&mut self, bundle: impl Bundle) {
        self.world.spawn(bundle);
    }
}
