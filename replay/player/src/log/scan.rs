//! Scans a whole log before it is read.
//!
//! The scan finds the positions and times of chunks, channels, attachments, metadata and damage. It skips the data of
//! chunks, so it is quick.

use std::collections::BTreeMap;
use std::io::{Read, Seek};

use headrace_geometry::time::MonoNs;
use mcap::records::op;

use super::channels::{Channels, listed};
use super::chunk::{Unpacked, summary_holds, unpack};
use super::error::LogError;
use super::fields::Fields;
use super::format::{
    ATTACHMENT_PREFIX, CHANNEL_LIST, FORMAT_KEY, FORMAT_VERSION, LOSSES, METADATA, read_loss, unseal,
};
use super::framing::{AttachmentPlace, ChunkPlace, Definition, Found, Frame, Item, LogFile, look, schema};
use super::limits::{
    HeaderBudget, MAX_ATTACHMENT_BYTES, MAX_CHANNELS, MAX_HEADER_BYTES, MAX_PIECES, MAX_SOURCES,
    MAX_UNPACKED_BYTES, MAX_UNPACKED_RATIO, map_cost, quoted, unpacked_limit,
};
use super::loss::{Loss, LossKind, Losses, Many};
use super::search::{find_log, find_records};

/// Approximate size of a piece of messages outside chunks, bytes.
const RUN_BYTES: u64 = 1 << 20;

/// Kind of piece of a log. A piece is the unit in which a log is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Piece {
    /// A chunk. Its header is read again when needed, to save memory: a long dive has a hundred thousand chunks.
    Chunk,
    /// A run of messages outside chunks. Records of other kinds may be between them.
    Run,
}

/// A piece of the log (a chunk, or a run of messages outside chunks), with its range of bytes and its time
/// span.
#[derive(Debug, Clone, Copy)]
pub(super) struct Span {
    pub(super) at: u64,
    pub(super) end: u64,
    pub(super) from: u64,
    pub(super) to: u64,
    pub(super) piece: Piece,
}

/// Result of scanning a log.
#[derive(Default)]
pub(super) struct Scan {
    pub(super) spans: Vec<Span>,
    pub(super) losses: Losses,
    pub(super) attachments: Vec<(String, Vec<u8>)>,
    pub(super) metadata: BTreeMap<String, String>,
    /// Names of the log's schemas, by schema number.
    pub(super) schemas: BTreeMap<u16, String>,
    definitions: BTreeMap<u16, Definition>,
    /// Definitions in the summary. They are used only if the summary's checksum matches.
    summary: BTreeMap<u16, Definition>,
    /// Number of messages and of channels that the summary states.
    summary_counts: Option<(u64, u32)>,
    /// Number of messages stated by a summary whose checksum matches.
    pub(super) messages: Option<u64>,
    data_end: Option<core::ops::Range<u64>>,
    /// Whether this program wrote the log. Such a log has all messages in chunks, numbers its messages, and has a
    /// summary.
    pub(super) ours: bool,
    /// Whether the log has the record that repeats the channel definitions.
    has_list: bool,
    /// Names of attachments that a log of this program lists.
    announced: Vec<String>,
    /// Losses that the log itself states.
    stated: Vec<Loss>,
    /// Range of the footer, and the start of the summary that it states, if the last record was a footer.
    footer: Option<(core::ops::Range<u64>, u64)>,
    /// Whether the next message may be added to the last run of messages outside chunks.
    run_open: bool,
    attachment_bytes: u64,
    /// Number of bytes that the chunks so far unpack to.
    unpacked: u64,
    /// Start and end of the range in which another log was last searched for, because a chunk had earlier times than
    /// its predecessor.
    searched: (u64, u64),
    budget: HeaderBudget,
}

