//! Records a dive: connects a recorder to the loop, as an outlet.

use headrace_monitor::merge::{Inbox, MAX_TICK_BYTES, MAX_TICK_PACKETS};
use headrace_monitor::outlet::Outlet;
use headrace_monitor::resources::TickTime;
use headrace_monitor::result_stream::ResultStream;
use headrace_monitor::run::Loop;
use headrace_monitor::view::DiveView;
use headrace_monitor::{App, Plugin, PluginError};

use std::cell::Cell;

use crate::log::format::{HEAD_WORDS, RESULT_PREFIX, STREAMS};
use crate::log::{RecorderPort, ResultChannel};
use crate::view;

/// Number of free bytes that the largest tick needs in the recorder's queue, for packets, their headers, and the list
/// of their sources.
const LARGEST_TICK_BYTES: usize = MAX_TICK_BYTES + MAX_TICK_PACKETS * 64 + 4096;

/// In a dive that reads ports, a tick may consume at most the free room of the queue divided by this number.
///
/// The limit is that strict because short packets, together with their results, take several times their own length in
/// the queue.
const SMALLER_TICK: usize = 8;
/// Minimum limit for a tick in a dive that reads ports, bytes. The longest packet of a port has some KiB.
const MIN_TICK_BYTES: usize = 8 * 1024;

/// Size of the buffer for one stream's results of a tick, bytes. Results beyond it are not recorded.
const MAX_RESULT_BYTES: usize = 1 << 19;

/// Size of the queue from the loop to a recorder, bytes.
pub const QUEUE_BYTES: usize = 4 * LARGEST_TICK_BYTES;

/// Size of a recorder's queue in a dive that reads ports, bytes.
///
/// It holds some minutes of data of four heads, for times when the medium accepts no data.
pub const QUEUE_OF_PORTS_BYTES: usize = 16 * LARGEST_TICK_BYTES;

/// Name of the stream that has a record per echo.
const ECHOES: &str = "pings";
/// Message encoding of the result streams, see [`crate::log::format`].
const ENCODING: &str = "headrace-trail";
/// Returns the channels for a loop's results: first the streams, then the channels for viewers.
pub fn result_channels() -> Vec<ResultChannel> {
    let channel = |name: &&str| ResultChannel {
        topic: format!("{RESULT_PREFIX}{name}"),
        schema_name: "headrace.trail".to_owned(),
        schema_encoding: String::new(),
        schema: String::new(),
        message_encoding: ENCODING.to_owned(),
        follows_echoes: *name == ECHOES,
    };
    STREAMS.iter().map(channel).chain(view::channels()).collect()
}

/// Returns the results of a loop's latest tick as messages, for a [`crate::log::DerivedChannels`].
///
/// Each message has the number of its channel. The loop must keep its results. This function allocates, so it may be
/// called only by outlets between ticks.
pub fn result_messages(dive: &Loop) -> Vec<(u16, Vec<u8>)> {
    let streams = (0..).zip(dive.view().streams());
    let filled = streams.filter(|(_, (_, trail))| !trail.words().is_empty());
    let message = |(channel, (_, trail)): (u16, (&str, &ResultStream))| {
        let mut message = Vec::with_capacity((trail.words().len() + HEAD_WORDS) * 8);
        fill(&mut message, dive.ticks(), 0, trail.words());
        (channel, message)
    };
    filled.map(message).collect()
}

/// Records every packet that the loop consumes, every tick and every result, with one or several recorders.
///
/// Packets are recorded in the order of consumption. If a recorder's queue has no room for a tick of the largest size,
/// the loop consumes nothing until there is room. Recorded input is therefore never dropped.
///
/// A dive that reads ports doesn't wait, see [`RecorderOutlet::of_ports`]. If all recorders have ended, the dive
/// continues without recording, and the recorders' handles return the errors.
pub struct RecorderOutlet {
    ports: Cell<Vec<RecorderPort>>,
    is_of_ports: bool,
}

impl RecorderOutlet {
    /// Creates the outlet from the ports of recorders, whose queues must have [`QUEUE_BYTES`].
    ///
    /// The outlet can be added to one loop only.
    pub fn new(ports: impl IntoIterator<Item = RecorderPort>) -> Self {
        Self { ports: Cell::new(ports.into_iter().collect()), is_of_ports: false }
    }

    /// Makes the outlet never wait for a recorder. In a dive that reads ports, a blocked medium must not delay advice.
    ///
    /// A recorder whose queue is full skips ticks. It reports the skipping
    /// ([`RecordingEvent::Behind`](crate::log::RecordingEvent)), and states the skipped ticks in its log.
    #[must_use]
    pub fn of_ports(self) -> Self {
        Self { is_of_ports: true, ..self }
    }
}

