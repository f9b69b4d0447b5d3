//! Bags of ROS 1.
//!
//! Source: ROS wiki, "Bags/Format/2.0". A record consists of a header and data, each preceded by its length. A header
//! consists of fields `name=value`. Messages are in chunks. Definitions of connections are in chunks and again at the
//! end of the bag.

use std::collections::BTreeMap;
use std::io::{Read, Seek, SeekFrom};

use super::feeds::{Feeds, Topic};
use super::message::Type;
use super::wire::Encoding;
use crate::entry::{Clock, Entry, ImportReport, Step};
use crate::error::ImportError;
use crate::format::Format;
use crate::input::{Input, Source as _};
use crate::order::Order;

const MAGIC: &[u8] = b"#ROSBAG V2.0\n";
/// Upper bound on the length of a record's header, bytes. A greater length counts as damage.
const MOST_HEADER: usize = 1 << 16;
/// Maximum number of bytes read from the definitions at the end of a bag.
const MOST_INDEX: u64 = 64 << 20;

const NO_RECORD: &str = "no bag record";

/// The bag format. Its streams are named after the sensors' ids.
#[derive(Default)]
pub struct Bag {
    feeds: Feeds,
    begun: bool,
    /// Whether the reader has lost the position of the next record.
    astray: bool,
    connections: BTreeMap<u32, Topic>,
    /// The chunk whose records are being read.
    chunk: Option<Chunk>,
    first_ns: Option<u64>,
    /// Position of the index, and numbers of connections and chunks, as stated in the bag's header.
    stated: Option<Stated>,
    chunks: u64,
    lost: BTreeMap<&'static str, u64>,
}

/// Position of the index, and numbers of connections and chunks, as stated in the bag's header.
#[derive(Debug, Clone, Copy)]
struct Stated {
    index_at: u64,
    connections: u32,
    chunks: u32,
}

/// The content of an unpacked chunk, the position reached in it, and the parsing result to return at its end.
struct Chunk {
    bytes: Vec<u8>,
    at: usize,
    step: Step,
}

/// A record of the bag: its fields, its data, and its total length.
struct Record<'a> {
    fields: Fields<'a>,
    data: &'a [u8],
    len: usize,
}

/// Result of accepting a record of the bag.
enum Accepted<'a> {
    /// The record has been processed completely.
    Read,
    /// The record is a chunk with this compression. Its content must still be unpacked.
    Chunk(&'a [u8]),
}

/// Reason why a record of the bag can't be read.
enum Stop<'a> {
    /// The record is incomplete. If the fields of its header are complete, the variant holds them, and that part of the
    /// record's data which is available.
    More(Option<(Fields<'a>, &'a [u8])>),
    Bad,
}

/// Fields of a record's header.
#[derive(Clone, Copy)]
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn get(&self, name: &[u8]) -> Option<&'a [u8]> {
        let mut rest = self.0;
        while let Some((field, behind)) = sized(rest) {
            rest = behind;
            let equals = field.iter().position(|byte| *byte == b'=')?;
            if field.get(..equals) == Some(name) {
                return field.get(equals + 1..);
            }
        }
        None
    }

    fn is_whole(&self) -> bool {
        let mut rest = self.0;
        while let Some((_, behind)) = sized(rest) {
            rest = behind;
        }
        rest.is_empty()
    }

    fn u8(&self, name: &[u8]) -> Option<u8> {
        self.get(name)?.first().copied()
    }

    fn u32(&self, name: &[u8]) -> Option<u32> {
        Some(u32::from_le_bytes(self.get(name)?.try_into().ok()?))
    }

    fn u64(&self, name: &[u8]) -> Option<u64> {
        Some(u64::from_le_bytes(self.get(name)?.try_into().ok()?))
    }

    /// Reads a time field: seconds, then nanoseconds.
    fn time_ns(&self, name: &[u8]) -> Option<u64> {
        let (seconds, nanoseconds) = self.get(name)?.split_at_checked(4)?;
        let number = |bytes: &[u8]| Some(u64::from(u32::from_le_bytes(bytes.try_into().ok()?)));
        Some(number(seconds)? * 1_000_000_000 + number(nanoseconds)?)
    }

    fn text(&self, name: &[u8]) -> Option<String> {
        Some(String::from_utf8_lossy(self.get(name)?).into_owned())
    }
}

