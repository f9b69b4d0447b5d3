//! Writes a log on the caller's thread. No other module encodes messages as records.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use headrace_geometry::time::{DurNs, MonoNs};
use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;

use super::error::LogError;
use super::fault::RecordingFault;
use super::format::{
    ATTACHMENT_PREFIX, BYTES_ENCODING, CHANNEL_LIST, CONNECT_KEY, FORMAT_KEY, FORMAT_VERSION, LIBRARY,
    LOSSES, METADATA, PLUGIN_KEY, RAW_PREFIX, RESULT_PREFIX, SENT_PREFIX, SOURCE_KEY, TICK_TOPIC, Tick,
    VEHICLE_FILE, VOICE_TOPIC, order_bytes, seal, stated_loss, tick_head,
};
use super::part::{PART, PART_END, PartEnd, PartHead, Progress};
use super::space::LeftOut;

/// Size at which a chunk is closed, bytes, whatever its time span is.
const CHUNK_BYTES: u64 = 1 << 20;
/// Span of dive time at which a chunk is closed.
const CHUNK_SPAN: DurNs = DurNs(500_000_000);
/// Bytes that each chunk adds to the summary, and bytes that each channel in the chunk adds to it.
///
/// Source: MCAP format specification, "Chunk Index".
const CHUNK_INDEX_BYTES: u64 = 80;
const CHUNK_INDEX_CHANNEL_BYTES: u64 = 10;

/// The header of a log to be written.
#[derive(Debug, Clone, Default)]
pub struct LogHeader {
    /// Text of the vehicle file; empty if there is none.
    pub vehicle_toml: String,
    /// Name and content of each file that the vehicle file names.
    pub attachments: Vec<(String, Vec<u8>)>,
    /// Metadata, such as the version, the digest of the configuration, and clock anchors.
    pub metadata: BTreeMap<String, String>,
    /// The sources. A source's index is its number in the messages.
    pub sources: Vec<SourceInfo>,
    /// Whether the log will have ticks. The log of a simulation has no ticks, and no channel for them.
    pub ticks: bool,
    /// Whether the log may have recordings of voice notes.
    pub voices: bool,
    /// The result channels. A channel's index is its number in the messages.
    pub results: Vec<ResultChannel>,
    /// Numbers of the sources that are sonars. Their long packets are echoes, which are dropped first when a disk
    /// fills.
    pub sonars: Vec<u16>,
    /// Metadata of this part, if the recording has parts. The message numbers of this part continue those of earlier
    /// parts.
    pub part: Option<PartHead>,
}

impl LogHeader {
    /// Whether a log with this header has this channel.
    pub(super) fn has(&self, lane: Lane) -> bool {
        match lane {
            Lane::Raw(source) | Lane::Sent(source) => usize::from(source) < self.sources.len(),
            Lane::Tick => self.ticks,
            Lane::Voice => self.voices,
            Lane::Result(channel) => usize::from(channel) < self.results.len(),
        }
    }
}

/// A source of bytes, as described by the metadata of its channels.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct SourceInfo {
    /// Id of the source, which is also part of its topics.
    pub id: String,
    /// Plugin that handles the device; empty if unknown.
    pub plugin: String,
    /// Connection of the device; empty if unknown.
    pub connect: String,
}

/// A channel for results of the loop.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ResultChannel {
    /// Topic of the channel, which begins with `/result/`.
    pub topic: String,
    /// Name of the channel's schema, such as `foxglove.PoseInFrame`.
    pub schema_name: String,
    /// Encoding of the channel's schema, such as `jsonschema`.
    pub schema_encoding: String,
    /// Text of the channel's schema.
    pub schema: String,
    /// Encoding of the channel's messages, such as `json`.
    pub message_encoding: String,
    /// Whether the messages are dropped together with echoes when the disk fills.
    ///
    /// True if the channel has a record per echo, or if a replay doesn't need the channel's messages.
    pub follows_echoes: bool,
}

