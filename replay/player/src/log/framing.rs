//! Finds record boundaries in a file that may be damaged.
//!
//! A record consists of an opcode, a u64 length and that many bytes, without a start marker. A wrong length therefore
//! loses everything after it. Three checks detect a wrong length. First, most kinds of records imply their length
//! twice, by record length and field lengths. Second, a length must leave room for the next record. Third, a record
//! must follow.
//!
//! Source: MCAP format specification, "Records".

use std::collections::BTreeMap;
use std::io::{BufReader, Read, Seek};

use mcap::records::op;
use serde::{Deserialize, Serialize};

use super::LogError;
use super::fields::{Fields, MessageHead};
use super::format::LIBRARY;
use super::limits::map_cost;
use super::medium::Medium;

/// Greatest plausible length of a record other than a chunk or attachment; a greater one counts as damage.
const MAX_RECORD_BYTES: u64 = 256 << 20;
/// Opcode and length.
const RECORD_HEAD_BYTES: usize = 9;
/// Bytes of a record that are read to identify it: fields of fixed length, and names.
const GLANCE_BYTES: usize = 1024;
/// Bytes of a chunk record before its data, without the name of the compression.
const CHUNK_HEAD_BYTES: u64 = 40;

/// Random access to a log's bytes.
pub(super) struct LogFile<R> {
    input: BufReader<Medium<R>>,
    at: u64,
    name: String,
}

impl<R: Read + Seek> LogFile<R> {
    pub(super) fn new(input: R, name: String) -> Result<Self, LogError> {
        let medium = Medium::new(input);
        let medium = medium.map_err(|source| LogError::Read { name: name.clone(), offset: 0, source })?;
        Ok(Self { input: BufReader::new(medium), at: 0, name })
    }

    pub(super) fn len(&self) -> u64 {
        self.medium().len()
    }

    /// The file's medium.
    pub(super) fn medium(&self) -> &Medium<R> {
        self.input.get_ref()
    }

    pub(super) fn name(&self) -> &str {
        &self.name
    }

    /// Reads from `at` until `into` is full or the file ends; returns the number of bytes.
    ///
    /// Bytes that the medium fails to read become zeros.
    pub(super) fn read_at(&mut self, at: u64, into: &mut [u8]) -> Result<usize, LogError> {
        let mut done = 0;
        let mut read = || {
            let distance = i128::from(at) - i128::from(self.at);
            self.input.seek_relative(i64::try_from(distance).map_err(std::io::Error::other)?)?;
            self.at = at;
            while let Some(rest) = into.get_mut(done..).filter(|rest| !rest.is_empty()) {
                match self.input.read(rest) {
                    Ok(0) => break,
                    Ok(more) => (done, self.at) = (done + more, self.at + more as u64),
                    Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
                    Err(error) => return Err(error),
                }
            }
            Ok(())
        };
        read().map_err(|source| LogError::Read { name: self.name.clone(), offset: at, source })?;
        Ok(done)
    }

    /// Up to `len` bytes at `at`, fewer at the end of the file. The caller bounds `len`.
    pub(super) fn bytes_at(&mut self, at: u64, len: u64) -> Result<Vec<u8>, LogError> {
        let len = len.min(self.len().saturating_sub(at));
        let mut bytes = vec![0; usize::try_from(len).unwrap_or(0)];
        let done = self.read_at(at, &mut bytes)?;
        bytes.truncate(done);
        Ok(bytes)
    }
}

/// A channel's definition.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Definition {
    pub(super) id: u16,
    pub(super) topic: String,
    pub(super) metadata: BTreeMap<String, String>,
    /// Schema and message encoding, for logs of other writers. This program's logs neither need nor repeat them.
    pub(super) form: Option<(u16, String)>,
}

/// Compares the fields that the log's channel list contains; `form` is left out.
impl PartialEq for Definition {
    fn eq(&self, other: &Self) -> bool {
        (self.id, &self.topic, &self.metadata) == (other.id, &other.topic, &other.metadata)
    }
}

impl Eq for Definition {}

impl Definition {
    pub(super) fn read(fields: &mut Fields<'_>) -> Option<Self> {
        let (id, schema) = (fields.u16()?, fields.u16()?);
        let (topic, encoding) = (fields.text()?, fields.text()?);
        let form = Some((schema, encoding.to_owned()));
        Some(Self { id, topic: topic.to_owned(), metadata: fields.map()?, form })
    }