/// Scans a log.
///
/// Errors: the file isn't MCAP, has a later format, or can't be read.
pub(super) fn scan<R: Read + Seek>(file: &mut LogFile<R>) -> Result<(Scan, Channels), LogError> {
    let mut scan = Scan::default();
    let magic_len = mcap::MAGIC.len() as u64;
    let first = file.bytes_at(0, magic_len)?;
    if first != mcap::MAGIC {
        // If only the first bytes of a log are damaged, the log's header record still follows these bytes.
        if !matches!(look(file, magic_len)?, Found::Record(Frame { item: Item::Header { .. }, .. })) {
            let unread = file.medium().has_failed_within(&(0..magic_len)).then(|| unread(file));
            return Err(unread.unwrap_or_else(|| not_mcap(file, &first)));
        }
        scan.lose(LossKind::Framing, 0..magic_len);
    }
    scan.walk(file, magic_len)?;
    scan.check_format(file)?;
    let summarised = scan.take_summary(file)?;
    if !summarised && !scan.has_list || !scan.ours && scan.is_without_schemas() {
        scan.look_into_chunks(file)?;
    }
    scan.miss_parts();
    for failed in file.medium().failed() {
        let kind = LossKind::Unreadable(file.medium().error().to_owned());
        scan.losses.extend(kind, failed.start, failed.end - failed.start);
    }
    date_losses(&mut scan.losses, &scan.spans, false);
    for loss in core::mem::take(&mut scan.stated) {
        scan.losses.push(loss);
    }
    let channels = Channels::new(core::mem::take(&mut scan.definitions), scan.budget);
    if let Some(what) = channels.refused() {
        scan.losses.extend(beyond(what), 0, 0);
    }
    Ok((scan, channels))
}

/// Returns the kind of loss that reports content beyond a limit.
pub(super) fn beyond(what: Many) -> LossKind {
    let limit = match what {
        Many::Pieces => MAX_PIECES as u64,
        Many::Channels => MAX_CHANNELS as u64,
        Many::Sources => MAX_SOURCES as u64,
        Many::HeaderBytes => MAX_HEADER_BYTES,
        Many::AttachmentBytes => MAX_ATTACHMENT_BYTES,
    };
    LossKind::Beyond { what, limit }
}

/// Returns the error for a log whose beginning can't be read.
fn unread<R: Read + Seek>(file: &LogFile<R>) -> LogError {
    let source = std::io::Error::other(file.medium().error().to_owned());
    LogError::Read { name: file.name().to_owned(), offset: 0, source }
}

fn not_mcap<R: Read + Seek>(file: &LogFile<R>, first: &[u8]) -> LogError {
    let spaced = |bytes: &[u8]| bytes.iter().map(|b| format!("{b:02x}")).collect::<Vec<_>>().join(" ");
    LogError::NotMcap { name: file.name().to_owned(), found: spaced(first), wanted: spaced(mcap::MAGIC) }
}

impl Scan {
    fn walk<R: Read + Seek>(&mut self, file: &mut LogFile<R>, start: u64) -> Result<(), LogError> {
        let (mut at, mut found) = (start, look(file, start)?);
        // Start of the latest record before `at`. If this record was cut off, its length may reach into another log.
        let mut last = start;
        loop {
            // Position in the file at which the scan continues after damage.
            let resumed = match found {
                Found::Closing => {
                    let end = at + mcap::MAGIC.len() as u64;
                    self.check_closing(at);
                    if end < file.len() && !self.ends_at_other_log(file, at..end + 1, file.len())? {
                        self.lose(LossKind::Framing, end..file.len());
                    }
                    return Ok(());
                }
                Found::End => {
                    self.lose(LossKind::Truncated, at..at);
                    return Ok(());
                }
                Found::Record(frame) => {
                    let next = look(file, frame.end)?;
                    if is_believed(file, &frame, &next)? {
                        if self.goes_back_into_other_log(file, &frame)? {
                            return Ok(());
                        }
                        (last, at, found) = (at, frame.end, next);
                        self.accept(file, &frame)?;
                        continue;
                    }
                    find_records(file, frame.body, u64::MAX)?
                }
                Found::Cut(Frame { item: Item::Chunk(place), end, .. }) => {
                    if self.ends_at_other_log(file, at..file.len(), at)? {
                        return Ok(());
                    }
                    self.lose(LossKind::Truncated, at..file.len());
                    self.add_chunk(at, end, &place);
                    return Ok(());
                }
                Found::Cut(_) => {
                    let resumed = find_records(file, at + 1, u64::MAX)?;
                    if resumed.is_none() {
                        self.lose(LossKind::Truncated, at..file.len());
                        return Ok(());
                    }
                    resumed
                }
                Found::Nothing => find_records(file, at + 1, u64::MAX)?,
            };
            let until = resumed.unwrap_or(file.len());
            if self.ends_at_other_log(file, last..until, at)? {
                return Ok(());
            }
            self.lose(LossKind::Framing, at..until);
            let Some(resumed) = resumed else { return Ok(()) };
            (last, at, found) = (resumed, resumed, look(file, resumed)?);
        }
    }

