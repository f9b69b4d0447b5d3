//! Outlet for notices: a bounded queue that another thread drains.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crossbeam::queue::ArrayQueue;

use super::app::{App, Plugin};
use super::error::PluginError;
use super::merge::MAX_TICK_BYTES;
use super::messages::Notice;
use super::outlet::Outlet;
use super::view::DiveView;

/// Outlet that copies every notice into a queue. If the queue is full, the oldest notice is dropped and
/// counted.
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
        app.add_outlet(NoticeSender(Arc::clone(&self.queue)));
        Ok(())
    }
}

struct NoticeSender(Arc<Shared>);

impl Outlet for NoticeSender {
    fn publish(&mut self, dive: &DiveView<'_>) -> usize {
        for notice in dive.notices() {
            if self.0.notices.force_push(notice).is_some() {
                self.0.dropped.fetch_add(1, Ordering::Relaxed);
            }
        }
        MAX_TICK_BYTES
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
