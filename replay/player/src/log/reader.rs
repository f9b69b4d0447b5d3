//! Reads logs of this program and of other programs, intact or damaged, one piece at a time.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek};
use std::path::Path;

use headrace_geometry::time::MonoNs;
use mcap::records::op;
use serde::{Deserialize, Serialize};

use super::channels::{Admission, ChannelKind, Channels};
use super::chunk::{Unpacked, data_section_holds, unpack};
use super::error::LogError;
use super::fields::Fields;
use super::format::VEHICLE_FILE;
use super::framing::{ChunkPlace, Definition, LogFile};
use super::limits::{LATEST, MAX_HELD_BYTES, quoted};
use super::loss::{Loss, LossKind, Losses, Many};
use super::merge::{Batch, Merge};
use super::numbering::Numbering;
use super::part::{Part, Progress};
use super::scan::{FoundDefinitions, Piece, Span, beyond, date_losses, scan};
use super::writer::SourceInfo;
use crate::regular_file;

/// First opcode that other programs may use. Source: MCAP format specification, "Records".
const PRIVATE: u8 = 0x80;

/// The header of a log, as read.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct LogInfo {
    /// Text of the vehicle file; `None` if the log has none, or it isn't valid UTF-8.
    pub vehicle_toml: Option<String>,
    /// Name and content of each attachment other than the vehicle file.
    pub attachments: Vec<(String, Vec<u8>)>,
    /// Metadata of the log. Entries of this program's own record keep their key. Other entries have the key `<name of
    /// the record>/<key>`.
    pub metadata: BTreeMap<String, String>,
    /// The sources of the log. A source's index is its number in [`MessageKind`].
    ///
    /// In this program's logs, the channels' metadata contain the source numbers. If some source numbers are missing,
    /// the sources are numbered in the order of their names: `/raw/...` first, then `/sent/...`.
    pub sources: Vec<SourceInfo>,
    /// Position of this log in a recording with several parts.
    pub part: Option<Part>,
}

/// Kind of a message in a log.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MessageKind<'a> {
    /// Bytes received from a source such as a sensor.
    Raw {
        /// Number of the source.
        source: u16,
    },
    /// Bytes sent to a source such as a sensor.
    Sent {
        /// Number of the source.
        source: u16,
    },
    /// A tick of the loop, see [`super::format::Tick`].
    Tick,
    /// The recording of a voice note, see [`super::voice`].
    Voice,
    /// A message with results of the loop.
    Result {
        /// Topic of the result channel.
        topic: &'a str,
    },
    /// A message of a channel that this program doesn't know.
    Other,
}

/// A message of a log.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LogMessage<'a> {
    /// Kind of the message.
    pub kind: MessageKind<'a>,
    /// Number of the message's channel.
    pub channel: u16,
    /// Time at which the message was received or created.
    pub log_time: MonoNs,
    /// Time at which the message's content was valid.
    pub publish_time: MonoNs,
    /// Number of the message in its channel.
    pub sequence: u32,
    /// Content of the message.
    pub data: &'a [u8],
}

/// A position in a log, from which reading can be resumed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct LogPlace {
    /// Number of pieces read so far. A piece is a chunk, or a run of messages outside chunks.
    read: usize,
    /// Pieces of the log from which messages are left: number of the piece, and number of messages taken from
    /// it.
    open: Vec<(usize, usize)>,
    /// Times of the messages in those chunks whose headers state wrong times, each with the piece number of the chunk.
    corrected: Vec<(usize, (u64, u64))>,
    latest: u64,
    late: u64,
    losses: Vec<Loss>,
    /// Runs of message numbers in the chunks read so far; `None` if they aren't checked.
    numbering: Option<Numbering>,
    /// Channels whose definitions were found among the messages so far.
    defined: Vec<Definition>,
}