    /// Whether a chunk has earlier times than its predecessor because another log begins between them, or within the
    /// predecessor.
    fn goes_back_into_other_log<R: Read + Seek>(
        &mut self,
        file: &mut LogFile<R>,
        frame: &Frame,
    ) -> Result<bool, LogError> {
        let before = self.spans.last().filter(|before| before.is_after(&frame.item)).map(|before| before.at);
        let Some(before) = before else { return Ok(false) };
        // Many chunks may have earlier times than the same chunk. The bytes before such a chunk are searched only once.
        let (start, end) = self.searched;
        let from = if start == before { end } else { before };
        self.searched = (before, frame.at);
        self.ends_at_other_log(file, from..frame.at, frame.at)
    }

    /// Whether another log begins in this range of the file. If so, the other log isn't read, and this log was cut off
    /// at `at`.
    fn ends_at_other_log<R: Read + Seek>(
        &mut self,
        file: &mut LogFile<R>,
        range: core::ops::Range<u64>,
        at: u64,
    ) -> Result<bool, LogError> {
        let Some(other) = find_log(file, range.start, range.end)? else { return Ok(false) };
        if at < other {
            self.lose(LossKind::Truncated, at..other);
        }
        self.lose(LossKind::AnotherLog, other..file.len());
        Ok(true)
    }

    fn accept<R: Read + Seek>(&mut self, file: &mut LogFile<R>, frame: &Frame) -> Result<(), LogError> {
        // A footer is the last record of a log. Here another record follows the footer, so the footer is really a
        // damaged record of another kind.
        if let Some((footer, _)) = self.footer.take() {
            self.lose(LossKind::Framing, footer);
        }
        match &frame.item {
            Item::Message { .. } if self.ours => self.lose(LossKind::Framing, frame.at..frame.end),
            Item::Message { log_time } => self.add_message(frame, *log_time),
            Item::Chunk(place) => self.add_chunk(frame.at, frame.end, place),
            Item::Channel => self.add_channel(file, frame)?,
            Item::Schema => {
                // The content of a schema isn't kept and may be long, so only the beginning is read.
                let body = file.bytes_at(frame.body, (frame.end - frame.body).min(MAX_HEADER_BYTES))?;
                let schema = schema(&mut Fields::new(&body));
                if let Some((number, name)) = schema.filter(|(number, _)| !self.schemas.contains_key(number))
                {
                    self.add_schema(number, name, frame.at..frame.end);
                }
            }
            Item::Metadata => self.add_metadata(file, frame)?,
            Item::Attachment(place) => self.add_attachment(file, frame, place)?,
            Item::UnreadAttachment => {
                self.lose(
                    LossKind::Attachment("(a name too long to be read)".to_owned()),
                    frame.at..frame.end,
                );
            }
            Item::Statistics { messages, channels } => self.summary_counts = Some((*messages, *channels)),
            Item::DataEnd => self.data_end = Some(frame.at..frame.end),
            Item::Header { ours } => self.ours = *ours,
            Item::Footer { summary } => self.footer = Some((frame.at..frame.end, *summary)),
            Item::Other => {}
        }
        Ok(())
    }