/// Totals of a written log.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Summary {
    /// Number of messages of all channels in the log.
    pub messages: u64,
    /// Total length of the messages, uncompressed and without framing, bytes.
    pub message_bytes: u64,
    /// Number of chunks, including the one with the channel definitions.
    pub chunks: u32,
    /// Length of the log file, bytes.
    pub bytes: u64,
    /// Number of messages received from sources.
    pub raw_messages: u64,
    /// Faults while the log was recorded.
    pub faults: Vec<RecordingFault>,
    /// Messages dropped because the disk was nearly full.
    pub left_out: LeftOut,
    /// Number of messages sent to devices that were not recorded, because they didn't fit in the recorder's queue.
    pub sent_dropped: u64,
    /// Number of packets in skipped ticks. The recorder was too far behind to record these ticks.
    pub skipped: u64,
    /// Number of ticks whose results didn't all fit in the recorder's queue.
    pub results_missing: u64,
    /// The files of a recording, in order.
    pub parts: Vec<PartSummary>,
}

/// A written part of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PartSummary {
    /// Path of the part's file.
    pub path: PathBuf,
    /// Number of messages received from sources in this part.
    pub raw_messages: u64,
}

/// Destination of a message, which is a channel identified by its content.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Lane {
    Raw(u16),
    Sent(u16),
    Tick,
    Result(u16),
    Voice,
}

/// A channel of the file, with the number of its next message.
#[derive(Debug, Clone, Copy)]
struct Channel {
    id: u16,
    sequence: u32,
}

/// Writes a log.
///
/// The underlying writer only appends and never seeks, so bytes that were written stay unchanged. Only
/// [`LogWriter::finish`] ends a log. A log that is dropped or had an error gets neither summary nor footer, so
/// readers recognise it as cut off.
///
/// Chunks are compressed by zstd at its lowest level. A dive produces some hundred kB/s, which even a small computer
/// compresses a thousand times faster. A smaller file is therefore worth more than the speed of lz4.
pub struct LogWriter<W: Write> {
    /// The field is declared before `writer`, so that it is dropped first and closes the medium. Otherwise the `mcap`
    /// crate's writer would end the log when it is dropped.
    medium: Closing,
    writer: mcap::Writer<NoSeek<Counted<W>>>,
    raw: Vec<Channel>,
    sent: Vec<Channel>,
    tick: Option<Channel>,
    voice: Option<Channel>,
    results: Vec<Channel>,
    tick_message: Vec<u8>,
    messages: u64,
    message_bytes: u64,
    raw_messages: u64,
    chunks: u64,
    last_tick: Option<u64>,
    /// Totals of all earlier parts of the recording.
    before: Progress,
    /// Number of losses stated in the log so far.
    losses: u64,
    /// Log time of the open chunk's first message.
    chunk_began: Option<MonoNs>,
    /// Whether the latest message was a voice recording, which has a chunk of its own.
    is_alone: bool,
}

impl LogWriter<BufWriter<File>> {
    /// Starts a log in a file. An existing file is overwritten.
    ///
    /// Errors: the file can't be created or written, or the header isn't allowed (see [`LogWriter::new`]).
    pub fn create(path: &Path, header: &LogHeader) -> Result<Self, LogError> {
        let file = File::create(path).map_err(|source| LogError::Create { path: path.to_owned(), source })?;
        Self::new(BufWriter::new(file), header)
    }
}

