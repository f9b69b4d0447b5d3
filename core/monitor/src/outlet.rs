//! Outlet for results: a bounded queue that another thread drains.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use bevy_ecs::prelude::{Res, Resource};
use crossbeam::queue::ArrayQueue;

use super::app::{App, Plugin};
use super::error::PluginError;
use super::messages::{Notice, Notices};
use super::stage::Stage;

/// Copies every notice into a queue. If the queue is full, the oldest notice is dropped and counted.
pub struct NoticeOutlet {
    queue: Arc<Shared>,
}

/// Receiving end of a [`NoticeOutlet`]'s queue.
#[derive(Clone)]
pub struct NoticeReceiver {
    queue: Arc<Shared>,
}

struct Shared {
    notices: ArrayQueue<Notice>,
    dropped: AtomicU64,
}

#[derive(Resource)]
struct Outlet(Arc<Shared>);

impl NoticeOutlet {
    /// Creates a queue for `capacity` notices, with its receiving end.
    pub fn new(capacity: usize) -> (Self, NoticeReceiver) {
        let queue =
            Arc::new(Shared { notices: ArrayQueue::new(capacity.max(1)), dropped: AtomicU64::new(0) });
        (Self { queue: Arc::clone(&queue) }, NoticeReceiver { queue })
    }
}

impl Plugin for NoticeOutlet {
    fn build(&self, app: &mut App) -> Result<(), PluginError> {
        app.insert_resource(Outlet(Arc::clone(&self.queue)));
        app.add_systems(Stage::Publish, publish);
        Ok(())
    }
}

#[expect(clippy::needless_pass_by_value, reason = "bevy hands systems their arguments by value")]
fn publish(notices: Res<'_, Notices>, outlet: Res<'_, Outlet>) {
    for notice in &notices.0 {
        if outlet.0.notices.force_push(*notice).is_some() {
            outlet.0.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }
}

impl NoticeReceiver {
    /// Takes the oldest waiting notice.
    pub fn next(&self) -> Option<Notice> {
        self.queue.notices.pop()
    }

    /// Number of notices dropped because the queue was full.
    pub fn dropped(&self) -> u64 {
        self.queue.dropped.load(Ordering::Relaxed)
    }
}