struct Recording {
    ports: Vec<RecorderPort>,
    is_of_ports: bool,
    order: Vec<u16>,
    /// Buffer for the message with a stream's results.
    message: Vec<u8>,
    /// Number of records that each stream had before this tick.
    records: [u64; STREAMS.len()],
}

impl Plugin for RecorderOutlet {
    fn build(&self, app: &mut App) -> Result<(), PluginError> {
        let ports = self.ports.take();
        if !ports.is_empty() {
            app.keep_results();
            app.add_outlet(Recording {
                ports,
                is_of_ports: self.is_of_ports,
                order: Vec::with_capacity(MAX_TICK_PACKETS),
                message: Vec::with_capacity(MAX_RESULT_BYTES),
                records: [0; STREAMS.len()],
            });
        }
        Ok(())
    }
}

impl Outlet for Recording {
    fn publish(&mut self, dive: &DiveView<'_>) -> usize {
        let Self { ports, is_of_ports, order, message, records } = self;
        let (inbox, time, streams) = (&dive.placed().inbox, dive.time(), dive.streams());
        let packets = inbox.iter().map(|(_, packet)| RecorderPort::entry_bytes(packet.bytes.len()));
        let (count, bytes) = packets.fold((0, 0), |(count, sum), bytes| (count + 1, sum + bytes));
        let needed = bytes + RecorderPort::tick_entry_bytes(count);
        for port in ports.iter_mut().filter(|port| !port.is_closed()) {
            // A recorder that has skipped ticks resumes only when a quarter of its queue is free, even if a small tick
            // fits earlier.
            let needed = if port.is_behind() { needed.max(port.capacity_bytes() / 4) } else { needed };
            if count > 0 && port.vacant_bytes() < needed {
                // Ticks are skipped only in a dive that reads ports. In any other dive, the loop takes only as many
                // packets as there is room for.
                port.skip(time.now, count as u64);
                continue;
            }
            record_tick(port, inbox, &time, order);
            record_results(port, &streams, &time, message, records);
        }
        for ((_, stream), before) in streams.into_iter().zip(records) {
            *before = stream.records();
        }
        let open = ports.iter().filter(|port| !port.is_closed());
        allowance_bytes(open, *is_of_ports)
    }
}

/// Returns how many bytes of packets the next tick may consume.
fn allowance_bytes<'a>(open: impl Iterator<Item = &'a RecorderPort>, is_of_ports: bool) -> usize {
    let rooms = open.filter(|port| !is_of_ports || !port.is_behind()).map(RecorderPort::vacant_bytes);
    let room = if is_of_ports { rooms.max() } else { rooms.min() };
    match room {
        Some(room) if room < LARGEST_TICK_BYTES && is_of_ports => (room / SMALLER_TICK).max(MIN_TICK_BYTES),
        Some(room) if room < LARGEST_TICK_BYTES => 0,
        // If no recorder is open, or all recorders skip ticks, recording doesn't limit the tick.
        Some(_) | None => MAX_TICK_BYTES,
    }
}

/// Records the packets of a tick, in the order of consumption, and the tick itself.
fn record_tick(port: &mut RecorderPort, inbox: &Inbox, time: &TickTime, order: &mut Vec<u16>) {
    order.clear();
    for (source, packet) in inbox.iter() {
        // The caller has checked that all entries of this tick fit.
        if port.raw(source.0, packet.received, packet.received, packet.bytes).is_ok() {
            order.push(source.0);
        }
    }
    if !order.is_empty() && port.tick(time.index, time.now, order).is_err() {
        order.clear();
    }
}

/// Records the results of a tick.
///
/// Packets have priority, so results that don't fit are left out. Gaps in the numbers of the records show where results
/// were left out.
fn record_results(
    port: &mut RecorderPort,
    streams: &[(&str, &ResultStream)],
    time: &TickTime,
    message: &mut Vec<u8>,
    records: &[u64; STREAMS.len()],
) {
    let streams = streams.iter().zip(records).take(port.result_channels());
    for (channel, ((_, trail), before)) in (0..).zip(streams) {
        if !trail.words().is_empty() {
            let whole = fill(message, time.index, *before, trail.words());
            if port.result(channel, time.now, message).is_err() || !whole {
                port.miss_results();
            }
        }
    }
}

/// Writes the words of a stream into a message, without allocation. Returns `false` if the words don't all fit.
fn fill(message: &mut Vec<u8>, tick: u64, before: u64, words: &[u64]) -> bool {
    message.clear();
    let room = message.capacity() / 8 - HEAD_WORDS;
    for word in [tick, before].iter().chain(words.iter().take(room)) {
        message.extend_from_slice(&word.to_le_bytes());
    }
    words.len() <= room
}