impl<W: Write> LogWriter<W> {
    /// Starts a log, and writes everything that comes before the first message.
    ///
    /// Errors: an error of the writer; the topic of a result doesn't begin with `/result/`; more channels than MCAP
    /// allows.
    pub fn new(writer: W, header: &LogHeader) -> Result<Self, LogError> {
        if let Some(result) = header.results.iter().find(|result| !result.topic.starts_with(RESULT_PREFIX)) {
            return Err(LogError::Topic { topic: result.topic.clone() });
        }
        // The writer uses no threads, because the log of a simulation must depend only on its scene and not on the
        // machine. It doesn't seek, so that each chunk is written as soon as it is closed.
        let options = mcap::WriteOptions::new()
            .profile("headrace")
            .library(format!("{LIBRARY}{}", env!("CARGO_PKG_VERSION")))
            .compression(Some(mcap::Compression::Zstd))
            .compression_level(1)
            .compression_threads(0)
            .chunk_size(Some(CHUNK_BYTES))
            .disable_seeking(true);
        let medium = Arc::new(Medium::default());
        let closing = Closing(Arc::clone(&medium));
        let counted = NoSeek::new(Counted { writer, medium: Arc::clone(&medium) });
        let mut writer = options.create(counted).map_err(LogError::writing("the first bytes"))?;
        write_metadata(&mut writer, header)?;
        let mut list = BTreeMap::new();
        let vehicle = (VEHICLE_FILE, "application/toml", header.vehicle_toml.as_bytes());
        let others = header.attachments.iter();
        let others = others.map(|(name, data)| (name.as_str(), BYTES_ENCODING, data.as_slice()));
        let vehicle = Some(vehicle).filter(|(.., text)| !text.is_empty());
        for (name, media_type, data) in vehicle.into_iter().chain(others) {
            attach(&mut writer, name, media_type, data)?;
            list.insert(format!("{ATTACHMENT_PREFIX}{name}"), data.len().to_string());
        }
        let mut channels = ChannelList { writer: &mut writer, list };
        let raw = channels.add_sources(RAW_PREFIX, &header.sources)?;
        let sent = channels.add_sources(SENT_PREFIX, &header.sources)?;
        let tick = header.ticks.then(|| channels.add(0, TICK_TOPIC, BYTES_ENCODING, BTreeMap::new()));
        let tick = tick.transpose()?;
        let results = channels.add_results(&header.results)?;
        let voice = header.voices.then(|| channels.add(0, VOICE_TOPIC, BYTES_ENCODING, BTreeMap::new()));
        let voice = voice.transpose()?;
        channels.write()?;
        let before = header.part.as_ref().map(|part| part.before.clone()).unwrap_or_default();
        let mut log = Self {
            writer,
            medium: closing,
            raw,
            sent,
            tick,
            voice,
            results,
            tick_message: Vec::new(),
            messages: 0,
            message_bytes: 0,
            raw_messages: 0,
            chunks: 0,
            last_tick: before.tick,
            before,
            losses: 0,
            chunk_began: None,
            is_alone: false,
        };
        log.count_on(header);
        Ok(log)
    }

    /// Continues the channels' message numbers from the earlier parts.
    fn count_on(&mut self, header: &LogHeader) {
        let before = core::mem::take(&mut self.before);
        for (topic, channel) in self.channels(header) {
            channel.sequence = before.sequences.get(&topic).copied().unwrap_or_default();
        }
        self.before = before;
    }

    /// Returns all channels with their topics.
    fn channels(&mut self, header: &LogHeader) -> Vec<(String, &mut Channel)> {
        let topics =
            |prefix: &'static str| header.sources.iter().map(move |source| format!("{prefix}{}", source.id));
        let mut all: Vec<(String, &mut Channel)> = topics(RAW_PREFIX).zip(&mut self.raw).collect();
        all.extend(topics(SENT_PREFIX).zip(&mut self.sent));
        all.extend(self.tick.as_mut().map(|channel| (TICK_TOPIC.to_owned(), channel)));
        all.extend(self.voice.as_mut().map(|channel| (VOICE_TOPIC.to_owned(), channel)));
        all.extend(header.results.iter().map(|result| result.topic.clone()).zip(&mut self.results));
        all
    }

