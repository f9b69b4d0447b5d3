//! Provides a simulated dive as a source of packets for the loop.

use headrace_geometry::time::MonoNs;
use headrace_monitor::ring::{Port, RingError};
use headrace_sensor::device::Direction;
use headrace_sensor::reading::SourceId;
use headrace_simulator::{START, Simulation};

use crate::drive::{Coming, PacketSource};
use crate::log::LogError;

/// A simulated dive as a source of packets. Bytes sent to devices are left out.
pub struct SimulationFeed {
    /// The simulation that supplies the packets, at the position that playback has reached.
    pub simulation: Simulation,
}

impl SimulationFeed {
    /// Creates a feed that starts at the first message of the dive.
    pub fn new(simulation: Simulation) -> Self {
        Self { simulation }
    }
}

impl PacketSource for SimulationFeed {
    fn coming(&mut self) -> Result<Option<Coming>, LogError> {
        while let Some(message) = self.simulation.peek_message() {
            if message.direction == Direction::Received {
                let (at, source, len) = (message.at, SourceId(message.source), message.bytes.len());
                return Ok(Some(Coming { at, source, len }));
            }
            self.simulation.next_message();
        }
        Ok(None)
    }

    fn span(&self) -> Option<(MonoNs, MonoNs)> {
        Some((START, self.simulation.end()))
    }

    fn send(&mut self, port: &mut Port) -> Result<(), RingError> {
        if let Some(message) = self.simulation.peek_message() {
            port.send(message.at, message.bytes)?;
            self.simulation.next_message();
        }
        Ok(())
    }
}
