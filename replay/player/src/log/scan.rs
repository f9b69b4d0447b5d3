//! Scans a whole log before it is read: positions and times of chunks, channels, attachments, metadata, and damage.
//! Chunk data is skipped, so the scan is quick.

use std::collections::BTreeMap;
use std::io::{Read, Seek};

use headrace_geometry::time::MonoNs;

use super::channels::{Channels, listed};
use super::chunk::{Unpacked, summary_holds, unpack};
use super::fields::Fields;
use super::format::{
    ATTACHMENT_PREFIX, CHANNEL_LIST, FORMAT_KEY, FORMAT_VERSION, LOSSES, METADATA, read_loss, unseal,
};
use super::framing::{AttachmentPlace, ChunkPlace, Definition, Found, Frame, Item, LogFile, look, schema};
use super::loss::Losses;
use super::search::find_records;
use super::{LogError, Loss, LossKind};

/// Messages outside chunks are read in pieces of about this size, bytes.
const RUN_BYTES: u64 = 1 << 20;
/// Definitions and metadata longer than this aren't read, bytes.
const MAX_WHOLE_BYTES: u64 = 16 << 20;
/// Limit of all attachments together, bytes.
const MAX_ATTACHMENT_BYTES: u64 = 64 << 20;

/// A unit of reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Piece {
    /// Its header is read again when needed: a long dive has a hundred thousand chunks of half a second each.
    Chunk,
    /// Messages outside chunks, with records of other kinds between them.
    Run,
}

/// A piece with its byte range and time span.
#[derive(Debug, Clone, Copy)]
pub(super) struct Span {
    pub(super) at: u64,
    pub(super) end: u64,
    pub(super) from: u64,
    pub(super) to: u64,
    pub(super) piece: Piece,
}

/// Result of the scan.
#[derive(Default)]
pub(super) struct Scan {
    pub(super) spans: Vec<Span>,
    pub(super) losses: Losses,
    pub(super) attachments: Vec<(String, Vec<u8>)>,
    pub(super) metadata: BTreeMap<String, String>,
    /// Names of schemas by their numbers.
    pub(super) schemas: BTreeMap<u16, String>,
    definitions: BTreeMap<u16, Definition>,
    /// Definitions in the summary, which count only if its checksum fits.
    summary: BTreeMap<u16, Definition>,
    summary_channels: Option<u32>,
    data_end: Option<core::ops::Range<u64>>,
    /// Whether it is one of our logs, which have no messages outside chunks.
    ours: bool,
    /// Whether it has the record that repeats its channels.
    has_list: bool,
    /// Attachments listed by a log of ours.
    announced: Vec<String>,
    /// Losses stated by the log itself.
    stated: Vec<Loss>,
    /// The last record if that was the footer, and the start of the summary according to it.
    footer: Option<(core::ops::Range<u64>, u64)>,
    /// Whether the next message may be appended to the last run.
    run_open: bool,
    attachment_bytes: u64,
}

/// Scans a log.
///
/// Errors: not MCAP, of a later format, or an I/O error.
pub(super) fn scan<R: Read + Seek>(file: &mut LogFile<R>) -> Result<(Scan, Channels), LogError> {
    let mut scan = Scan::default();
    let magic_len = mcap::MAGIC.len() as u64;
    let first = file.bytes_at(0, magic_len)?;
    if first != mcap::MAGIC {
        // A log whose first bytes are damaged still has its header record after them.
        if !matches!(look(file, magic_len)?, Found::Record(Frame { item: Item::Header { .. }, .. })) {
            return Err(not_mcap(file, &first));
        }
        scan.lose(LossKind::Framing, 0..magic_len);
    }
    scan.walk(file, magic_len)?;
    scan.check_format(file)?;
    let summarised = scan.take_summary(file)?;
    if !summarised && !scan.has_list || !scan.ours && scan.lacks_schemas() {
        scan.look_into_chunks(file)?;
    }
    scan.miss_parts();
    date_losses(&mut scan.losses, &scan.spans, false);
    for loss in core::mem::take(&mut scan.stated) {
        scan.losses.push(loss);
    }
    let channels = Channels::new(core::mem::take(&mut scan.definitions));
    Ok((scan, channels))
}

fn not_mcap<R: Read + Seek>(file: &LogFile<R>, first: &[u8]) -> LogError {
    let spaced = |bytes: &[u8]| bytes.iter().map(|b| format!("{b:02x}")).collect::<Vec<_>>().join(" ");
    LogError::NotMcap { name: file.name().to_owned(), found: spaced(first), wanted: spaced(mcap::MAGIC) }
}