    /// Returns the approximate length of the file if it were ended now, bytes. The open chunk counts uncompressed.
    pub(super) fn bytes(&self) -> u64 {
        let channels = self.raw.len() + self.sent.len() + self.results.len() + 1;
        let index = CHUNK_INDEX_BYTES + CHUNK_INDEX_CHANNEL_BYTES * channels as u64;
        self.medium.0.bytes.load(Ordering::Relaxed) + index * self.chunks
    }

    /// Closes the chunk, and writes the totals up to the end of this part and whether another part follows.
    ///
    /// Errors: an error of the writer.
    pub(super) fn end_part(&mut self, follows: bool) -> Result<(), LogError> {
        let messages = self.before.messages + self.messages;
        let after = Progress { messages, tick: self.last_tick, ..Progress::default() };
        let entries = PartEnd { after, follows }.entries();
        let record = Metadata { name: PART_END.to_owned(), metadata: seal(PART_END, entries) };
        self.flush()?;
        self.writer.write_metadata(&record).map_err(LogError::writing("the end of a part"))
    }

    /// Writes bytes from `source`, received at `received` and valid at `valid`.
    ///
    /// Errors: an error of the writer; the header has no such source.
    pub fn raw(
        &mut self,
        source: u16,
        received: MonoNs,
        valid: MonoNs,
        bytes: &[u8],
    ) -> Result<(), LogError> {
        self.message(Lane::Raw(source), received, valid, bytes)
    }

    /// Writes bytes sent to `source`.
    ///
    /// Errors: an error of the writer; the header has no such source.
    pub fn sent(&mut self, source: u16, at: MonoNs, bytes: &[u8]) -> Result<(), LogError> {
        self.message(Lane::Sent(source), at, at, bytes)
    }

    /// Writes a tick of the loop, with the source numbers of its packets in the order of consumption.
    ///
    /// Errors: an error of the writer; the header has no ticks.
    pub fn tick(&mut self, index: u64, now: MonoNs, order: &[u16]) -> Result<(), LogError> {
        let packets =
            u32::try_from(order.len()).map_err(|_| LogError::TickTooLong { packets: order.len() })?;
        let mut message = core::mem::take(&mut self.tick_message);
        message.clear();
        message.extend(tick_head(index, now, packets));
        message.extend(order_bytes(order));
        let written = self.message(Lane::Tick, now, now, &message);
        self.tick_message = message;
        written
    }

    /// Writes a message of result channel `channel`.
    ///
    /// Errors: an error of the writer; the header has no such result.
    pub fn result(&mut self, channel: u16, time: MonoNs, bytes: &[u8]) -> Result<(), LogError> {
        self.message(Lane::Result(channel), time, time, bytes)
    }

    /// Writes one message to the log.
    pub(super) fn message(
        &mut self,
        lane: Lane,
        log_time: MonoNs,
        publish_time: MonoNs,
        bytes: &[u8],
    ) -> Result<(), LogError> {
        let channel = match lane {
            Lane::Raw(source) => self.raw.get_mut(usize::from(source)),
            Lane::Sent(source) => self.sent.get_mut(usize::from(source)),
            Lane::Tick => self.tick.as_mut(),
            Lane::Voice => self.voice.as_mut(),
            Lane::Result(channel) => self.results.get_mut(usize::from(channel)),
        };
        let channel = channel.ok_or_else(|| LogError::NoChannel { channel: format!("{lane:?}") })?;
        let header = MessageHeader {
            channel_id: channel.id,
            sequence: channel.sequence,
            log_time: log_time.0,
            publish_time: publish_time.0,
        };
        channel.sequence = channel.sequence.wrapping_add(1);
        // A chunk is closed by time, so that damage to it loses only half a second, whatever the data rate.
        // A voice recording is as large as several seconds of a dive, so it gets its own chunk, and damage to it affects
        // nothing else.
        let is_alone = core::mem::replace(&mut self.is_alone, lane == Lane::Voice) || self.is_alone;
        if self.chunk_began.is_some_and(|began| is_alone || log_time.since(began).0 >= CHUNK_SPAN.0) {
            // The `mcap` crate flushes when it closes a chunk. The flush must not reach the medium, because the
            // caller decides when to sync.
            self.medium.0.is_spared.store(true, Ordering::Relaxed);
            let closed = self.writer.flush();
            self.medium.0.is_spared.store(false, Ordering::Relaxed);
            closed.map_err(LogError::writing("a chunk"))?;
            self.chunks += 1;
            self.chunk_began = None;
        }
        self.chunk_began.get_or_insert(log_time);
        self.writer.write_to_known_channel(&header, bytes).map_err(LogError::writing("a message"))?;
        self.messages += 1;
        self.message_bytes += bytes.len() as u64;
        match lane {
            Lane::Raw(_) => self.raw_messages += 1,
            Lane::Tick => self.last_tick = Tick::decode(bytes).ok().map(|tick| tick.index),
            Lane::Sent(_) | Lane::Result(_) | Lane::Voice => {}
        }
        Ok(())
    }

