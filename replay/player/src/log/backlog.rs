//! Messages that aren't synced yet: written since the latest sync, or still waiting because the medium accepts no data.

use std::collections::{BTreeMap, VecDeque};

use headrace_geometry::time::MonoNs;

use super::format::{RAW_PREFIX, SENT_PREFIX, TICK_TOPIC, Tick, VOICE_TOPIC};
use super::part::Progress;
use super::writer::{Lane, LogHeader};

/// Maximum memory of unsynced messages, bytes. It is enough for some minutes of a dive with four heads.
const MAX_BYTES: usize = 16 << 20;

/// Properties of an unsynced message, without its bytes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Head {
    pub(super) lane: Lane,
    pub(super) log_time: MonoNs,
    pub(super) publish_time: MonoNs,
    pub(super) len: usize,
    /// Index of the tick, if the message is a tick.
    tick: Option<u64>,
}

/// Unsynced messages in the order of their arrival, at most 16 MiB.
#[derive(Debug, Default)]
pub(super) struct Backlog {
    heads: VecDeque<Head>,
    data: VecDeque<u8>,
}

impl Backlog {
    pub(super) fn push(&mut self, lane: Lane, log_time: MonoNs, publish_time: MonoNs, bytes: &[u8]) {
        let tick = (lane == Lane::Tick).then(|| Tick::decode(bytes).ok().map(|tick| tick.index)).flatten();
        self.heads.push_back(Head { lane, log_time, publish_time, len: bytes.len(), tick });
        self.data.extend(bytes);
    }

    /// Removes and returns the oldest message if all messages together exceed the memory limit.
    pub(super) fn overflow(&mut self) -> Option<Head> {
        if self.bytes() > MAX_BYTES { self.pop() } else { None }
    }

    /// Removes the recordings of voice notes, and returns their properties.
    pub(super) fn drop_voices(&mut self) -> Vec<Head> {
        let (mut dropped, mut at) = (Vec::new(), 0);
        let Self { heads, data } = self;
        heads.retain(|head| {
            let is_voice = head.lane == Lane::Voice;
            if is_voice {
                data.drain(at..at + head.len);
                dropped.push(*head);
            } else {
                at += head.len;
            }
            !is_voice
        });
        dropped
    }

    pub(super) fn pop(&mut self) -> Option<Head> {
        let head = self.heads.pop_front()?;
        self.data.drain(..head.len);
        Some(head)
    }

    /// Returns the memory that the unsynced messages take, bytes.
    pub(super) fn bytes(&self) -> usize {
        self.data.len() + self.heads.len() * size_of::<Head>()
    }

    pub(super) fn len(&self) -> u64 {
        self.heads.len() as u64
    }

    /// Returns the log times of the first and last unsynced message.
    pub(super) fn span(&self) -> Option<(MonoNs, MonoNs)> {
        Some((self.heads.front()?.log_time, self.heads.back()?.log_time))
    }

    /// Calls `write` with each message, until a call fails.
    ///
    /// Errors: an error of `write`.
    pub(super) fn try_each<E>(
        &mut self,
        mut write: impl FnMut(&Head, &[u8]) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut rest: &[u8] = self.data.make_contiguous();
        for head in &self.heads {
            let (bytes, after) = rest.split_at_checked(head.len).unwrap_or((rest, &[]));
            write(head, bytes)?;
            rest = after;
        }
        Ok(())
    }
}

/// Totals of a recording's messages so far, over all parts.
#[derive(Debug, Clone, Default)]
pub(super) struct Tally {
    messages: u64,
    tick: Option<u64>,
    next: BTreeMap<Lane, u32>,
    /// Log time of the recording's latest message.
    pub(super) last: Option<MonoNs>,
}

impl Tally {
    /// Creates the totals from the totals in a part's metadata. `last` is the time of the latest message.
    pub(super) fn of(progress: &Progress, header: &LogHeader, last: MonoNs) -> Self {
        let sources = (0..).take(header.sources.len());
        let lanes = sources.flat_map(|number| [Lane::Raw(number), Lane::Sent(number)]);
        let lanes =
            lanes.chain([Lane::Tick, Lane::Voice]).chain((0..).take(header.results.len()).map(Lane::Result));
        let next = lanes.filter_map(|lane| Some((lane, *progress.sequences.get(&topic(lane, header)?)?)));
        Self { messages: progress.messages, tick: progress.tick, next: next.collect(), last: Some(last) }
    }

    pub(super) fn add(&mut self, head: &Head) {
        self.messages += 1;
        self.tick = head.tick.or(self.tick);
        let next = self.next.entry(head.lane).or_default();
        *next = next.wrapping_add(1);
        self.last = Some(head.log_time);
    }

    /// Returns the numbers of messages so far, in the form in which a part's metadata states them.
    pub(super) fn progress(&self, header: &LogHeader) -> Progress {
        let sequences = self.next.iter().filter_map(|(lane, next)| Some((topic(*lane, header)?, *next)));
        Progress { messages: self.messages, tick: self.tick, sequences: sequences.collect() }
    }
}

/// Returns the topic of a channel; `None` if the header doesn't have the channel.
fn topic(lane: Lane, header: &LogHeader) -> Option<String> {
    let source = |prefix: &str, number: u16| {
        header.sources.get(usize::from(number)).map(|source| format!("{prefix}{}", source.id))
    };
    match lane {
        Lane::Raw(number) => source(RAW_PREFIX, number),
        Lane::Sent(number) => source(SENT_PREFIX, number),
        Lane::Tick => Some(TICK_TOPIC.to_owned()),
        Lane::Voice => Some(VOICE_TOPIC.to_owned()),
        Lane::Result(number) => header.results.get(usize::from(number)).map(|result| result.topic.clone()),
    }
}