    fn add_schema(&mut self, number: u16, name: String, part: core::ops::Range<u64>) {
        if self.budget.take(map_cost(1, name.len() as u64)) {
            self.schemas.insert(number, name);
        } else {
            self.lose_beyond(Many::HeaderBytes, part);
        }
    }

    fn add_message(&mut self, frame: &Frame, log_time: u64) {
        if frame.end - frame.body > MAX_UNPACKED_BYTES {
            self.lose(LossKind::TooLarge { limit: MAX_UNPACKED_BYTES }, frame.at..frame.end);
            return;
        }
        // The length of a run includes the records of other kinds between its messages.
        let within = |last: &&mut Span| self.run_open && frame.end - last.at <= RUN_BYTES;
        let last = self.spans.last_mut().filter(within);
        if let Some(run) = last {
            (run.end, run.from, run.to) = (frame.end, run.from.min(log_time), run.to.max(log_time));
        } else {
            let (at, end) = (frame.at, frame.end);
            self.run_open = self.add_span(Span { at, end, from: log_time, to: log_time, piece: Piece::Run });
        }
    }

    /// Adds a piece of the log. Returns `false` if the log has too many pieces.
    fn add_span(&mut self, span: Span) -> bool {
        let fits = self.spans.len() < MAX_PIECES;
        if fits {
            self.spans.push(span);
        } else {
            self.lose_beyond(Many::Pieces, span.at..span.end);
        }
        fits
    }

    fn add_chunk(&mut self, at: u64, end: u64, place: &ChunkPlace) {
        let (from, to) = place.times;
        // A chunk is counted only if it will be unpacked completely. Chunks over the limit and truncated chunks aren't
        // counted.
        if !place.compression.is_empty() && !place.cut && place.unpacked_len <= MAX_UNPACKED_BYTES {
            let unpacked = self.unpacked.saturating_add(place.unpacked_len);
            if unpacked > unpacked_limit(end) {
                self.run_open = false;
                self.losses.extend(LossKind::Swells { limit: MAX_UNPACKED_RATIO }, at, end - at);
                return;
            }
            self.unpacked = unpacked;
        }
        self.add_span(Span { at, end, from, to, piece: Piece::Chunk });
        self.run_open = false;
    }

    fn add_channel<R: Read + Seek>(&mut self, file: &mut LogFile<R>, frame: &Frame) -> Result<(), LogError> {
        let Some(body) = whole_body(file, frame)? else {
            self.lose_beyond(Many::HeaderBytes, frame.at..frame.end);
            return Ok(());
        };
        let Some(definition) = Definition::read(&mut Fields::new(&body)) else {
            self.lose(LossKind::Framing, frame.at..frame.end);
            return Ok(());
        };
        let id = definition.id;
        let into = if self.data_end.is_some() { &mut self.summary } else { &mut self.definitions };
        match into.get(&id) {
            Some(known) if *known == definition => {}
            Some(_) => self.lose(LossKind::Conflict { channel: id }, frame.at..frame.end),
            None if self.budget.take(definition.cost()) => drop(into.insert(id, definition)),
            None => self.lose_beyond(Many::HeaderBytes, frame.at..frame.end),
        }
        Ok(())
    }