    /// Records a loss between the times `from` and `to` in the log, and closes the chunk. `None` is an unknown time.
    ///
    /// Errors: an error of the writer.
    pub fn lost(&mut self, from: Option<MonoNs>, to: Option<MonoNs>, words: &str) -> Result<(), LogError> {
        let entry = (format!("{:06}", self.losses), stated_loss(from, to, words));
        let record = Metadata { name: LOSSES.to_owned(), metadata: seal(LOSSES, [entry].into()) };
        self.losses += 1;
        self.writer.write_metadata(&record).map_err(LogError::writing("what is missing"))?;
        self.flush()
    }

    /// Closes the chunk and flushes the writer. Everything written so far then survives a crash.
    ///
    /// Errors: an error of the writer.
    pub fn flush(&mut self) -> Result<(), LogError> {
        self.chunks += u64::from(self.chunk_began.take().is_some());
        self.writer.flush().map_err(LogError::writing("a chunk"))
    }

    /// Writes the summary, flushes, and returns the writer.
    ///
    /// Errors: an error of the writer.
    pub fn finish(mut self) -> Result<(W, Summary), LogError> {
        let chunks = self.writer.finish().map_err(LogError::writing("the summary"))?.chunk_indexes.len();
        let mut writer = self.writer.into_inner();
        let flushed = writer.flush().and_then(|()| std::io::Seek::stream_position(&mut writer));
        let bytes = flushed.map_err(|source| LogError::Write { what: "the summary", source })?;
        let summary = Summary {
            messages: self.messages,
            message_bytes: self.message_bytes,
            chunks: u32::try_from(chunks).unwrap_or(u32::MAX),
            bytes,
            raw_messages: self.raw_messages,
            ..Summary::default()
        };
        Ok((writer.into_inner().writer, summary))
    }
}

fn write_metadata<W: Write>(
    writer: &mut mcap::Writer<NoSeek<Counted<W>>>,
    header: &LogHeader,
) -> Result<(), LogError> {
    let mut metadata = header.metadata.clone();
    metadata.insert(FORMAT_KEY.to_owned(), FORMAT_VERSION.to_string());
    let part = header.part.as_ref().map(|part| (PART, part.entries()));
    for (name, metadata) in [(METADATA, metadata)].into_iter().chain(part) {
        let record = Metadata { name: name.to_owned(), metadata: seal(name, metadata) };
        writer.write_metadata(&record).map_err(LogError::writing("metadata"))?;
    }
    Ok(())
}

/// Number of bytes passed to the log's medium so far, and whether more may be passed.
#[derive(Default)]
struct Medium {
    bytes: AtomicU64,
    /// Whether the medium refuses further bytes. This happens after an error, and before the `mcap` crate's writer ends
    /// the log on drop.
    shut: AtomicBool,
    /// Whether a flush is kept from the medium.
    is_spared: AtomicBool,
}

/// On drop, makes the medium refuse further bytes.
struct Closing(Arc<Medium>);