/// A channel of a log, from its definition.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ChannelInfo<'a> {
    /// Channel number.
    pub id: u16,
    /// Topic of the channel.
    pub topic: &'a str,
    /// Encoding of the channel's messages; empty if unknown.
    pub encoding: &'a str,
    /// Name of the schema, if the log contains the schema.
    pub schema: Option<&'a str>,
}

/// Reads a log.
///
/// Opening scans the whole file once, without unpacking it. The order of messages therefore doesn't depend on the
/// summary.
///
/// A log with a `/loop/tick` channel is read in file order. Other logs are sorted by log time, source and sequence. A
/// piece is a chunk, or about a megabyte of messages outside chunks. A piece is in memory from the time of its earliest
/// message on, and pieces whose times overlap are merged.
///
/// The order is exact if overlapping pieces fit into 32 MiB and chunk headers state correct times.
/// [`LogReader::late`] counts messages out of order.
///
/// Damage is not an error: readable messages are delivered, and [`LogReader::losses`] lists the missing ones.
pub struct LogReader<R = File> {
    file: LogFile<R>,
    info: LogInfo,
    channels: Channels,
    schemas: BTreeMap<u16, String>,
    losses: Losses,
    /// Pieces of the log (chunks, and runs of messages outside chunks), in file order.
    spans: Vec<Span>,
    /// Times that the headers of chunks state. Only chunks whose messages have other times are listed. The key is the
    /// number of the piece.
    stated: BTreeMap<usize, (u64, u64)>,
    /// Numbers of the log's pieces, in reading order.
    plan: Vec<u32>,
    /// Number of pieces read so far, in the order of `plan`.
    read: usize,
    merge: Merge,
    by_time: bool,
    latest: u64,
    late: u64,
    finished: bool,
    /// Runs of message numbers in the chunks read so far, which show missing messages. `None` if another program wrote
    /// the log, or if reading didn't begin at the log's start.
    numbering: Option<Numbering>,
    /// For each channel, the number of the first message that the recording's next part repeats.
    repeated: BTreeMap<u16, u32>,
}

impl LogReader<File> {
    /// Opens a log.
    ///
    /// Errors: the file can't be read, isn't MCAP, or has a later format.
    pub fn open(path: &Path) -> Result<Self, LogError> {
        let file = regular_file::open(path);
        let file = file.map_err(|source| LogError::Open { path: path.to_owned(), source })?;
        Self::new(file, path.display().to_string())
    }
}

impl<R: Read + Seek> LogReader<R> {
    /// Reads a log from any input. `name` is the log's name in error texts.
    ///
    /// Errors: as for [`LogReader::open`].
    pub fn new(input: R, name: String) -> Result<Self, LogError> {
        let mut file = LogFile::new(input, name)?;
        let (mut scan, channels) = scan(&mut file)?;
        let mut metadata = core::mem::take(&mut scan.metadata);
        let part = Part::take(&mut metadata);
        let numbering = Numbering::of(&mut scan, part.as_ref(), &channels, file.len());
        let mut info = LogInfo {
            vehicle_toml: None,
            attachments: scan.attachments,
            metadata,
            part,
            sources: channels.sources().to_vec(),
        };
        take_vehicle_file(&mut info);
        let by_time = !channels.has(ChannelKind::Tick);
        tracing::debug!(log = %file.name(), chunks = scan.spans.len(), sources = info.sources.len(), by_time, "log scanned");
        let mut plan: Vec<u32> = (0..).take(scan.spans.len()).collect();
        if by_time {
            plan.sort_by_key(|number| scan.spans.get(*number as usize).map(|span| span.from));
        }
        Ok(Self {
            file,
            info,
            channels,
            schemas: scan.schemas,
            losses: scan.losses,
            spans: scan.spans,
            stated: BTreeMap::new(),
            plan,
            read: 0,
            merge: Merge::new(by_time),
            by_time,
            latest: 0,
            late: 0,
            finished: false,
            numbering,
            repeated: BTreeMap::new(),
        })
    }