impl Scan {
    fn walk<R: Read + Seek>(&mut self, file: &mut LogFile<R>, start: u64) -> Result<(), LogError> {
        let (mut at, mut found) = (start, look(file, start)?);
        loop {
            // Where to continue after damage.
            let resumed = match found {
                Found::Closing => {
                    let end = at + mcap::MAGIC.len() as u64;
                    self.check_closing(at);
                    if end < file.len() {
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
                        (at, found) = (frame.end, next);
                        self.accept(file, &frame)?;
                        continue;
                    }
                    find_records(file, frame.body, u64::MAX)?
                }
                Found::Cut(Frame { item: Item::Chunk(place), end, .. }) => {
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
            self.lose(LossKind::Framing, at..resumed.unwrap_or(file.len()));
            let Some(resumed) = resumed else { return Ok(()) };
            (at, found) = (resumed, look(file, resumed)?);
        }
    }

    fn accept<R: Read + Seek>(&mut self, file: &mut LogFile<R>, frame: &Frame) -> Result<(), LogError> {
        // Nothing follows a footer: that one was a damaged record of another kind.
        if let Some((footer, _)) = self.footer.take() {
            self.lose(LossKind::Framing, footer);
        }
        match &frame.item {
            Item::Message { .. } if self.ours => self.lose(LossKind::Framing, frame.at..frame.end),
            Item::Message { log_time } => self.add_message(frame, *log_time),
            Item::Chunk(place) => self.add_chunk(frame.at, frame.end, place),
            Item::Channel => self.add_channel(file, frame)?,
            Item::Schema => {
                let body = whole_body(file, frame)?;
                self.schemas.extend(body.and_then(|body| schema(&mut Fields::new(&body))));
            }
            Item::Metadata => self.add_metadata(file, frame)?,
            Item::Attachment(place) => self.add_attachment(file, frame, place)?,
            Item::UnreadAttachment => {
                self.lose(
                    LossKind::Attachment("(a name too long to be read)".to_owned()),
                    frame.at..frame.end,
                );
            }
            Item::Statistics { channels } => self.summary_channels = Some(*channels),
            Item::DataEnd => self.data_end = Some(frame.at..frame.end),
            Item::Header { ours } => self.ours = *ours,
            Item::Footer { summary } => self.footer = Some((frame.at..frame.end, *summary)),
            Item::Other => {}
        }
        Ok(())
    }

    fn add_message(&mut self, frame: &Frame, log_time: u64) {
        let last = self.spans.last_mut().filter(|last| self.run_open && last.end - last.at < RUN_BYTES);
        if let Some(run) = last {
            (run.end, run.from, run.to) = (frame.end, run.from.min(log_time), run.to.max(log_time));
        } else {
            let (at, end) = (frame.at, frame.end);
            self.spans.push(Span { at, end, from: log_time, to: log_time, piece: Piece::Run });
            self.run_open = true;
        }
    }

    fn add_chunk(&mut self, at: u64, end: u64, place: &ChunkPlace) {
        let (from, to) = place.times;
        self.spans.push(Span { at, end, from, to, piece: Piece::Chunk });
        self.run_open = false;
    }

    fn add_channel<R: Read + Seek>(&mut self, file: &mut LogFile<R>, frame: &Frame) -> Result<(), LogError> {
        let body = whole_body(file, frame)?;
        let Some(definition) = body.and_then(|body| Definition::read(&mut Fields::new(&body))) else {
            self.lose(LossKind::Framing, frame.at..frame.end);
            return Ok(());
        };
        let id = definition.id;
        let into = if self.data_end.is_some() { &mut self.summary } else { &mut self.definitions };
        if *into.entry(id).or_insert_with(|| definition.clone()) != definition {
            self.lose(LossKind::Conflict { channel: id }, frame.at..frame.end);
        }
        Ok(())
    }

    fn add_metadata<R: Read + Seek>(&mut self, file: &mut LogFile<R>, frame: &Frame) -> Result<(), LogError> {
        let body = whole_body(file, frame)?.unwrap_or_default();
        let mut fields = Fields::new(&body);
        let (Some(name), Some(mut entries)) = (fields.text(), fields.map()) else {
            self.lose(LossKind::Framing, frame.at..frame.end);
            return Ok(());
        };
        if !unseal(name, &mut entries) {
            self.lose(LossKind::Metadata(name.to_owned()), frame.at..frame.end);
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
        self.attachment_bytes = self.attachment_bytes.saturating_add(place.data_len);
        if self.attachment_bytes > MAX_ATTACHMENT_BYTES {
            self.attachment_bytes -= place.data_len;
            self.lose(LossKind::TooLarge { limit: MAX_ATTACHMENT_BYTES }, frame.at..frame.end);
            return Ok(());
        }
        let body = file.bytes_at(frame.body, place.head_len + place.data_len + 4)?;
        // The crate's parser checks the checksum. It requires consistent lengths, which the framing has verified.
        match mcap::parse_record(mcap::records::op::ATTACHMENT, &body) {
            Ok(mcap::records::Record::Attachment { data, .. }) => {
                self.attachments.push((place.name.clone(), data.into_owned()));
            }
            _ => self.lose(LossKind::Attachment(place.name.clone()), frame.at..frame.end),
        }
        Ok(())
    }

    /// Missing whole records leave no gap. If the end of the file is lost, so are the closing records; if records are lost
    /// elsewhere, the summary doesn't begin where the footer says.
    fn check_closing(&mut self, at: u64) {
        let (Some((_, summary)), Some(data_end)) = (self.footer.take(), self.data_end.clone()) else {
            self.lose(LossKind::Truncated, at..at);
            return;
        };
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

    /// Takes the channels of an intact summary in preference to all others: a tool that copied a log of ours may have
    /// renumbered them. Returns whether these are all.
    fn take_summary<R: Read + Seek>(&mut self, file: &mut LogFile<R>) -> Result<bool, LogError> {
        let Some(data_end) = self.data_end.as_ref().map(|record| record.start) else { return Ok(false) };
        if self.summary.is_empty() || !summary_holds(file, data_end)? {
            return Ok(false);
        }
        let all = self.summary_channels.is_some_and(|count| self.summary.len() as u64 >= u64::from(count));
        self.definitions.append(&mut self.summary);
        Ok(all)
    }

    /// Whether a channel's schema hasn't been found yet.
    fn lacks_schemas(&self) -> bool {
        let numbers = self.definitions.values().filter_map(|definition| definition.form.as_ref());
        numbers.map(|(schema, _)| *schema).any(|schema| schema > 0 && !self.schemas.contains_key(&schema))
    }

    /// Reads all chunks for channel definitions, for truncated logs of other writers. Definitions in intact chunks take
    /// precedence over those outside.
    fn look_into_chunks<R: Read + Seek>(&mut self, file: &mut LogFile<R>) -> Result<(), LogError> {
        for span in &self.spans {
            let Some(place) = span.chunk(file)? else { continue };
            let (mut defined, mut schemas) = (Vec::new(), Vec::new());
            let unpacked = unpack(file, &place, |opcode, body| match opcode {
                mcap::records::op::CHANNEL => defined.extend(Definition::read(&mut Fields::new(body))),
                mcap::records::op::SCHEMA => schemas.extend(schema(&mut Fields::new(body))),
                _ => (),
            })?;
            if !matches!(unpacked, Unpacked::Bad(_)) {
                self.schemas.extend(schemas);
            }
            for definition in defined {
                match unpacked {
                    Unpacked::Whole => drop(self.definitions.insert(definition.id, definition)),
                    Unpacked::Cut => drop(self.definitions.entry(definition.id).or_insert(definition)),
                    Unpacked::Bad(_) => {}
                }
            }
        }
        Ok(())
    }

    /// Reports expected records missing from a log of ours, if no other loss has been found.
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

    fn lose(&mut self, kind: LossKind, part: core::ops::Range<u64>) {
        self.run_open = false;
        let bytes = part.end.saturating_sub(part.start);
        self.losses.push(Loss { kind, offset: part.start, bytes, from: None, to: None });
    }
}

/// Sets the time spans of losses from the pieces around them. Chunk headers may have wrong times; once all pieces
/// are `read`, the times are those of their messages.
pub(super) fn date_losses(losses: &mut Losses, spans: &[Span], read: bool) {
    for loss in losses.list_mut().iter_mut().filter(|loss| !matches!(loss.kind, LossKind::Stated(_))) {
        let next = spans.partition_point(|span| span.at < loss.offset);
        let end = loss.offset.saturating_add(loss.bytes.max(1));
        let after = spans.iter().skip(next).find(|span| span.at >= end && span.is_dated());
        // A chunk cut by the end of the file may have delivered messages nevertheless: the loss begins after them.
        let cut = usize::from(read && loss.kind == LossKind::Truncated);
        let cut = spans.get(next..).and_then(|rest| rest.get(..cut)).unwrap_or_default();
        let before = spans.iter().take(next).chain(cut).rev().find(|span| span.is_dated());
        (loss.from, loss.to) = (before.map(|span| MonoNs(span.to)), after.map(|span| MonoNs(span.from)));
    }
}

/// Whether a record's length is trusted: if confirmed by its fields, or if another record follows. Where the file's end cuts
/// the following record, the length is wrong if there are records within it.
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
    /// The chunk, from its header; `None` for a run.
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

    /// Whether its times are valid: a chunk without messages has none.
    pub(super) fn is_dated(&self) -> bool {
        (self.from, self.to) != (0, 0)
    }
}

/// A whole record, unless it is too long to be read.
fn whole_body<R: Read + Seek>(file: &mut LogFile<R>, frame: &Frame) -> Result<Option<Vec<u8>>, LogError> {
    let len = frame.end - frame.body;
    if len > MAX_WHOLE_BYTES { Ok(None) } else { file.bytes_at(frame.body, len).map(Some) }
}