/// Splits off the bytes that a length prefix announces. Returns these bytes, and the rest after them.
fn sized(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (len, rest) = bytes.split_first_chunk()?;
    rest.split_at_checked(usize::try_from(u32::from_le_bytes(*len)).ok()?)
}

fn record(front: &[u8]) -> Result<Record<'_>, Stop<'_>> {
    let length = |bytes: &[u8]| {
        let len = bytes.first_chunk().map(|len| u32::from_le_bytes(*len));
        len.map(|len| usize::try_from(len).unwrap_or(usize::MAX))
    };
    let header_len = length(front).ok_or(Stop::More(None))?;
    // The shortest header has one field with the kind of record: a length, `op=` and a byte.
    if !(8..=MOST_HEADER).contains(&header_len) {
        return Err(Stop::Bad);
    }
    // In a damaged file the lengths may be arbitrary. After the lengths, a field name must follow, which begins with a
    // lower-case letter. Most wrong lengths fail this check.
    if front.get(8).is_some_and(|byte| !byte.is_ascii_lowercase()) {
        return Err(Stop::Bad);
    }
    let (header, behind) = sized(front).ok_or(Stop::More(None))?;
    let fields = Fields(header);
    if !fields.is_whole() || fields.u8(b"op").is_none() {
        return Err(Stop::Bad);
    }
    let data_len = length(behind).ok_or(Stop::More(None))?;
    if data_len > MOST_UNPACKED {
        return Err(Stop::Bad);
    }
    let Some((data, rest)) = sized(behind) else {
        return Err(Stop::More(Some((fields, behind.get(4..).unwrap_or_default()))));
    };
    Ok(Record { fields, data, len: front.len() - rest.len() })
}

impl Format for Bag {
    fn clock(&self) -> Clock {
        Clock::of_first(self.first_ns)
    }

    fn most_held(&self) -> usize {
        MOST_UNPACKED + MOST_HEADER + 8
    }

    fn reach_ns(&self) -> u64 {
        self.feeds.reach_ns()
    }

    fn step(&mut self, front: &[u8], end: bool, out: &mut Vec<Entry>) -> Step {
        if !self.begun {
            return self.begin(front, end);
        }
        if let Some(chunk) = self.chunk.take() {
            return self.read_on(chunk, out);
        }
        let record = record(front);
        let was_astray = core::mem::replace(&mut self.astray, matches!(record, Err(Stop::Bad)));
        match record {
            Ok(Record { fields, data, len }) => match self.accept(fields, data, out) {
                None => Step::Lost(len, NO_RECORD),
                Some(Accepted::Read) => Step::Took(len),
                Some(Accepted::Chunk(packing)) => self.open(fields, data, packing, len, false),
            },
            Err(Stop::Bad) => Step::Lost(1, NO_RECORD),
            Err(Stop::More(None)) if was_astray => {
                self.astray = true;
                // After damage, a header that seems incomplete is probably no header at all. This is certain only at
                // the end of the file.
                if end { Step::Lost(1, NO_RECORD) } else { Step::More }
            }
            // Even if the end of the file cuts off a chunk, the rest of the chunk may contain whole messages.
            Err(Stop::More(Some((fields, data)))) if end && fields.u8(b"op") == Some(5) => {
                match fields.get(b"compression") {
                    Some(packing) => self.open(fields, data, packing, front.len(), true),
                    None => Step::More,
                }
            }
            Err(Stop::More(_)) => Step::More,
        }
    }

    fn report(&self) -> ImportReport {
        let mut report = self.feeds.report();
        report.losses.extend(self.lost.iter().map(|(why, count)| format!("{count} {why}")));
        if self.begun && self.stated.is_none() {
            report.losses.push("the bag's own header is missing".to_owned());
        }
        if let Some(Stated { index_at, chunks, .. }) = self.stated {
            if index_at == 0 {
                report.losses.push("the bag was not closed; its end may be missing".to_owned());
            } else if self.chunks != u64::from(chunks) {
                let found = self.chunks;
                report.losses.push(format!("the bag states {chunks} chunks; it has {found}"));
            }
        }
        report
    }
}

impl Bag {
    /// Creates a bag reader that passes messages to `feeds`.
    pub fn new(feeds: Feeds) -> Self {
        Self { feeds, ..Self::default() }
    }

