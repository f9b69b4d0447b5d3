//! The queue between the loop and the recorder's thread: its entries, and the state shared by both ends.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crossbeam::queue::ArrayQueue;
use headrace_geometry::time::MonoNs;
use ringbuf::HeapRb;
use ringbuf::traits::{Consumer as _, Observer as _};
use ringbuf::wrap::Cons;

use super::fault::RecordingEvent;
use super::fields::Fields;
use super::writer::Lane;

/// Header of each entry in the queue: kind, a spare byte, number, length, log time, publish time.
pub(super) const ENTRY_HEAD_BYTES: usize = 24;

/// State shared by the ends of a recorder, apart from the queue.
pub(super) struct State {
    pub(super) stopping: AtomicBool,
    /// Whether nothing empties the queue any more.
    pub(super) closed: AtomicBool,
    /// Whether nothing is being recorded at present.
    pub(super) failing: AtomicBool,
    /// Ticks that this recorder was too far behind to take.
    pub(super) gaps: ArrayQueue<Gap>,
    /// Steps taken, by which a recorder that is stuck is told from one that is slow.
    pub(super) steps: AtomicU64,
    /// News for those who watch the dive; the oldest are dropped.
    pub(super) events: ArrayQueue<RecordingEvent>,
    /// Bytes that the port threads sent to the devices, which don't pass through the loop.
    pub(super) sent: ArrayQueue<SentMessage>,
    pub(super) sent_dropped: AtomicU64,
    pub(super) results_missing: AtomicU64,
}

/// Ticks skipped by a recorder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Gap {
    /// Times of the first and last of them.
    pub(super) span: (MonoNs, MonoNs),
    /// Packets of these ticks.
    pub(super) packets: u64,
}

/// Bytes sent to a device.
pub(super) struct SentMessage {
    pub(super) source: u16,
    pub(super) at: MonoNs,
    pub(super) bytes: Vec<u8>,
}

/// Logs bytes sent to devices, from any thread. When the queue is full the oldest message is dropped and counted.
#[derive(Clone)]
pub struct SentPort {
    pub(super) state: Arc<State>,
}

impl SentPort {
    /// Logs bytes sent to `source`. Never blocks.
    pub fn sent(&self, source: u16, at: MonoNs, bytes: &[u8]) {
        let message = SentMessage { source, at, bytes: bytes.to_vec() };
        if self.state.sent.force_push(message).is_some() {
            self.state.sent_dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Number of messages dropped.
    pub fn dropped(&self) -> u64 {
        self.state.sent_dropped.load(Ordering::Relaxed)
    }
}

/// Header of a message of `len` bytes in the queue.
pub(super) fn entry_head(
    lane: Lane,
    log_time: MonoNs,
    publish_time: MonoNs,
    len: u32,
) -> [u8; ENTRY_HEAD_BYTES] {
    let (kind, number) = match lane {
        Lane::Raw(source) => (0_u8, source),
        Lane::Sent(source) => (1, source),
        Lane::Tick => (2, 0),
        Lane::Result(channel) => (3, channel),
    };
    let mut head = [0; ENTRY_HEAD_BYTES];
    let values = [kind, 0].into_iter().chain(number.to_le_bytes()).chain(len.to_le_bytes());
    let values = values.chain(log_time.0.to_le_bytes()).chain(publish_time.0.to_le_bytes());
    head.iter_mut().zip(values).for_each(|(byte, value)| *byte = value);
    head
}

/// The thread's end of the queue.
pub(super) struct Queue {
    pub(super) ring: Cons<Arc<HeapRb<u8>>>,
    pub(super) state: Arc<State>,
    /// The message of the entry taken last.
    pub(super) message: Vec<u8>,
}

/// However the recorder ends, the loop doesn't wait for it.
impl Drop for Queue {
    fn drop(&mut self) {
        self.state.closed.store(true, Ordering::Release);
    }
}

/// An entry without its message.
pub(super) struct Entry {
    pub(super) lane: Lane,
    pub(super) log_time: MonoNs,
    pub(super) publish_time: MonoNs,
}

impl Queue {
    /// The next entry, if all of it is there; its message is then in `message`.
    pub(super) fn take(&mut self) -> Option<Entry> {
        let mut head = [0; ENTRY_HEAD_BYTES];
        if self.ring.peek_slice(&mut head) < ENTRY_HEAD_BYTES {
            return None;
        }
        let mut fields = Fields::new(&head);
        let (kind, _, number) = (fields.u8()?, fields.u8()?, fields.u16()?);
        let len = usize::try_from(fields.u32()?).ok()?;
        if self.ring.occupied_len() < ENTRY_HEAD_BYTES + len {
            return None;
        }
        let lane = match kind {
            0 => Lane::Raw(number),
            1 => Lane::Sent(number),
            2 => Lane::Tick,
            _ => Lane::Result(number),
        };
        self.ring.skip(ENTRY_HEAD_BYTES);
        self.message.resize(len, 0);
        self.ring.pop_slice(&mut self.message);
        Some(Entry { lane, log_time: MonoNs(fields.u64()?), publish_time: MonoNs(fields.u64()?) })
    }
}
