//! Unpacks chunks, and verifies the checksums of a log's data section and summary, with the reader of the `mcap` crate.
//!
//! Chunks packed by zstd get their own decompressor. It works like the `mcap` crate's, but limits the window, which a
//! frame may otherwise set to 128 MiB. Formats of zstd before 0.8 have windows of another kind, and aren't supported.

use std::io::{Read, Seek};

use mcap::records::op;
use mcap::sans_io::decompressor::{DecompressResult, Decompressor};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{McapError, McapResult};
use zstd_safe::{DCtx, DParameter, InBuffer, OutBuffer, ResetDirective, get_error_name};

use super::error::LogError;
use super::framing::{ChunkPlace, LogFile};
use super::limits::{MAX_UNPACKED_BYTES, MAX_WINDOW_LOG, RECORD_COST};
use super::loss::LossKind;

/// Number of bytes read from the file at once.
const READ_BYTES: usize = 1 << 20;

/// Result of unpacking a chunk.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Unpacked {
    /// The whole chunk is valid and unpacked.
    Whole,
    /// The file ends within the chunk. The records before the end can be parsed, but no checksum covers them.
    Cut,
    /// The chunk is damaged, and none of its records can be trusted.
    Bad(LossKind),
}

/// Calls `sink` with the opcode and body of each record in a chunk.
///
/// Errors: I/O errors only. Damage is part of the result.
pub(super) fn unpack<R: Read + Seek>(
    file: &mut LogFile<R>,
    place: &ChunkPlace,
    mut sink: impl FnMut(u8, &[u8]),
) -> Result<Unpacked, LogError> {
    if !place.cut && !place.compression.is_empty() && place.unpacked_len > MAX_UNPACKED_BYTES {
        return Ok(Unpacked::Bad(LossKind::TooLarge { limit: MAX_UNPACKED_BYTES }));
    }
    let mut reader = reader(|options| options.with_skip_start_magic(true).with_validate_chunk_crcs(true));
    if let Err(error) = reader.add_decompressor(Unzstd::default()) {
        // Adding a decompressor fails only if the decompressor has no name, and this one has a name.
        tracing::error!(%error, "chunks packed by zstd can't be read");
    }
    // The header is rebuilt, because the file may end within the chunk. The original lengths and checksum also cover
    // the data that is then missing.
    let head = chunk_head(place);
    reader.insert(head.len()).copy_from_slice(&head);
    reader.notify_read(head.len());
    let (mut memory, mut too_large) = (0_u64, false);
    let mut counted = |opcode, body: &[u8]| {
        memory = memory.saturating_add(body.len() as u64 + RECORD_COST);
        too_large = memory > MAX_UNPACKED_BYTES;
        if !too_large {
            sink(opcode, body);
        }
        !too_large
    };
    let result = drive(file, place.data..place.data.saturating_add(place.data_len), reader, &mut counted)?;
    Ok(match result {
        _ if too_large => Unpacked::Bad(LossKind::TooLarge { limit: MAX_UNPACKED_BYTES }),
        Err(McapError::DecompressionError(why)) if why == TOO_MUCH_MEMORY => {
            Unpacked::Bad(LossKind::Window { limit: 1 << MAX_WINDOW_LOG })
        }
        Err(McapError::RecordTooLarge { .. }) if !place.doubtful => {
            Unpacked::Bad(LossKind::TooLarge { limit: MAX_UNPACKED_BYTES })
        }
        Err(McapError::UnsupportedCompression(name)) => Unpacked::Bad(LossKind::Compression(name)),
        // Without a checksum, the chunk can't be trusted. A header that was overwritten with zeros could turn any bytes
        // into an empty chunk.
        _ if place.doubtful && place.crc == 0 => Unpacked::Bad(LossKind::Contents),
        _ if place.cut => Unpacked::Cut,
        Ok(()) => Unpacked::Whole,
        Err(McapError::BadChunkCrc { .. }) => Unpacked::Bad(LossKind::Checksum),
        Err(_) => Unpacked::Bad(LossKind::Contents),
    })
}

/// Whether the checksum of everything before the data end record matches.
///
/// Also true if there is no checksum, or if a record is too large to be read.
pub(super) fn data_section_holds<R: Read + Seek>(file: &mut LogFile<R>) -> Result<bool, LogError> {
    let reader = reader(|options| options.with_emit_chunks(true).with_validate_data_section_crc(true));
    let result = drive(file, 0..u64::MAX, reader, &mut |opcode, _| opcode != op::DATA_END)?;
    Ok(!matches!(result, Err(McapError::BadDataCrc { .. })))
}

/// Whether the summary can be parsed and matches its checksum, if it has one. The summary begins after the data end
/// record at `data_end`.
pub(super) fn summary_holds<R: Read + Seek>(file: &mut LogFile<R>, data_end: u64) -> Result<bool, LogError> {
    let reader =
        reader(|options| options.with_skip_start_magic(true).with_validate_summary_section_crc(true));
    Ok(drive(file, data_end..u64::MAX, reader, &mut |opcode, _| opcode != op::FOOTER)?.is_ok())
}

