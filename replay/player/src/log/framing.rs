//! Finds record boundaries in a file that may be damaged.
//!
//! A record is an opcode, a u64 length and that many bytes. It has no start marker, so a wrong length hides the start
//! of everything after it.
//!
//! Three checks detect a wrong length. Most kinds of record imply their length twice, by the record length and by the
//! lengths of fields. The length must leave room for the next record in the file. Another record must begin where it
//! ends.
//!
//! Source: MCAP format specification, "Records".

use std::collections::BTreeMap;
use std::io::{BufReader, Read, Seek};

use mcap::records::op;
use serde::{Deserialize, Serialize};

use super::error::LogError;
use super::fields::{Fields, MessageHead};
use super::format::LIBRARY;
use super::limits::map_cost;
use super::medium::Medium;

/// Maximum plausible length of a record that is neither a chunk nor an attachment. A greater length counts as damage.
const MAX_RECORD_BYTES: u64 = 256 << 20;
/// Length of a record's opcode and length field, bytes.
const RECORD_HEAD_BYTES: usize = 9;
/// Maximum number of bytes read to identify a record. This is enough for fields of fixed length and usual names.
const GLANCE_BYTES: usize = 1024;
/// Length of a chunk record before its data, without the name of the compression, bytes.
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

    /// Returns the medium that the file is on.
    pub(super) fn medium(&self) -> &Medium<R> {
        self.input.get_ref()
    }

    pub(super) fn name(&self) -> &str {
        &self.name
    }

    /// Reads from `at` until `into` is full or the file ends. Returns the number of bytes that were read.
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

    /// Reads up to `len` bytes at `at`; fewer at the end of the file. The caller must bound `len`.
    pub(super) fn bytes_at(&mut self, at: u64, len: u64) -> Result<Vec<u8>, LogError> {
        let len = len.min(self.len().saturating_sub(at));
        let mut bytes = vec![0; usize::try_from(len).unwrap_or(0)];
        let done = self.read_at(at, &mut bytes)?;
        bytes.truncate(done);
        Ok(bytes)
    }
}

/// Definition of a channel in an MCAP file.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Definition {
    pub(super) id: u16,
    pub(super) topic: String,
    pub(super) metadata: BTreeMap<String, String>,
    /// Schema number and message encoding, which matter only in logs of other programs. This program's logs don't need
    /// them.
    pub(super) form: Option<(u16, String)>,
}

/// Compares only the fields that the log's list of channels contains. The list doesn't have the field `form`.
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

    /// Returns the memory that the channel's definition takes, see [`map_cost`].
    pub(super) fn cost(&self) -> u64 {
        let form = self.form.as_ref().map_or(0, |(_, encoding)| encoding.len());
        let texts = self.metadata.iter().map(|(key, value)| key.len() + value.len());
        let bytes = self.topic.len() + form + texts.sum::<usize>();
        map_cost(self.metadata.len() as u64 + 1, bytes as u64)
    }
}

/// Parses the number and name of a schema from its record.
pub(super) fn schema(fields: &mut Fields<'_>) -> Option<(u16, String)> {
    Some((fields.u16()?, fields.text()?.to_owned()))
}

/// A chunk: the position of its data, and the fields of its header.
#[derive(Debug, Clone)]
pub(super) struct ChunkPlace {
    pub(super) data: u64,
    pub(super) data_len: u64,
    pub(super) unpacked_len: u64,
    pub(super) crc: u32,
    pub(super) compression: String,
    /// First and last log time of the messages; both 0 if the chunk has none.
    pub(super) times: (u64, u64),
    /// Whether the file ends within the chunk.
    pub(super) cut: bool,
    /// Whether the chunk's header is damaged, because the lengths of its fields contradict the record length.
    pub(super) doubtful: bool,
}

