//! The recorder as an outlet of the loop.

use headrace_core::app::App;
use headrace_core::app::flow::TickTime;
use headrace_core::app::merge::{Inbox, MAX_TICK_BYTES, MAX_TICK_PACKETS};
use headrace_core::app::plugin::{Plugin, PluginError};
use headrace_core::app::stage::Stage;

use bevy_ecs::prelude::{Res, ResMut, Resource};
use std::cell::Cell;

use crate::log::RecorderPort;

/// What the recorder's queue must have free for the largest tick: packets, their headers, and their order.
const LARGEST_TICK_BYTES: usize = MAX_TICK_BYTES + MAX_TICK_PACKETS * 64 + 4096;

/// Size of the recorder's queue, bytes.
pub const QUEUE_BYTES: usize = 4 * LARGEST_TICK_BYTES;

/// Records every packet that the loop consumes, in the order of consumption, and every tick.
///
/// When the queue can't take another largest tick the loop takes nothing in until it can: recorded input is never
/// dropped. When the recorder's thread has failed the dive goes on without it; its handle tells.
pub struct RecorderOutlet {
    port: Cell<Option<RecorderPort>>,
}

impl RecorderOutlet {
    /// For the loop's end of a recorder with a queue of [`QUEUE_BYTES`]. The outlet can be added to one loop.
    pub fn new(port: RecorderPort) -> Self {
        Self { port: Cell::new(Some(port)) }
    }
}

#[derive(Resource)]
struct Recording {
    port: RecorderPort,
    order: Vec<u16>,
}

impl Plugin for RecorderOutlet {
    fn build(&self, app: &mut App) -> Result<(), PluginError> {
        if let Some(port) = self.port.take() {
            app.insert_resource(Recording { port, order: Vec::with_capacity(MAX_TICK_PACKETS) });
            app.add_systems(Stage::Publish, record);
        }
        Ok(())
    }
}

#[expect(clippy::needless_pass_by_value, reason = "bevy hands systems their arguments by value")]
fn record(mut inbox: ResMut<'_, Inbox>, time: Res<'_, TickTime>, mut recording: ResMut<'_, Recording>) {
    let Recording { port, order } = &mut *recording;
    if port.failed() {
        inbox.allowance_bytes = MAX_TICK_BYTES;
        return;
    }
    order.clear();
    for (source, packet) in inbox.iter() {
        // The allowance has left room for all of this.
        if port.raw(source.0, packet.received, packet.received, packet.bytes).is_ok() {
            order.push(source.0);
        }
    }
    if !order.is_empty() && port.tick(time.index, time.now, order).is_err() {
        order.clear();
    }
    inbox.allowance_bytes = if port.vacant_bytes() >= LARGEST_TICK_BYTES { MAX_TICK_BYTES } else { 0 };
}