    /// Memory of the definition, see [`map_cost`].
    pub(super) fn cost(&self) -> u64 {
        let form = self.form.as_ref().map_or(0, |(_, encoding)| encoding.len());
        let texts = self.metadata.iter().map(|(key, value)| key.len() + value.len());
        let bytes = self.topic.len() + form + texts.sum::<usize>();
        map_cost(self.metadata.len() as u64 + 1, bytes as u64)
    }
}

/// Parses the number and name of a schema.
pub(super) fn schema(fields: &mut Fields<'_>) -> Option<(u16, String)> {
    Some((fields.u16()?, fields.text()?.to_owned()))
}

/// A chunk: position of its data and fields of its header.
#[derive(Debug, Clone)]
pub(super) struct ChunkPlace {
    pub(super) data: u64,
    pub(super) data_len: u64,
    pub(super) unpacked_len: u64,
    pub(super) crc: u32,
    pub(super) compression: String,
    /// First and last log time of its messages; both 0 if there are none.
    pub(super) times: (u64, u64),
    /// Whether the file ends within it.
    pub(super) cut: bool,
    /// Whether its header is damaged: the lengths of its fields contradict the record length.
    pub(super) doubtful: bool,
}

/// An attachment: position of its data and fields of its header.
#[derive(Debug, Clone)]
pub(super) struct AttachmentPlace {
    pub(super) name: String,
    /// Bytes of the record before the data.
    pub(super) head_len: u64,
    pub(super) data_len: u64,
}

/// Kind of record, with the fields that framing and index need.
#[derive(Debug, Clone)]
pub(super) enum Item {
    Header {
        ours: bool,
    },
    Schema,
    Channel,
    Message {
        log_time: u64,
    },
    Chunk(ChunkPlace),
    Attachment(AttachmentPlace),
    /// An attachment whose names are too long to be read.
    UnreadAttachment,
    Metadata,
    Statistics {
        messages: u64,
        channels: u32,
    },
    DataEnd,
    /// Start of the summary according to the footer; 0 where there is none.
    Footer {
        summary: u64,
    },
    Other,
}

/// A record and its position.
#[derive(Debug, Clone)]
pub(super) struct Frame {
    pub(super) at: u64,
    pub(super) body: u64,
    pub(super) end: u64,
    pub(super) item: Item,
    /// Whether the lengths of its fields confirm the record length.
    pub(super) confirmed: bool,
}

/// Content at a position.
#[derive(Debug)]
pub(super) enum Found {
    /// A record that lies within the file.
    Record(Frame),
    /// A record that the end of the file cuts off, or whose length is wrong.
    Cut(Frame),
    /// The closing magic bytes.
    Closing,
    /// The end of the file.
    End,
    /// No record starts here.
    Nothing,
}

/// Identifies the content at `at`.
pub(super) fn look<R: Read + Seek>(file: &mut LogFile<R>, at: u64) -> Result<Found, LogError> {
    let mut head = [0; RECORD_HEAD_BYTES];
    let got = file.read_at(at, &mut head)?;
    let body = at.saturating_add(RECORD_HEAD_BYTES as u64);
    let frame = |end, item, confirmed| Frame { at, body, end, item, confirmed };
    if got == 0 {
        return Ok(Found::End);
    }
    if head.starts_with(mcap::MAGIC) {
        return Ok(Found::Closing);
    }
    if got < head.len() {
        return Ok(Found::Cut(frame(file.len(), Item::Other, false)));
    }
    let (opcode, len) = record_head(head);
    if !is_possible(opcode, len) {
        return Ok(Found::Nothing);
    }
    let mut glance = [0; GLANCE_BYTES];
    // A chunk is examined whatever length it claims, since it implies a second one.
    let wanted = if opcode == op::CHUNK { u64::MAX } else { len };
    let wanted = usize::try_from(wanted).unwrap_or(usize::MAX).min(GLANCE_BYTES);
    let got = file.read_at(body, glance.get_mut(..wanted).unwrap_or_default())?;
    let end = body.saturating_add(len);
    let glance = glance.get(..got).unwrap_or_default();
    let parsed = parse(opcode, body, glance);
    let item = match parsed {
        Some((Item::Chunk(place), _)) => {
            return look_at_chunk(file, frame(end, Item::Other, false), place);
        }
        // A message's data has no length field.
        Some((item, inner_len)) if inner_len == len && opcode != op::MESSAGE => {
            return Ok(whole_or_cut(file, frame(end, item, true)));
        }
        _ if let Some(item) = disguised(opcode, body, glance, len) => {
            return Ok(whole_or_cut(file, frame(end, item, true)));
        }
        Some((item, inner_len)) if inner_len <= len && !is_reserved(opcode) => item,
        None if got < wanted => return Ok(Found::Cut(frame(file.len(), Item::Other, false))),
        None if wanted == GLANCE_BYTES && opcode != op::CHUNK => unread(opcode),
        _ => return Ok(Found::Nothing),
    };
    Ok(whole_or_cut(file, frame(end, item, false)))
}