    /// Returns the header of the log.
    pub fn header(&self) -> &LogInfo {
        &self.info
    }

    /// Moves the attachments out of the header, so that long attachments aren't in memory twice.
    pub(super) fn take_attachments(&mut self) -> Vec<(String, Vec<u8>)> {
        core::mem::take(&mut self.info.attachments)
    }

    /// Whether the log contains the ticks of the loop that wrote it.
    pub fn has_ticks(&self) -> bool {
        self.channels.has(ChannelKind::Tick)
    }

    /// Whether the log has a channel of voice recordings.
    pub(super) fn has_voices(&self) -> bool {
        self.channels.has(ChannelKind::Voice)
    }

    /// Skips chunks that end before `at`, judged by their headers. Call it before reading the first message.
    pub(super) fn pass_before(&mut self, at: MonoNs) {
        let is_due = |number: &u32| {
            self.spans.get(*number as usize).is_none_or(|span| !span.is_dated() || span.to >= at.0)
        };
        self.read = self.plan.iter().position(is_due).unwrap_or(self.plan.len());
        if self.read > 0 {
            self.numbering = None;
        }
    }

    /// Returns the channels that are known before messages are read.
    pub fn channels(&self) -> impl Iterator<Item = ChannelInfo<'_>> {
        self.channels.all().map(|definition| {
            let (schema, encoding) =
                definition.form.as_ref().map_or((0, ""), |(schema, encoding)| (*schema, encoding));
            let schema = self.schemas.get(&schema).map(String::as_str);
            ChannelInfo { id: definition.id, topic: &definition.topic, encoding, schema }
        })
    }

    /// Excludes all messages that come later than the totals `after`. Call it before reading the first message.
    pub(super) fn pass_over(&mut self, after: &Progress) {
        let number = |topic: &str| after.sequences.get(topic).copied().unwrap_or_default();
        self.repeated = self.channels.all().map(|channel| (channel.id, number(&channel.topic))).collect();
    }

    /// Returns the first and last log time, from the chunk headers.
    pub(super) fn times(&self) -> Option<(MonoNs, MonoNs)> {
        let dated = self.spans.iter().filter(|span| span.is_dated());
        let times = dated.map(|span| (MonoNs(span.from), MonoNs(span.to)));
        times.reduce(|all, one| (all.0.min(one.0), all.1.max(one.1)))
    }

    /// Returns the result topics of all channels read so far, in the order of channel numbers.
    pub(super) fn result_topics(&self) -> Vec<String> {
        self.channels.result_topics()
    }

    /// Returns the topics that have several channels, each with its channel numbers.
    pub(super) fn doubles(&self) -> Vec<(String, Vec<u16>)> {
        self.channels.doubles()
    }

    /// Returns the sources of all channels read so far.
    pub(super) fn sources(&self) -> &[SourceInfo] {
        self.channels.sources()
    }

    /// Returns the damage found so far.
    ///
    /// Damage to the framing is known after opening. Damage within chunks is known only after reading them. The list is
    /// complete when [`LogReader::next`] has returned `None`.
    pub fn losses(&self) -> &[Loss] {
        self.losses.list()
    }

    /// Returns the number of messages delivered out of order, which means after a message with a later log time. It is
    /// 0 for a log with ticks.
    pub fn late(&self) -> u64 {
        self.late
    }

    /// Reads pieces of the log until a message is available. Returns `false` at the end of the log.
    pub(super) fn has_next(&mut self) -> Result<bool, LogError> {
        while self.must_read() {
            self.read_piece()?;
        }
        let found = self.merge.next_time().is_some();
        if !found {
            self.finish()?;
        }
        Ok(found)
    }

    /// Returns the next message; `None` at the end.
    ///
    /// Errors: an I/O error other than unreadable bytes. Damage and unreadable bytes are losses, not errors.
    #[expect(
        clippy::should_implement_trait,
        reason = "messages borrow from the reader, which no Iterator allows"
    )]
    pub fn next(&mut self) -> Result<Option<LogMessage<'_>>, LogError> {
        if !self.has_next()? {
            return Ok(None);
        }
        let Some((entry, slot)) = self.merge.pop() else { return Ok(None) };
        if self.by_time {
            self.late += u64::from(entry.head.log_time < self.latest);
            self.latest = self.latest.max(entry.head.log_time);
        }
        let kind = match self.channels.get(entry.head.channel) {
            None => MessageKind::Other,
            Some(channel) => match channel.kind {
                ChannelKind::Raw(source) => MessageKind::Raw { source },
                ChannelKind::Sent(source) => MessageKind::Sent { source },
                ChannelKind::Tick => MessageKind::Tick,
                ChannelKind::Voice => MessageKind::Voice,
                ChannelKind::Result => MessageKind::Result { topic: &channel.definition.topic },
                ChannelKind::Other => MessageKind::Other,
            },
        };
        Ok(Some(LogMessage {
            kind,
            channel: entry.head.channel,
            log_time: MonoNs(entry.head.log_time),
            publish_time: MonoNs(entry.head.publish_time),
            sequence: entry.head.sequence,
            data: self.merge.bytes(&entry, slot),
        }))
    }

    fn must_read(&self) -> bool {
        let next = self.plan.get(self.read).and_then(|number| self.spans.get(*number as usize));
        match (next, self.merge.next_time()) {
            (None, _) => false,
            (Some(_), None) => true,
            (Some(span), Some(time)) => {
                self.by_time && span.from <= time && self.merge.memory() < MAX_HELD_BYTES
            }
        }
    }

    /// Returns the current reading position.
    pub fn place(&self) -> LogPlace {
        let times = |number: &usize| self.spans.get(*number).map(|span| (*number, (span.from, span.to)));
        LogPlace {
            read: self.read,
            open: self.merge.open().collect(),
            corrected: self.stated.keys().filter_map(times).collect(),
            latest: self.latest,
            late: self.late,
            losses: self.losses.list().to_vec(),
            numbering: self.numbering.clone(),
            defined: self.channels.later().to_vec(),
        }
    }

    /// Continues from a position of this reader, or of another reader of the same file.
    ///
    /// Messages, their order and losses are then the same as if the log were read straight through.
    ///
    /// Errors: an I/O error.
    pub fn go_to(&mut self, place: &LogPlace) -> Result<(), LogError> {
        self.merge.clear();
        // Times of pieces are restored first, because they determine the reading order and the times of losses.
        for (number, stated) in core::mem::take(&mut self.stated) {
            self.correct(number, stated);
        }
        self.stated.clear();
        for (number, times) in &place.corrected {
            self.correct(*number, *times);
        }
        // Messages before the definition of their channel must be lost again, as if the log were read straight through.
        self.channels.go_to(&place.defined);
        for (number, next) in &place.open {
            self.read_span(*number, *next)?;
        }
        (self.read, self.latest, self.late) = (place.read, place.latest, place.late);
        // The list has only the losses that were known at this position. Later damage is found again when it is read.
        self.losses = Losses::of(place.losses.clone());
        self.numbering.clone_from(&place.numbering);
        self.finished = false;
        Ok(())
    }

    /// Sets the times of a piece of the log. The times that a chunk's header states are stored separately.
    fn correct(&mut self, number: usize, times: (u64, u64)) {
        let Some(span) = self.spans.get_mut(number).filter(|span| (span.from, span.to) != times) else {
            return;
        };
        self.stated.entry(number).or_insert((span.from, span.to));
        (span.from, span.to) = times;
    }

    fn read_piece(&mut self) -> Result<(), LogError> {
        let Some(number) = self.plan.get(self.read).map(|number| *number as usize) else { return Ok(()) };
        self.read += 1;
        self.read_span(number, 0)
    }

    /// Reads a piece of the log from which `next` messages have already been taken.
    fn read_span(&mut self, number: usize, next: usize) -> Result<(), LogError> {
        let mut batch = self.merge.empty_batch();
        let mut found = Vec::new();
        let Some(span) = self.spans.get(number).copied() else { return Ok(()) };
        self.fill(&span, &mut batch, &mut found)?;
        if self.file.medium().has_failed_within(&(span.at..span.end)) {
            // The medium couldn't read all bytes of this piece. Checksums don't cover everything, so none of
            // the piece's messages is used.
            batch.clear();
            found = vec![LossKind::Unreadable(self.file.medium().error().to_owned())];
        }
        if let Some(numbering) = &mut self.numbering {
            numbering.add(number, &batch.entries);
        }
        place_entries(&mut batch, &self.channels, &self.repeated, &mut found);
        for kind in found {
            self.lose(number, kind);
        }
        tracing::trace!(number, messages = batch.entries.len(), "chunk read");
        let times = batch.entries.iter().map(|entry| entry.head.log_time);
        let times = (times.clone().min().unwrap_or(0), times.max().unwrap_or(0));
        self.correct(number, times);
        self.merge.add(number, batch, next);
        Ok(())
    }

    /// Reads the messages of a piece of the log into a batch.
    fn fill(&mut self, span: &Span, batch: &mut Batch, found: &mut Vec<LossKind>) -> Result<(), LogError> {
        match &span.chunk(&mut self.file)? {
            Some(place) => read_chunk(&mut self.file, place, batch, &mut self.channels, found)?,
            None if span.piece == Piece::Run => read_run(&mut self.file, span, batch)?,
            // The chunk's header can't be read any more, so the file has changed since it was scanned.
            None => found.push(LossKind::Contents),
        }
        Ok(())
    }

    fn lose(&mut self, number: usize, kind: LossKind) {
        let Some(span) = self.spans.get(number) else { return };
        if let LossKind::Beyond { .. } = kind {
            self.losses.extend(kind, span.at, span.end.saturating_sub(span.at));
            return;
        }
        if self.losses.is_full() {
            // If the list is full, this loss only extends the last entry. The times of the last entry are determined at
            // the end, because searching for them at each loss is slow.
            let (offset, bytes) = (span.at, span.end.saturating_sub(span.at));
            self.losses.push(Loss { kind, offset, bytes, from: None, to: None });
            return;
        }
        let before = self.spans.iter().take(number).rev().find(|span| span.is_dated());
        let after = self.spans.iter().skip(number + 1).find(|span| span.is_dated());
        self.losses.push(Loss {
            kind,
            offset: span.at,
            bytes: span.end.saturating_sub(span.at),
            from: before.map(|span| MonoNs(span.to)),
            to: after.map(|span| MonoNs(span.from)),
        });
    }

    /// Verifies the checksum of the whole log at its end, if the log seems intact.
    ///
    /// Messages outside chunks have only this checksum. Logs with chunks are not checked, because the `mcap` crate's
    /// writer computes it wrongly when chunk checksums are disabled.
    fn finish(&mut self) -> Result<(), LogError> {
        if self.finished {
            return Ok(());
        }
        self.finished = true;
        date_losses(&mut self.losses, &self.spans, true);
        if let Some(numbering) = &self.numbering {
            numbering.report(&self.spans, &mut self.losses);
        }
        let unchunked = self.spans.iter().all(|span| matches!(span.piece, Piece::Run));
        if unchunked && self.losses.list().is_empty() && !data_section_holds(&mut self.file)? {
            self.losses.push(Loss {
                kind: LossKind::DataSection,
                offset: 0,
                bytes: self.file.len(),
                from: None,
                to: None,
            });
        }
        Ok(())
    }
}