    /// Reads the topics of a bag from its index, or by a scan of the whole bag if the index is missing.
    ///
    /// Errors: the file can't be read, or isn't a bag.
    pub fn topics<R: Read + Seek>(name: &str, mut file: R) -> Result<Vec<Topic>, ImportError> {
        let failed = |source| ImportError::Read { name: name.to_owned(), offset: 0, source };
        let mut front = Vec::new();
        (&mut file).take(MOST_HEADER as u64).read_to_end(&mut front).map_err(failed)?;
        if !front.starts_with(MAGIC) {
            let found = front.get(..MAGIC.len()).unwrap_or(&front).trim_ascii_end();
            let found = String::from_utf8_lossy(found).into_owned();
            return Err(ImportError::NoBag { name: name.to_owned(), found });
        }
        let mut bag = Self { begun: true, ..Self::default() };
        if let Ok(Record { fields, .. }) = record(front.get(MAGIC.len()..).unwrap_or_default())
            && let Some(stated) = Self::bag_header(fields)
            && stated.index_at > 0
        {
            let mut index = Vec::new();
            file.seek(SeekFrom::Start(stated.index_at)).map_err(failed)?;
            (&mut file).take(MOST_INDEX).read_to_end(&mut index).map_err(failed)?;
            let mut rest = index.as_slice();
            while let Ok(Record { fields, data, len }) = record(rest) {
                if fields.u8(b"op") != Some(5) {
                    bag.accept(fields, data, &mut Vec::new());
                }
                rest = rest.get(len..).unwrap_or_default();
            }
            if rest.is_empty() && bag.connections.len() as u64 == u64::from(stated.connections) {
                return Ok(bag.connections.into_values().collect());
            }
        }
        file.seek(SeekFrom::Start(0)).map_err(failed)?;
        let mut input = Input::new(name, file, Self::default());
        loop {
            let mut nobodys = Order::default();
            if !input.more(&mut nobodys)? {
                break;
            }
        }
        let mut topics: Vec<Topic> = Vec::new();
        for topic in input.format.connections.into_values() {
            if !topics.contains(&topic) {
                topics.push(topic);
            }
        }
        Ok(topics)
    }

    fn begin(&mut self, front: &[u8], end: bool) -> Step {
        if front.len() < MAGIC.len() && !end {
            return Step::More;
        }
        self.begun = true;
        if front.starts_with(MAGIC) { Step::Took(MAGIC.len()) } else { Step::Lost(1, NO_RECORD) }
    }

    fn bag_header(fields: Fields<'_>) -> Option<Stated> {
        Some(Stated {
            index_at: fields.u64(b"index_pos")?,
            connections: fields.u32(b"conn_count")?,
            chunks: fields.u32(b"chunk_count")?,
        })
    }

    /// Processes a record. Returns `None` if the record has no valid kind, or lacks a field that its kind requires.
    fn accept<'a>(&mut self, fields: Fields<'a>, data: &[u8], out: &mut Vec<Entry>) -> Option<Accepted<'a>> {
        match fields.u8(b"op")? {
            2 => self.message(fields.u32(b"conn")?, fields.time_ns(b"time")?, data, out),
            3 => self.stated = Some(Self::bag_header(fields)?),
            5 => return Some(Accepted::Chunk(fields.get(b"compression")?)),
            7 => self.connection(fields.u32(b"conn")?, fields, Fields(data))?,
            // Other records are ignored. They belong to an index, which holds no messages, or are of an unknown kind.
            _ => (),
        }
        Some(Accepted::Read)
    }

    fn connection(&mut self, number: u32, fields: Fields<'_>, data: Fields<'_>) -> Option<()> {
        let (name, type_name) = (fields.text(b"topic")?, data.text(b"type")?);
        let md5 = data.text(b"md5sum").unwrap_or_else(|| "*".to_owned());
        let known = match Type::named(&type_name) {
            Some(known) if known.is_defined_as(&md5) => Ok(known),
            Some(_) => Err(format!("its definition of {type_name} (MD5 {md5}) differs from that of ROS")),
            None => Err(format!("messages of type {type_name} aren't supported")),
        };
        let topic = Topic { name, type_name, known };
        if *self.connections.entry(number).or_insert_with(|| topic.clone()) != topic {
            let what = "connections with a second, different definition: the first is used";
            *self.lost.entry(what).or_default() += 1;
        }
        Some(())
    }

    fn message(&mut self, connection: u32, record_ns: u64, data: &[u8], out: &mut Vec<Entry>) {
        let Some(topic) = self.connections.get(&connection) else {
            *self.lost.entry("messages of a connection without an earlier definition").or_default() += 1;
            return;
        };
        self.first_ns = Some(self.first_ns.map_or(record_ns, |first_ns| first_ns.min(record_ns)));
        self.feeds.take(topic, Encoding::Ros1, record_ns, data, out);
    }

    fn open(&mut self, fields: Fields<'_>, data: &[u8], packing: &[u8], len: usize, cut: bool) -> Step {
        let Some(size) = fields.u32(b"size") else { return Step::Lost(len, NO_RECORD) };
        self.chunks += 1;
        let (bytes, step) = match unpack(packing, data, size, cut) {
            Unpacked::Whole(bytes) => (bytes, Step::Took(len)),
            Unpacked::Cut(bytes) => (bytes, Step::More),
            Unpacked::Bad(why) => return Step::Lost(len, why),
        };
        self.chunk = Some(Chunk { bytes, at: 0, step });
        Step::Held
    }

    /// Processes the next record within a chunk.
    fn read_on(&mut self, mut chunk: Chunk, out: &mut Vec<Entry>) -> Step {
        let rest = chunk.bytes.get(chunk.at..).unwrap_or_default();
        match record(rest) {
            _ if rest.is_empty() => return chunk.step,
            Ok(Record { fields, data, len }) => {
                // A chunk within a chunk is not allowed.
                let taken = fields.u8(b"op") != Some(5) && self.accept(fields, data, out).is_some();
                if !taken {
                    *self
                        .lost
                        .entry("records of a kind or form that is not allowed in chunks")
                        .or_default() += 1;
                }
                chunk.at += len;
            }
            Err(Stop::More(_)) if chunk.step == Step::More => return Step::More,
            Err(_) => {
                *self.lost.entry("chunks with invalid bytes at their end").or_default() += 1;
                return chunk.step;
            }
        }
        self.chunk = Some(chunk);
        Step::Held
    }
}

