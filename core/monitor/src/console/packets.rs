//! The console's packets in the loop.

use bevy_ecs::prelude::Resource;
use serde::{Deserialize, Serialize};

use super::command::Command;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::MonoNs;
use headrace_sensor::reading::{Packet, SourceId};

/// Maximum number of commands in a tick. The console's ring holds fewer.
const MOST_OF_TICK: usize = 256;

/// Traffic statistics of the console.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct ConsoleCounts {
    /// Number of packets from the console.
    pub packets: u64,
    /// Number of console packets that are not a valid command.
    pub invalid: u64,
    /// Number of commands without effect: the alert doesn't exist, or needs no acknowledgement.
    pub without_effect: u64,
}

/// The console as a packet source.
#[derive(Debug, Resource)]
pub(crate) struct Console {
    pub(crate) source: SourceId,
    pub(crate) counts: ConsoleCounts,
}

stateful!(Console { state: counts; fixed: source; });

/// A command and its place among the tick's events.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ReceivedCommand {
    /// Index of the first event of this tick that comes after the command.
    pub(crate) before: usize,
    /// Index of the first packet without a reading that comes after the command.
    pub(crate) before_unread: usize,
    pub(crate) at: MonoNs,
    pub(crate) command: Command,
}

/// Commands of this tick, in order.
#[derive(Debug, Resource)]
pub(crate) struct Commands(pub(crate) Vec<ReceivedCommand>);

impl Default for Commands {
    /// Creates an empty list of commands. Allocates: at startup, all memory of the list.
    fn default() -> Self {
        Self(Vec::with_capacity(MOST_OF_TICK))
    }
}

impl Console {
    pub(crate) fn new(source: SourceId) -> Self {
        Self { source, counts: ConsoleCounts::default() }
    }

    /// Adds a console packet that comes before the event, and the packet without a reading, with these
    /// indexes.
    pub(crate) fn take(
        &mut self,
        packet: Packet<'_>,
        [before, before_unread]: [usize; 2],
        commands: &mut Commands,
    ) {
        self.counts.packets += 1;
        match Command::parse(packet.bytes) {
            Ok(command) if commands.0.len() < commands.0.capacity() => {
                commands.0.push(ReceivedCommand { before, before_unread, at: packet.received, command });
            }
            _ => self.counts.invalid += 1,
        }
    }
}