/// Creates a reader that never allocates more than the longest allowed record, whatever lengths a file claims.
fn reader(set: impl FnOnce(LinearReaderOptions) -> LinearReaderOptions) -> LinearReader {
    let limit = usize::try_from(MAX_UNPACKED_BYTES).unwrap_or(usize::MAX);
    let options = LinearReaderOptions::default().with_skip_end_magic(true).with_record_length_limit(limit);
    LinearReader::new_with_options(set(options))
}

/// Passes a range of the file to a reader, until the range ends, the reader fails, or `sink` returns false.
fn drive<R: Read + Seek>(
    file: &mut LogFile<R>,
    part: core::ops::Range<u64>,
    mut reader: LinearReader,
    sink: &mut dyn FnMut(u8, &[u8]) -> bool,
) -> Result<McapResult<()>, LogError> {
    let mut at = part.start;
    while let Some(event) = reader.next_event() {
        match event {
            Ok(LinearReadEvent::ReadRequest(wanted)) => {
                let left = usize::try_from(part.end.saturating_sub(at)).unwrap_or(usize::MAX);
                let got = file.read_at(at, reader.insert(wanted.min(left).min(READ_BYTES)))?;
                reader.notify_read(got);
                at += got as u64;
            }
            Ok(LinearReadEvent::Record { opcode, data }) if sink(opcode, data) => {}
            Ok(LinearReadEvent::Record { .. }) => return Ok(Ok(())),
            Err(error) => return Ok(Err(error)),
        }
    }
    Ok(Ok(()))
}

/// Returns the bytes of a chunk record before its data.
///
/// Source: MCAP format specification, "Chunk (op=0x06)".
fn chunk_head(place: &ChunkPlace) -> Vec<u8> {
    let mut fields = Vec::new();
    fields.extend(place.times.0.to_le_bytes());
    fields.extend(place.times.1.to_le_bytes());
    fields.extend(place.unpacked_len.to_le_bytes());
    fields.extend(if place.cut { 0 } else { place.crc }.to_le_bytes());
    fields.extend(u32::try_from(place.compression.len()).unwrap_or(u32::MAX).to_le_bytes());
    fields.extend(place.compression.as_bytes());
    fields.extend(place.data_len.to_le_bytes());
    let len = place.data_len.saturating_add(fields.len() as u64);
    [&[op::CHUNK], len.to_le_bytes().as_slice(), &fields].concat()
}

/// Error text of zstd for a window beyond the limit.
const TOO_MUCH_MEMORY: &str = "Frame requires too much memory for decoding";
/// Magic numbers of a zstd frame, and of a skippable frame with its four variable bits cleared. Source: RFC 8878, 3.1.
const FRAME: u32 = 0xFD2F_B528;
const SKIPPABLE: u32 = 0x184D_2A50;

/// Decompressor of zstd for frames with windows of up to 2^[`MAX_WINDOW_LOG`] bytes.
#[derive(Default)]
struct Unzstd {
    /// Decompression context of zstd, created on first use.
    context: Option<DCtx<'static>>,
    /// Number of bytes that zstd suggests to read next; 0 before a frame.
    need: usize,
}

fn checked(result: Result<usize, usize>) -> McapResult<usize> {
    result.map_err(|code| McapError::DecompressionError(get_error_name(code).into()))
}

impl Decompressor for Unzstd {
    fn next_read_size(&self) -> usize {
        self.need
    }

    fn decompress(&mut self, src: &[u8], dst: &mut [u8]) -> McapResult<DecompressResult> {
        if self.need == 0 {
            // There are too few bytes to read the magic number, so more bytes are requested.
            let Some(magic) = src.first_chunk() else {
                return Ok(DecompressResult { consumed: 0, wrote: 0 });
            };
            let magic = u32::from_le_bytes(*magic);
            if magic != FRAME && magic & !0xF != SKIPPABLE {
                return Err(McapError::DecompressionError("no frame of zstd".into()));
            }
        }
        let context = if let Some(context) = &mut self.context {
            context
        } else {
            let mut context = DCtx::create();
            checked(context.set_parameter(DParameter::WindowLogMax(MAX_WINDOW_LOG)))?;
            self.context.insert(context)
        };
        let (mut from, mut to) = (InBuffer::around(src), OutBuffer::around(dst));
        self.need = checked(context.decompress_stream(&mut to, &mut from))?;
        Ok(DecompressResult { consumed: from.pos, wrote: to.pos() })
    }

    fn reset(&mut self) -> McapResult<()> {
        self.need = 0;
        match &mut self.context {
            Some(context) => checked(context.reset(ResetDirective::SessionOnly)).map(drop),
            None => Ok(()),
        }
    }

    fn name(&self) -> &'static str {
        "zstd"
    }
}
