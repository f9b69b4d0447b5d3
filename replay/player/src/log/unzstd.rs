//! Unpacks chunks packed by zstd, with limited memory.
//!
//! It works like the `mcap` crate's decompressor, but limits the window, which a frame may otherwise set to 128 MiB.
//! Formats of zstd before 0.8 have windows of another kind, and aren't supported.

use mcap::sans_io::decompressor::{DecompressResult, Decompressor};
use mcap::{McapError, McapResult};
use zstd_safe::{DCtx, DParameter, InBuffer, OutBuffer, ResetDirective, get_error_name};

use super::limits::MAX_WINDOW_LOG;

/// Error text of zstd for a window beyond the limit.
pub(super) const TOO_MUCH_MEMORY: &str = "Frame requires too much memory for decoding";
/// Magic numbers of a frame, and of a skippable frame without its four free bits. Source: RFC 8878, 3.1.
const FRAME: u32 = 0xFD2F_B528;
const SKIPPABLE: u32 = 0x184D_2A50;

/// Decompressor for frames with windows of up to 2^[`MAX_WINDOW_LOG`] bytes.
#[derive(Default)]
pub(super) struct Unzstd {
    /// Decompression context, created on first use.
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
            // There are too few bytes for the magic number, so more are requested.
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