/// Identifies a record whose opcode is damaged by its content.
fn disguised(opcode: u8, body: u64, glance: &[u8], len: u64) -> Option<Item> {
    // A message may contain any bytes, but it is no coincidence if they parse as a chunk with matching lengths.
    let kinds: &[u8] =
        if opcode == op::MESSAGE { &[op::CHUNK] } else { &[op::CHUNK, op::ATTACHMENT, op::METADATA] };
    kinds
        .iter()
        .find_map(|kind| parse(*kind, body, glance).filter(|(_, inner_len)| *inner_len == len))
        .map(|it| it.0)
}

/// Whether an opcode is reserved by MCAP and still unused. Damage easily produces these.
fn is_reserved(opcode: u8) -> bool {
    (op::DATA_END + 1..0x80).contains(&opcode)
}

/// The item of a record whose names are longer than [`GLANCE_BYTES`].
fn unread(opcode: u8) -> Item {
    match opcode {
        op::SCHEMA => Item::Schema,
        op::CHANNEL => Item::Channel,
        op::METADATA => Item::Metadata,
        op::ATTACHMENT => Item::UnreadAttachment,
        _ => Item::Other,
    }
}

fn record_head(head: [u8; RECORD_HEAD_BYTES]) -> (u8, u64) {
    let [opcode, len @ ..] = head;
    (opcode, u64::from_le_bytes(len))
}

/// Whether a record of that kind can have that length.
fn is_possible(opcode: u8, len: u64) -> bool {
    opcode != 0 && (len <= MAX_RECORD_BYTES || matches!(opcode, op::CHUNK | op::ATTACHMENT))
}

fn whole_or_cut<R: Read + Seek>(file: &LogFile<R>, frame: Frame) -> Found {
    if frame.end <= file.len() { Found::Record(frame) } else { Found::Cut(frame) }
}

/// Identifies a chunk, which implies its length twice.
///
/// If the two lengths differ, the one followed by a record is right. If both are the largest u64, its writer had not
/// closed the chunk.
fn look_at_chunk<R: Read + Seek>(
    file: &mut LogFile<R>,
    mut frame: Frame,
    mut place: ChunkPlace,
) -> Result<Found, LogError> {
    let end = place.data.saturating_add(place.data_len);
    let unclosed = place.data_len == u64::MAX;
    frame.confirmed = end == frame.end && (unclosed || end < u64::MAX);
    if !frame.confirmed {
        if record_follows(file, end)? {
            (frame.end, frame.confirmed) = (end, true);
        } else if end > frame.end || !record_follows(file, frame.end)? {
            return Ok(Found::Nothing);
        } else {
            (place.data_len, place.doubtful) = (frame.end.saturating_sub(place.data), true);
        }
    }
    if frame.end > file.len() {
        place.cut = true;
        place.data_len = file.len().saturating_sub(place.data);
    }
    frame.item = Item::Chunk(place);
    Ok(whole_or_cut(file, frame))
}

/// Whether the bytes at `at` could be a record's header, or the file ends there.
fn record_follows<R: Read + Seek>(file: &mut LogFile<R>, at: u64) -> Result<bool, LogError> {
    if at >= file.len() {
        return Ok(at == file.len());
    }
    let mut head = [0; RECORD_HEAD_BYTES];
    let whole = file.read_at(at, &mut head)? == head.len();
    let (opcode, len) = record_head(head);
    Ok(whole && opcode <= op::DATA_END && is_possible(opcode, len) && len <= file.len() - at)
}

