//! The queue from the loop to the recorder's thread: its entries, and the state that both ends share.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crossbeam::queue::ArrayQueue;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::byte_ring::{ByteConsumer, ByteProducer};
use ringbuf::HeapRb;
use ringbuf::wrap::{Cons, Prod};

use super::fault::RecordingEvent;
use super::fields::Fields;
use super::writer::Lane;

/// An entry doesn't fit in the queue. No part of the entry was written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the recorder's queue has room for {free} bytes and an entry needs {needed}")]
pub struct Full {
    /// Number of free bytes in the queue.
    pub free: usize,
    /// Number of bytes that the entry needs.
    pub needed: usize,
}

/// Length of an entry's header: kind, a spare byte, number, length, log time, publish time.
pub(super) const ENTRY_HEAD_BYTES: usize = 24;

/// State that both ends of a recorder share, apart from the queue.
pub(super) struct State {
    pub(super) stopping: AtomicBool,
    /// Whether the recording ends without an end mark. A later dive can then continue the recording.
    pub(super) abandoned: AtomicBool,
    /// Whether the recorder has ended, so that the queue is no longer emptied.
    pub(super) closed: AtomicBool,
    /// Whether an error keeps the recorder from recording at present.
    pub(super) failing: AtomicBool,
    /// Ticks that the loop skipped because the recorder was too far behind.
    pub(super) gaps: ArrayQueue<Gap>,
    /// `handed_ns` is the log time of the latest tick that the loop recorded or skipped, ns. `certain_ns` is the log
    /// time up to which all data is either synced to disk or lost, ns. Both are 0 before the first tick.
    pub(super) handed_ns: AtomicU64,
    pub(super) certain_ns: AtomicU64,
    /// Number of the recorder's steps so far, which distinguishes a stuck recorder from a slow one.
    pub(super) steps: AtomicU64,
    /// Events for people who watch the dive. The oldest are dropped if the queue is full.
    pub(super) events: ArrayQueue<RecordingEvent>,
    /// Bytes that port threads sent to devices. These bytes don't pass through the loop.
    pub(super) sent: ArrayQueue<SentMessage>,
    pub(super) sent_dropped: AtomicU64,
    /// Packets that the connections to devices dropped before the loop could receive them.
    pub(super) dropped: ArrayQueue<Dropped>,
    /// Number of dropped packets that aren't in `dropped`, because that queue was full.
    pub(super) dropped_besides: AtomicU64,
    /// Recordings of voice notes. Recordings don't pass through the loop.
    pub(super) voices: ArrayQueue<Vec<u8>>,
    /// Whether the recorder has stopped accepting voice recordings. Set before the recorder looks into `voices` for the
    /// last time.
    pub(super) voices_end: AtomicBool,
    pub(super) results_missing: AtomicU64,
}

impl State {
    /// Stores the time of a tick that the loop has recorded or skipped.
    pub(super) fn hand(&self, now: MonoNs) {
        // Dive time that isn't synced to disk yet is counted from the first tick. Data that was queued before that tick
        // isn't counted.
        if self.handed_ns.swap(now.0, Ordering::Relaxed) == 0 {
            self.certain_ns.fetch_max(now.0, Ordering::Relaxed);
        }
    }

    /// Returns the length of the dive, up to its latest tick, whose data may not be on the disk yet.
    pub(super) fn unsafe_for(&self) -> DurNs {
        let certain = MonoNs(self.certain_ns.load(Ordering::Relaxed));
        DurNs(MonoNs(self.handed_ns.load(Ordering::Relaxed)).since(certain).0.max(0))
    }
}

/// Successive ticks that a recorder skipped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Gap {
    /// Times of the first and last skipped tick.
    pub(super) span: (MonoNs, MonoNs),
    /// Number of packets in the skipped ticks.
    pub(super) packets: u64,
}

/// A message with bytes sent to a device.
pub(super) struct SentMessage {
    pub(super) source: u16,
    pub(super) at: MonoNs,
    pub(super) bytes: Vec<u8>,
}

/// Packets of a source that were dropped before the loop could receive them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Dropped {
    pub(super) source: u16,
    /// Times between which the source's packets were dropped.
    pub(super) span: (MonoNs, MonoNs),
    pub(super) packets: u64,
}