/// Maximum unpacked size of a chunk, bytes. Recorders make far smaller chunks, of less than a megabyte plus one
/// message.
const MOST_UNPACKED: usize = 64 << 20;

/// Result of unpacking a chunk of the bag.
#[derive(Debug, PartialEq, Eq)]
enum Unpacked {
    /// The whole chunk was unpacked.
    Whole(Vec<u8>),
    /// Only the available part was unpacked, because the end of the file cuts off the chunk.
    Cut(Vec<u8>),
    /// The chunk can't be unpacked, for this reason.
    Bad(&'static str),
}

/// Unpacks a chunk with the stated compression and size. `cut` means that the file ends within the chunk.
///
/// Source: ROS wiki, "Bags/Format/2.0". The compressions are none, bz2 and lz4. roslz4 writes lz4 as LZ4 frames.
fn unpack(packing: &[u8], packed: &[u8], size: u32, cut: bool) -> Unpacked {
    let Some(size) = usize::try_from(size).ok().filter(|size| *size <= MOST_UNPACKED) else {
        return Unpacked::Bad("chunks that would unpack to more than 64 MiB");
    };
    match packing {
        b"none" => judged(Ok(packed.to_vec()), size, cut),
        b"bz2" => read(bzip2::read::BzDecoder::new(packed), size, cut),
        b"lz4" => match lz4::Decoder::new(packed) {
            Ok(decoder) => read(decoder, size, cut),
            Err(_) => Unpacked::Bad("chunks that can't be unpacked"),
        },
        _ => Unpacked::Bad("chunks with an unknown compression; supported are none, bz2 and lz4"),
    }
}

fn read(reader: impl Read, size: usize, cut: bool) -> Unpacked {
    let mut unpacked = Vec::new();
    // One byte more than the stated size is read, to notice a chunk that is too long.
    let result = reader.take(size as u64 + 1).read_to_end(&mut unpacked);
    judged(if result.is_ok() { Ok(unpacked) } else { Err(unpacked) }, size, cut)
}

fn judged(unpacked: Result<Vec<u8>, Vec<u8>>, size: usize, cut: bool) -> Unpacked {
    match unpacked {
        Ok(bytes) | Err(bytes) if cut && bytes.len() <= size => Unpacked::Cut(bytes),
        Ok(bytes) if bytes.len() == size => Unpacked::Whole(bytes),
        Ok(_) => Unpacked::Bad("chunks of another length than stated"),
        Err(_) => Unpacked::Bad("chunks that can't be unpacked"),
    }
}

#[cfg(test)]
#[path = "bag_tests.rs"]
mod tests;