fn take_vehicle_file(info: &mut LogInfo) {
    let Some(place) = info.attachments.iter().position(|(name, _)| name == VEHICLE_FILE) else { return };
    let (name, data) = info.attachments.remove(place);
    match String::from_utf8(data) {
        Ok(text) => info.vehicle_toml = Some(text),
        Err(error) => info.attachments.insert(place, (name, error.into_bytes())),
    }
}

fn read_chunk<R: Read + Seek>(
    file: &mut LogFile<R>,
    place: &ChunkPlace,
    batch: &mut Batch,
    channels: &mut Channels,
    found: &mut Vec<LossKind>,
) -> Result<(), LogError> {
    // Definitions are used only after the chunk's checksum has been verified.
    let (mut definitions, mut sound, mut misplaced) = (FoundDefinitions::default(), true, false);
    let unpacked = unpack(file, place, |opcode, body| match opcode {
        op::MESSAGE => sound &= batch.push(body),
        op::SCHEMA | op::CHANNEL => definitions.take(opcode, body),
        // Records of private kinds are skipped. Records of all other kinds don't belong in a chunk.
        opcode => misplaced |= opcode < PRIVATE,
    })?;
    if let Unpacked::Bad(kind) = unpacked {
        batch.clear();
        found.push(match kind {
            LossKind::Compression(name) => LossKind::Compression(quoted(&name)),
            kind => kind,
        });
        return Ok(());
    }
    if !sound {
        found.push(LossKind::Contents);
    }
    if misplaced {
        found.push(LossKind::Misplaced);
    }
    if definitions.beyond {
        found.push(beyond(Many::HeaderBytes));
    }
    for definition in definitions.channels {
        let channel = definition.id;
        match channels.admit(definition) {
            Admission::Known => {}
            Admission::Conflict => found.push(LossKind::Conflict { channel }),
            Admission::Beyond(what) => found.push(beyond(what)),
        }
    }
    Ok(())
}