/// Records bytes sent to devices, and losses of packets. Neither passes through the loop. Any thread may use a
/// `LinePort`.
#[derive(Clone)]
pub struct LinePort {
    pub(super) state: Arc<State>,
}

impl LinePort {
    /// Records bytes sent to `source`, without blocking. If the queue is full, the oldest message is dropped and
    /// counted.
    pub fn sent(&self, source: u16, at: MonoNs, bytes: &[u8]) {
        let message = SentMessage { source, at, bytes: bytes.to_vec() };
        if self.state.sent.force_push(message).is_some() {
            self.state.sent_dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Records that packets of `source` were dropped between two times, without blocking.
    pub fn lost(&self, source: u16, from: MonoNs, to: MonoNs, packets: u64) {
        if let Some(oldest) = self.state.dropped.force_push(Dropped { source, span: (from, to), packets }) {
            self.state.dropped_besides.fetch_add(oldest.packets, Ordering::Relaxed);
        }
    }

    /// Returns the number of sent messages that were dropped.
    pub fn sent_dropped(&self) -> u64 {
        self.state.sent_dropped.load(Ordering::Relaxed)
    }
}

/// Encodes the header of an entry whose message has `len` bytes.
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
        Lane::Voice => (4, 0),
    };
    let mut head = [0; ENTRY_HEAD_BYTES];
    let values = [kind, 0].into_iter().chain(number.to_le_bytes()).chain(len.to_le_bytes());
    let values = values.chain(log_time.0.to_le_bytes()).chain(publish_time.0.to_le_bytes());
    head.iter_mut().zip(values).for_each(|(byte, value)| *byte = value);
    head
}

/// The end of the queue at which the loop adds entries.
pub(super) struct Entries<R: ByteProducer = Prod<Arc<HeapRb<u8>>>> {
    pub(super) ring: R,
}

impl<R: ByteProducer> Entries<R> {
    /// Reserves room for an entry with a message of `len` bytes, and writes its header.
    ///
    /// The message must follow. The recorder's thread takes an entry only once it is complete.
    pub(super) fn begin(
        &mut self,
        lane: Lane,
        log_time: MonoNs,
        publish_time: MonoNs,
        len: usize,
    ) -> Result<(), Full> {
        let (free, needed) = (self.ring.vacant(), ENTRY_HEAD_BYTES.saturating_add(len));
        let len = u32::try_from(len).ok().filter(|_| needed <= free).ok_or(Full { free, needed })?;
        self.ring.push(&entry_head(lane, log_time, publish_time, len));
        Ok(())
    }

    /// Appends the message of an entry, or a part of it.
    pub(super) fn put(&mut self, bytes: &[u8]) {
        self.ring.push(bytes);
    }
}

/// Calls `work` until `is_stopping` returns true and no work is left.
///
/// `work` returns the amount of work that it found, and `idle` waits briefly. `is_stopping` is called before each call
/// of `work`, so all entries that were pushed before the stop are processed.
pub(super) fn until_stopped(
    is_stopping: impl Fn() -> bool,
    mut work: impl FnMut() -> usize,
    mut idle: impl FnMut(),
) {
    loop {
        let stopping = is_stopping();
        match work() {
            0 if stopping => return,
            0 => idle(),
            _ => (),
        }
    }
}

/// The end of the queue at which the recorder's thread takes entries.
pub(super) struct Queue<R: ByteConsumer = Cons<Arc<HeapRb<u8>>>> {
    pub(super) ring: R,
    /// Message of the queue entry that was taken most recently.
    pub(super) message: Vec<u8>,
}

/// Marks the recorder as closed when it is dropped, so that the loop never waits for a recorder that has ended.
pub(super) struct ClosedWhenDropped(pub(super) Arc<State>);

impl Drop for ClosedWhenDropped {
    fn drop(&mut self) {
        self.0.closed.store(true, Ordering::Release);
    }
}

/// Header of a queue entry, without the entry's message.
pub(super) struct Entry {
    pub(super) lane: Lane,
    pub(super) log_time: MonoNs,
    pub(super) publish_time: MonoNs,
}