    fn add_metadata<R: Read + Seek>(&mut self, file: &mut LogFile<R>, frame: &Frame) -> Result<(), LogError> {
        let Some(body) = whole_body(file, frame)? else {
            self.lose_beyond(Many::HeaderBytes, frame.at..frame.end);
            return Ok(());
        };
        let mut fields = Fields::new(&body);
        let (Some(name), Some(cost)) = (fields.text(), fields.map_cost()) else {
            self.lose(LossKind::Framing, frame.at..frame.end);
            return Ok(());
        };
        // Each entry is stored together with the name of its metadata record, so the name's memory counts for each
        // entry.
        let names = cost / map_cost(1, 0) * name.len() as u64;
        if !self.budget.take(cost.saturating_add(names)) {
            self.lose_beyond(Many::HeaderBytes, frame.at..frame.end);
            return Ok(());
        }
        let mut entries = fields.map().unwrap_or_default();
        if !unseal(name, &mut entries) {
            self.lose(LossKind::Metadata(quoted(name)), frame.at..frame.end);
        } else if name == CHANNEL_LIST {
            self.has_list = true;
            for definition in listed(&entries) {
                self.definitions.entry(definition.id).or_insert(definition);
            }
            let names = entries.keys().filter_map(|key| key.strip_prefix(ATTACHMENT_PREFIX));
            self.announced.extend(names.map(str::to_owned));
        } else if name == LOSSES {
            self.stated.extend(entries.values().map(|text| {
                let (from, to, words) = read_loss(text);
                Loss { kind: LossKind::Stated(words.to_owned()), offset: frame.at, bytes: 0, from, to }
            }));
        } else if name == METADATA {
            self.metadata.extend(entries);
        } else {
            self.metadata.extend(entries.into_iter().map(|(key, value)| (format!("{name}/{key}"), value)));
        }
        Ok(())
    }

    fn add_attachment<R: Read + Seek>(
        &mut self,
        file: &mut LogFile<R>,
        frame: &Frame,
        place: &AttachmentPlace,
    ) -> Result<(), LogError> {
        self.run_open = false;
        let cost = map_cost(1, place.data_len.saturating_add(place.head_len));
        let used = self.attachment_bytes.saturating_add(cost);
        if used > MAX_ATTACHMENT_BYTES {
            self.lose_beyond(Many::AttachmentBytes, frame.at..frame.end);
            return Ok(());
        }
        self.attachment_bytes = used;
        let body = file.bytes_at(frame.body, place.head_len + place.data_len + 4)?;
        // The `mcap` crate's parser verifies the checksum. It requires consistent lengths, which the framing has
        // checked.
        match mcap::parse_record(op::ATTACHMENT, &body) {
            Ok(mcap::records::Record::Attachment { data, .. }) => {
                self.attachments.push((place.name.clone(), data.into_owned()));
            }
            _ => self.lose(LossKind::Attachment(quoted(&place.name)), frame.at..frame.end),
        }
        Ok(())
    }

    /// Checks whether whole records are missing. The framing can't show missing records, because the remaining records
    /// still adjoin.
    ///
    /// If the end of the file is lost, the closing records are missing. If other records are lost, the summary isn't at
    /// the position that the footer states.
    fn check_closing(&mut self, at: u64) {
        let (Some((_, summary)), Some(data_end)) = (self.footer.take(), self.data_end.clone()) else {
            self.lose(LossKind::Truncated, at..at);
            return;
        };
        if summary == 0 && self.ours {
            // This program always writes a summary. If there is none, the last messages were removed together with
            // the summary.
            self.lose(LossKind::Truncated, at..at);
        }
        if summary != 0 && summary != data_end.end && self.losses.list().is_empty() {
            self.lose(LossKind::Displaced, 0..data_end.start);
        }
    }

    fn check_format<R: Read + Seek>(&self, file: &LogFile<R>) -> Result<(), LogError> {
        let Some(found) = self.metadata.get(FORMAT_KEY) else { return Ok(()) };
        if found.parse().is_ok_and(|format: u32| format <= FORMAT_VERSION) {
            return Ok(());
        }
        Err(LogError::TooNew { name: file.name().to_owned(), found: found.clone(), known: FORMAT_VERSION })
    }