impl Drop for Closing {
    fn drop(&mut self) {
        self.0.shut.store(true, Ordering::Relaxed);
    }
}

/// A writer that counts its bytes, and accepts nothing after an error.
struct Counted<W> {
    writer: W,
    medium: Arc<Medium>,
}

impl<W> Counted<W> {
    fn attempt<T>(&mut self, action: impl FnOnce(&mut W) -> std::io::Result<T>) -> std::io::Result<T> {
        if self.medium.shut.load(Ordering::Relaxed) {
            return Err(std::io::Error::other("the log was given up after an error"));
        }
        let done = action(&mut self.writer);
        if done.as_ref().is_err_and(|error| error.kind() != std::io::ErrorKind::Interrupted) {
            self.medium.shut.store(true, Ordering::Relaxed);
        }
        done
    }
}

impl<W: Write> Write for Counted<W> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let taken = self.attempt(|writer| writer.write(bytes))?;
        self.medium.bytes.fetch_add(taken as u64, Ordering::Relaxed);
        Ok(taken)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        if self.medium.is_spared.load(Ordering::Relaxed) {
            return Ok(());
        }
        self.attempt(Write::flush)
    }
}

fn attach<W: Write>(
    writer: &mut mcap::Writer<NoSeek<Counted<W>>>,
    name: &str,
    media_type: &str,
    data: &[u8],
) -> Result<(), LogError> {
    let attachment = mcap::Attachment {
        log_time: 0,
        create_time: 0,
        name: name.to_owned(),
        media_type: media_type.to_owned(),
        data: data.into(),
    };
    writer.attach(&attachment).map_err(LogError::writing("an attachment"))
}

/// Adds channels to a log, and collects their definitions for the metadata record that repeats them.
struct ChannelList<'a, W: Write> {
    writer: &'a mut mcap::Writer<NoSeek<Counted<W>>>,
    list: BTreeMap<String, String>,
}

impl<W: Write> ChannelList<'_, W> {
    fn add(
        &mut self,
        schema: u16,
        topic: &str,
        encoding: &str,
        metadata: BTreeMap<String, String>,
    ) -> Result<Channel, LogError> {
        let id = self.writer.add_channel(schema, topic, encoding, &metadata);
        let id = id.map_err(LogError::writing("a channel"))?;
        self.list.insert(format!("{id}/topic"), topic.to_owned());
        self.list.extend(metadata.into_iter().map(|(key, value)| (format!("{id}/{key}"), value)));
        Ok(Channel { id, sequence: 0 })
    }

    fn add_sources(&mut self, prefix: &str, sources: &[SourceInfo]) -> Result<Vec<Channel>, LogError> {
        let mut channels = Vec::with_capacity(sources.len());
        for (number, source) in sources.iter().enumerate() {
            let metadata = BTreeMap::from([
                (PLUGIN_KEY.to_owned(), source.plugin.clone()),
                (CONNECT_KEY.to_owned(), source.connect.clone()),
                (SOURCE_KEY.to_owned(), number.to_string()),
            ]);
            channels.push(self.add(0, &format!("{prefix}{}", source.id), BYTES_ENCODING, metadata)?);
        }
        Ok(channels)
    }

    fn add_results(&mut self, results: &[ResultChannel]) -> Result<Vec<Channel>, LogError> {
        let mut channels = Vec::with_capacity(results.len());
        for result in results {
            let schema = self.writer.add_schema(
                &result.schema_name,
                &result.schema_encoding,
                result.schema.as_bytes(),
            );
            let schema = schema.map_err(LogError::writing("a schema"))?;
            channels.push(self.add(schema, &result.topic, &result.message_encoding, BTreeMap::new())?);
        }
        Ok(channels)
    }

    fn write(self) -> Result<(), LogError> {
        let record = Metadata { name: CHANNEL_LIST.to_owned(), metadata: seal(CHANNEL_LIST, self.list) };
        self.writer.write_metadata(&record).map_err(LogError::writing("the list of channels"))
    }
}