/// An attachment of the log: its name and lengths.
#[derive(Debug, Clone)]
pub(super) struct AttachmentPlace {
    pub(super) name: String,
    /// Length of the attachment's record before the data, bytes.
    pub(super) head_len: u64,
    pub(super) data_len: u64,
}

/// Kind of a record, with the fields that framing and scanning need.
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
    /// An attachment with a name or media type too long to be read.
    UnreadAttachment,
    Metadata,
    Statistics {
        messages: u64,
        channels: u32,
    },
    DataEnd,
    /// Start of the summary as stated by the footer; 0 if there is no summary.
    Footer {
        summary: u64,
    },
    Other,
}

/// A record and its position in the file.
#[derive(Debug, Clone)]
pub(super) struct Frame {
    pub(super) at: u64,
    pub(super) body: u64,
    pub(super) end: u64,
    pub(super) item: Item,
    /// Whether the lengths of the record's fields confirm the record length.
    pub(super) confirmed: bool,
}

/// Content found at a position of a log file.
#[derive(Debug)]
pub(super) enum Found {
    /// A record that lies completely within the file.
    Record(Frame),
    /// A record that the end of the file cuts off, or a record with a wrong length.
    Cut(Frame),
    /// The magic bytes that close an MCAP file.
    Closing,
    /// The end of the file.
    End,
    /// No record starts at this position.
    Nothing,
}

/// Identifies the content of the file at position `at`.
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
    // A chunk is examined whatever length its record states, because the fields of a chunk imply its length a second
    // time.
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
        // The data of a message has no length field, so its fields can't confirm the record length.
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

/// Identifies a record by its content if its opcode is damaged.
fn disguised(opcode: u8, body: u64, glance: &[u8], len: u64) -> Option<Item> {
    // A message may contain any bytes, so its content proves nothing, unless it can be parsed as a chunk with matching
    // lengths. That is no coincidence.
    let kinds: &[u8] =
        if opcode == op::MESSAGE { &[op::CHUNK] } else { &[op::CHUNK, op::ATTACHMENT, op::METADATA] };
    kinds
        .iter()
        .find_map(|kind| parse(*kind, body, glance).filter(|(_, inner_len)| *inner_len == len))
        .map(|it| it.0)
}

/// Whether an opcode is reserved by MCAP and not used yet. Damage easily produces such opcodes.
fn is_reserved(opcode: u8) -> bool {
    (op::DATA_END + 1..0x80).contains(&opcode)
}

/// Returns the kind of a record whose names don't fit into [`GLANCE_BYTES`].
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

/// Whether a record with this opcode can have this length.
fn is_possible(opcode: u8, len: u64) -> bool {
    opcode != 0 && (len <= MAX_RECORD_BYTES || matches!(opcode, op::CHUNK | op::ATTACHMENT))
}

fn whole_or_cut<R: Read + Seek>(file: &LogFile<R>, frame: Frame) -> Found {
    if frame.end <= file.len() { Found::Record(frame) } else { Found::Cut(frame) }
}

/// Identifies a chunk, which implies its length twice.
///
/// If the two lengths differ, the right length is the one after which another record begins. If both lengths are the
/// largest u64, the writer never closed the chunk.
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

/// Whether a record's header could be at `at`, or the file ends there.
fn record_follows<R: Read + Seek>(file: &mut LogFile<R>, at: u64) -> Result<bool, LogError> {
    if at >= file.len() {
        return Ok(at == file.len());
    }
    let mut head = [0; RECORD_HEAD_BYTES];
    let whole = file.read_at(at, &mut head)? == head.len();
    let (opcode, len) = record_head(head);
    Ok(whole && opcode <= op::DATA_END && is_possible(opcode, len) && len <= file.len() - at)
}

/// Parses those fields of a record that framing and scanning need. Also returns the minimum record length that these
/// fields imply.
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
            // This sum can overflow only in a damaged attachment, which is still recognised as an attachment.
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

/// Reads the length of the list that ends a record. Returns the item, and the record length that the list implies.
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