impl<R: ByteConsumer> Queue<R> {
    /// Takes the next entry if it is complete, and stores its message in the field `message`.
    pub(super) fn take(&mut self) -> Option<Entry> {
        let mut head = [0; ENTRY_HEAD_BYTES];
        if self.ring.peek(&mut head) < ENTRY_HEAD_BYTES {
            return None;
        }
        let mut fields = Fields::new(&head);
        let (kind, _, number) = (fields.u8()?, fields.u8()?, fields.u16()?);
        let len = usize::try_from(fields.u32()?).ok()?;
        if self.ring.occupied() < ENTRY_HEAD_BYTES + len {
            return None;
        }
        let lane = match kind {
            0 => Lane::Raw(number),
            1 => Lane::Sent(number),
            2 => Lane::Tick,
            4 => Lane::Voice,
            _ => Lane::Result(number),
        };
        self.ring.skip(ENTRY_HEAD_BYTES);
        self.message.resize(len, 0);
        self.ring.pop(&mut self.message);
        Some(Entry { lane, log_time: MonoNs(fields.u64()?), publish_time: MonoNs(fields.u64()?) })
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::Ordering::{Acquire, Release};

    use headrace_monitor::byte_ring::model::{Hasty, ModelConsumer, explore, ring};
    use loom::sync::Arc;
    use loom::sync::atomic::AtomicBool;

    use super::*;

    const TIMES: MonoNs = MonoNs(7);

    fn message(number: u8) -> Vec<u8> {
        vec![number + 1; [5, 0][usize::from(number)]]
    }

    fn push(entries: &mut Entries<headrace_monitor::byte_ring::model::ModelProducer>, number: u8) {
        let lane = Lane::Raw(number.into());
        entries.begin(lane, TIMES, TIMES, message(number).len()).unwrap();
        entries.put(&message(number));
    }

    /// Explores all interleavings of a loop and a recorder.
    ///
    /// The loop pushes two entries and sets the stop flag. The recorder takes entries until the function `until`
    /// returns.
    fn explored<R: ByteConsumer + 'static>(
        name: &str,
        reading: fn(ModelConsumer) -> R,
        until: fn(&dyn Fn() -> bool, &mut dyn FnMut() -> usize),
    ) -> usize {
        explore(name, Some(3), move || {
            let (producer, consumer) = ring(64);
            let stopping = Arc::new(AtomicBool::new(false));
            let flag = Arc::clone(&stopping);
            let recorder = loom::thread::spawn(move || {
                let mut queue = Queue { ring: reading(consumer), message: Vec::new() };
                let mut taken = Vec::new();
                let mut work = || {
                    let entry = queue.take();
                    taken.extend(
                        entry.iter().map(|entry| (entry.lane, entry.log_time, queue.message.clone())),
                    );
                    usize::from(entry.is_some())
                };
                until(&|| flag.load(Acquire), &mut work);
                taken
            });
            let mut entries = Entries { ring: producer };
            push(&mut entries, 0);
            push(&mut entries, 1);
            stopping.store(true, Release);
            let taken = recorder.join().unwrap();
            let pushed = |number: u8| (Lane::Raw(number.into()), TIMES, message(number));
            assert_eq!(taken, [pushed(0), pushed(1)]);
        })
    }

    fn as_it_is(is_stopping: &dyn Fn() -> bool, work: &mut dyn FnMut() -> usize) {
        until_stopped(is_stopping, work, loom::thread::yield_now);
    }

    /// Entries arrive whole and in order, and none remains in the queue, in every interleaving of loop and recorder.
    #[test]
    fn recorder_takes_every_entry_completely_before_it_stops() {
        let name = "header then body in the recorder's queue, and its stop";
        let executions = explored(name, |consumer| consumer, as_it_is);
        assert!(executions > 50, "{executions}");
    }

    #[test]
    #[should_panic = "assertion `left == right` failed"]
    fn interleaving_model_detects_a_recorder_that_takes_incomplete_entries() {
        explored("the recorder's queue, a message not waited for", Hasty, as_it_is);
    }

    #[test]
    #[should_panic = "assertion `left == right` failed"]
    fn interleaving_model_detects_a_recorder_that_reads_the_stop_flag_last() {
        explored(
            "the recorder's stop, the flag read last",
            |consumer| consumer,
            |is_stopping, work| {
                while work() > 0 || !is_stopping() {
                    loom::thread::yield_now();
                }
            },
        );
    }
}