fn read_run<R: Read + Seek>(file: &mut LogFile<R>, span: &Span, batch: &mut Batch) -> Result<(), LogError> {
    let bytes = file.bytes_at(span.at, span.end - span.at)?;
    let mut fields = Fields::new(&bytes);
    let mut record = || {
        let (opcode, len) = (fields.u8()?, fields.u64()?);
        Some((opcode, fields.take(len)?))
    };
    while let Some((opcode, body)) = record() {
        if opcode == op::MESSAGE {
            batch.push(body);
        }
    }
    Ok(())
}

/// Sets the sort ranks of messages.
///
/// Removes messages of unknown channels, messages with impossible times, and messages that the next part repeats.
fn place_entries(
    batch: &mut Batch,
    channels: &Channels,
    repeated: &BTreeMap<u16, u32>,
    found: &mut Vec<LossKind>,
) {
    let mut unknown: BTreeMap<u16, u64> = BTreeMap::new();
    let (mut messages, mut first) = (0, u64::MAX);
    batch.entries.retain_mut(|entry| {
        // Message numbers wrap at 32 bits, so the comparison is modulo 2^32.
        let is_from = |number: &u32| entry.head.sequence.wrapping_sub(*number) <= u32::MAX / 2;
        if repeated.get(&entry.head.channel).is_some_and(is_from) {
            return false;
        }
        if entry.head.log_time > LATEST.0 {
            messages += 1;
            first = first.min(entry.head.log_time);
            return false;
        }
        let channel = channels.get(entry.head.channel);
        if let Some(channel) = channel {
            entry.rank = channel.rank;
        } else {
            *unknown.entry(entry.head.channel).or_default() += 1;
        }
        channel.is_some()
    });
    if messages > 0 {
        found.push(LossKind::Stamped { messages, first });
    }
    found.extend(
        unknown.into_iter().map(|(channel, messages)| LossKind::UnknownChannel { channel, messages }),
    );
}
