//! Unpacks chunks packed by zstd, in bounded memory: as the `mcap` crate's own decompressor, but for the window, which a frame
//! may else set to 128 MiB; and without the formats of zstd before 0.8, which have windows of their own.

use mcap::sans_io::decompressor::{DecompressResult, Decompressor};
use mcap::{McapError, McapResult};
use zstd_safe::{DCtx, DParameter, InBuffer, OutBuffer, ResetDirective, get_error_name};

use super::limits::MAX_WINDOW_LOG;

/// zstd's own words for a window that is over the limit.
pub(super) const TOO_MUCH_MEMORY: &str = "Frame requires too much memory for decoding";
/// Begin of a frame, and of one to be skipped, whose last four bits are free. Source: RFC 8878, 3.1.
const FRAME: u32 = 0xFD2F_B528;
const SKIPPABLE: u32 = 0x184D_2A50;

/// A decompressor of frames whose windows are up to 2^[`MAX_WINDOW_LOG`] bytes.
#[derive(Default)]
pub(super) struct Unzstd {
    /// Made when it is first needed.
    context: Option<DCtx<'static>>,
    /// Bytes that it would like next; 0 before a frame.
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
            // Fewer bytes than that ask for more.
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