    /// Replaces all channel definitions by those in an intact summary. Returns whether the summary lists all channels.
    ///
    /// A tool that copied a log of this program may have renumbered its channels.
    fn take_summary<R: Read + Seek>(&mut self, file: &mut LogFile<R>) -> Result<bool, LogError> {
        let Some(data_end) = self.data_end.as_ref().map(|record| record.start) else { return Ok(false) };
        if self.summary.is_empty() || !summary_holds(file, data_end)? {
            return Ok(false);
        }
        self.messages = self.summary_counts.map(|(messages, _)| messages);
        let all = self.summary_counts.is_some_and(|(_, count)| self.summary.len() as u64 >= u64::from(count));
        self.definitions.append(&mut self.summary);
        Ok(all)
    }

    /// Whether the schema of any channel hasn't been found yet.
    fn is_without_schemas(&self) -> bool {
        let numbers = self.definitions.values().filter_map(|definition| definition.form.as_ref());
        numbers.map(|(schema, _)| *schema).any(|schema| schema > 0 && !self.schemas.contains_key(&schema))
    }

    /// Searches all chunks for channel definitions. Truncated logs of other writers have definitions nowhere else.
    ///
    /// Definitions in intact chunks take precedence over definitions outside chunks.
    fn look_into_chunks<R: Read + Seek>(&mut self, file: &mut LogFile<R>) -> Result<(), LogError> {
        for number in 0..self.spans.len() {
            let Some(span) = self.spans.get(number).copied() else { break };
            let Some(place) = span.chunk(file)? else { continue };
            let mut found = FoundDefinitions::default();
            let unpacked = unpack(file, &place, |opcode, body| found.take(opcode, body))?;
            if matches!(unpacked, Unpacked::Bad(_)) {
                continue;
            }
            let part = span.at..span.end;
            for (number, name) in found.schemas {
                if !self.schemas.contains_key(&number) {
                    self.add_schema(number, name, part.clone());
                }
            }
            for definition in found.channels {
                self.add_found(definition, unpacked == Unpacked::Whole, part.clone());
            }
        }
        Ok(())
    }

    /// Adds a definition found in a chunk. If the chunk is intact, its definition replaces a known one.
    fn add_found(&mut self, definition: Definition, whole: bool, part: core::ops::Range<u64>) {
        let known = self.definitions.get(&definition.id);
        if known.is_some_and(|known| !whole || *known == definition) {
            return;
        }
        self.budget.give_back(known.map_or(0, Definition::cost));
        if self.budget.take(definition.cost()) {
            self.definitions.insert(definition.id, definition);
        } else {
            self.lose_beyond(Many::HeaderBytes, part);
        }
    }

    /// Reports missing records that a log of this program must have, if no other loss has been found.
    fn miss_parts(&mut self) {
        if !self.ours || !self.losses.list().is_empty() {
            return;
        }
        for name in core::mem::take(&mut self.announced) {
            if self.attachments.iter().all(|(other, _)| *other != name) {
                self.lose(LossKind::Attachment(name), 0..0);
            }
        }
        for (name, there) in
            [(METADATA, self.metadata.contains_key(FORMAT_KEY)), (CHANNEL_LIST, self.has_list)]
        {
            if !there {
                self.lose(LossKind::Metadata(name.to_owned()), 0..0);
            }
        }
    }

    fn lose_beyond(&mut self, what: Many, part: core::ops::Range<u64>) {
        self.run_open = false;
        self.losses.extend(beyond(what), part.start, part.end.saturating_sub(part.start));
    }

    fn lose(&mut self, kind: LossKind, part: core::ops::Range<u64>) {
        self.run_open = false;
        let bytes = part.end.saturating_sub(part.start);
        self.losses.push(Loss { kind, offset: part.start, bytes, from: None, to: None });
    }
}

