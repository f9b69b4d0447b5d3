//! The medium of a log. Some of its bytes may be unreadable.

use std::io::{Error, ErrorKind, Read, Result, Seek, SeekFrom};
use std::ops::Range;

/// Length of a disk sector, the smallest unit treated as unreadable, bytes.
const SECTOR_BYTES: u64 = 512;
/// Maximum number of unreadable ranges kept. Each further range is joined to the last kept range, together with the
/// bytes between the two.
const MOST_RANGES: usize = 1024;

/// A medium that gives zeros in place of unreadable bytes, and records their ranges. Other bytes may be intact.
pub(super) struct Medium<R> {
    input: R,
    at: u64,
    len: u64,
    failed: Vec<Range<u64>>,
    /// Text of the first error that the medium reported.
    error: String,
}

impl<R: Read + Seek> Medium<R> {
    /// Creates the medium.
    ///
    /// Errors: the length of the input can't be determined.
    pub(super) fn new(mut input: R) -> Result<Self> {
        let len = input.seek(SeekFrom::End(0))?;
        input.rewind()?;
        Ok(Self { input, at: 0, len, failed: Vec::new(), error: String::new() })
    }

    pub(super) fn len(&self) -> u64 {
        self.len
    }

    /// Whether any byte of this range couldn't be read.
    pub(super) fn has_failed_within(&self, part: &Range<u64>) -> bool {
        self.failed.iter().any(|failed| failed.start < part.end && part.start < failed.end)
    }

    /// Returns the byte ranges found unreadable so far.
    pub(super) fn failed(&self) -> &[Range<u64>] {
        &self.failed
    }

    /// Returns the text of the first error that the medium reported.
    pub(super) fn error(&self) -> &str {
        &self.error
    }

    fn fail(&mut self, error: &Error, part: Range<u64>) {
        if self.error.is_empty() {
            self.error = error.to_string();
        }
        let is_full = self.failed.len() >= MOST_RANGES;
        match self.failed.last_mut() {
            Some(last) if last.end == part.start || is_full => {
                (last.start, last.end) = (last.start.min(part.start), last.end.max(part.end));
            }
            _ => self.failed.push(part),
        }
    }
}

impl<R: Read + Seek> Read for Medium<R> {
    fn read(&mut self, into: &mut [u8]) -> Result<usize> {
        let error = match self.input.read(into) {
            Err(error) if error.kind() != ErrorKind::Interrupted => error,
            other => {
                self.at += other.as_ref().map_or(0, |read| *read as u64);
                return other;
            }
        };
        let end = ((self.at / SECTOR_BYTES + 1) * SECTOR_BYTES).min(self.len);
        let zeros = into.len().min(usize::try_from(end.saturating_sub(self.at)).unwrap_or(0));
        if zeros == 0 {
            return Err(error);
        }
        into.iter_mut().take(zeros).for_each(|byte| *byte = 0);
        let part = self.at..self.at + zeros as u64;
        self.at = self.input.seek(SeekFrom::Start(part.end))?;
        self.fail(&error, part);
        Ok(zeros)
    }
}

impl<R: Seek> Seek for Medium<R> {
    fn seek(&mut self, to: SeekFrom) -> Result<u64> {
        self.at = self.input.seek(to)?;
        Ok(self.at)
    }
}