/// Parses the needed fields of a record, and the least length that its fields imply.
fn parse(opcode: u8, body: u64, bytes: &[u8]) -> Option<(Item, u64)> {
    let mut fields = Fields::new(bytes);
    let item = match opcode {
        op::HEADER => {
            let (_profile, library) = (fields.text()?, fields.text()?);
            Item::Header { ours: library.starts_with(LIBRARY) }
        }
        op::FOOTER => {
            let summary = fields.u64()?;
            let _offsets_checksum = fields.take(12)?;
            Item::Footer { summary }
        }
        op::SCHEMA => {
            let _id_name_encoding = (fields.u16()?, fields.text()?, fields.text()?);
            return with_list(fields, Item::Schema);
        }
        op::CHANNEL => {
            let _ids_topic_encoding = (fields.u32()?, fields.text()?, fields.text()?);
            return with_list(fields, Item::Channel);
        }
        op::MESSAGE => Item::Message { log_time: MessageHead::read(&mut fields)?.log_time },
        op::CHUNK => {
            let place = chunk_place(&mut fields, body)?;
            let len = fields.taken().saturating_add(place.data_len);
            return Some((Item::Chunk(place), len));
        }
        op::MESSAGE_INDEX => {
            let _channel = fields.u16()?;
            return with_list(fields, Item::Other);
        }
        op::ATTACHMENT => {
            let place = attachment_place(&mut fields)?;
            // An attachment of almost 2^64 bytes is damaged rather than a record of another kind.
            let len = place.head_len.saturating_add(place.data_len).saturating_add(4);
            return Some((Item::Attachment(place), len));
        }
        op::STATISTICS => {
            let (messages, _schemas, channels) = (fields.u64()?, fields.u16()?, fields.u32()?);
            let _other_counts_and_times = fields.take(28)?;
            return with_list(fields, Item::Statistics { messages, channels });
        }
        op::CHUNK_INDEX => {
            let _times_and_place = fields.take(32)?;
            let indexes_len = fields.u32()?;
            fields.take(u64::from(indexes_len) + 8)?;
            let (_compression, _lengths) = (fields.text()?, fields.take(16)?);
            Item::Other
        }
        op::ATTACHMENT_INDEX => {
            let _numbers_name_type = (fields.take(40)?, fields.text()?, fields.text()?);
            Item::Other
        }
        op::METADATA_INDEX => {
            let _place_name = (fields.take(16)?, fields.text()?);
            Item::Other
        }
        op::SUMMARY_OFFSET => {
            fields.take(17)?;
            Item::Other
        }
        op::METADATA => {
            let _name = fields.text()?;
            return with_list(fields, Item::Metadata);
        }
        op::DATA_END => {
            fields.u32()?;
            Item::DataEnd
        }
        _ => Item::Other,
    };
    Some((item, fields.taken()))
}

/// The item, with the record length implied by a trailing length-prefixed list.
fn with_list(mut fields: Fields<'_>, item: Item) -> Option<(Item, u64)> {
    let len = fields.u32()?;
    Some((item, fields.taken() + u64::from(len)))
}

fn chunk_place(fields: &mut Fields<'_>, body: u64) -> Option<ChunkPlace> {
    let times = (fields.u64()?, fields.u64()?);
    let (unpacked_len, crc, compression) = (fields.u64()?, fields.u32()?, fields.text()?);
    Some(ChunkPlace {
        compression: compression.to_owned(),
        data_len: fields.u64()?,
        data: body + CHUNK_HEAD_BYTES + compression.len() as u64,
        unpacked_len,
        crc,
        times: (times.0.min(times.1), times.0.max(times.1)),
        cut: false,
        doubtful: false,
    })
}

fn attachment_place(fields: &mut Fields<'_>) -> Option<AttachmentPlace> {
    let _log_and_create_time = (fields.u64()?, fields.u64()?);
    let (name, _media_type) = (fields.text()?, fields.text()?);
    let data_len = fields.u64()?;
    Some(AttachmentPlace { name: name.to_owned(), head_len: fields.taken(), data_len })
}