/// Sets the times of losses from the pieces of the log around them.
///
/// If `read` is true, all pieces have been read, and their times are the times of their messages. Before reading, the
/// times come from chunk headers, which may be wrong.
pub(super) fn date_losses(losses: &mut Losses, spans: &[Span], read: bool) {
    for loss in losses.list_mut().iter_mut().filter(|loss| !matches!(loss.kind, LossKind::Stated(_))) {
        let next = spans.partition_point(|span| span.at < loss.offset);
        let end = loss.offset.saturating_add(loss.bytes.max(1));
        let after = spans.iter().skip(next).find(|span| span.at >= end && span.is_dated());
        // The file may end within a chunk that has delivered messages. The loss begins after these messages.
        let cut = usize::from(read && loss.kind == LossKind::Truncated);
        let cut = spans.get(next..).and_then(|rest| rest.get(..cut)).unwrap_or_default();
        let before = spans.iter().take(next).chain(cut).rev().find(|span| span.is_dated());
        (loss.from, loss.to) = (before.map(|span| MonoNs(span.to)), after.map(|span| MonoNs(span.from)));
    }
}

/// Whether a record's length is trusted: the record's fields confirm it, or another record follows.
///
/// If the end of the file cuts off the following record, the length is trusted only if no records begin within the
/// range that this length covers.
fn is_believed<R: Read + Seek>(file: &mut LogFile<R>, frame: &Frame, next: &Found) -> Result<bool, LogError> {
    let followed = !matches!(next, Found::Nothing);
    Ok(match next {
        _ if frame.confirmed => true,
        Found::Cut(next) if !matches!(next.item, Item::Chunk(_)) => {
            find_records(file, frame.body, frame.end)?.is_none()
        }
        _ => followed,
    })
}

impl Span {
    /// Whether an item is a chunk whose first message is earlier than the first message of this piece.
    fn is_after(&self, item: &Item) -> bool {
        matches!(item, Item::Chunk(place) if place.times.0 < self.from)
    }

    /// Reads the chunk's header; `None` for a run of messages outside chunks.
    pub(super) fn chunk<R: Read + Seek>(
        &self,
        file: &mut LogFile<R>,
    ) -> Result<Option<ChunkPlace>, LogError> {
        if self.piece == Piece::Run {
            return Ok(None);
        }
        Ok(match look(file, self.at)? {
            Found::Record(Frame { item: Item::Chunk(place), .. })
            | Found::Cut(Frame { item: Item::Chunk(place), .. }) => Some(place),
            _ => None,
        })
    }

    /// Whether the piece of the log has times. A chunk without messages has none: both times are 0.
    pub(super) fn is_dated(&self) -> bool {
        (self.from, self.to) != (0, 0)
    }
}

/// Definitions found in a chunk, up to the memory limit for all definitions of a log.
#[derive(Default)]
pub(super) struct FoundDefinitions {
    pub(super) channels: Vec<Definition>,
    pub(super) schemas: Vec<(u16, String)>,
    budget: HeaderBudget,
    /// Whether definitions were dropped because of the memory limit.
    pub(super) beyond: bool,
}

impl FoundDefinitions {
    /// Stores a record of the chunk if it is a definition.
    pub(super) fn take(&mut self, opcode: u8, body: &[u8]) {
        match opcode {
            op::CHANNEL => {
                if let Some(definition) = Definition::read(&mut Fields::new(body)) {
                    let fits = self.budget.take(definition.cost());
                    self.beyond |= !fits;
                    self.channels.extend(Some(definition).filter(|_| fits));
                }
            }
            op::SCHEMA => {
                let schema = schema(&mut Fields::new(body));
                let kept = schema.filter(|(_, name)| self.budget.take(map_cost(1, name.len() as u64)));
                self.schemas.extend(kept);
            }
            _ => (),
        }
    }
}

/// Reads the whole body of a record; `None` if it is longer than allowed.
fn whole_body<R: Read + Seek>(file: &mut LogFile<R>, frame: &Frame) -> Result<Option<Vec<u8>>, LogError> {
    let len = frame.end - frame.body;
    if len > MAX_HEADER_BYTES { Ok(None) } else { file.bytes_at(frame.body, len).map(Some) }
}
