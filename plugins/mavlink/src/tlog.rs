//! Telemetry logs of ground stations (`.tlog`). A timestamp precedes each frame.
//!
//! Source: MAVLink developer guide, "Telemetry logs": eight bytes, big-endian, microseconds since 1970.

use crate::frame::announced_bytes;

const STAMP_BYTES: usize = 8;

/// Iterates over the frames of a log. Checksums aren't checked. The iteration ends after the first error.
#[derive(Debug, Clone)]
pub struct Tlog<'a> {
    bytes: &'a [u8],
    offset: usize,
}

/// A frame with its log timestamp.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Logged<'a> {
    /// UTC, microseconds since 1970.
    pub utc_us: u64,
    /// Bytes of the frame.
    pub frame: &'a [u8],
}

/// Error in a telemetry log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TlogError {
    /// The file ends within an entry.
    #[error("reading a telemetry log: the entry at byte {offset} is cut off")]
    Short {
        /// Offset of the entry in the file.
        offset: usize,
    },
    /// There is no frame at the expected offset.
    #[error(
        "reading a telemetry log: the entry at byte {offset} has 0x{got:02X} for a frame's start; 0xFE and 0xFD are allowed"
    )]
    Start {
        /// Offset of the entry in the file.
        offset: usize,
        /// Byte found at the place of the frame's start.
        got: u8,
    },
}

impl<'a> Tlog<'a> {
    /// Creates an iterator over the bytes of a log.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, offset: 0 }
    }

    fn entry(&self) -> Result<Logged<'a>, TlogError> {
        let short = TlogError::Short { offset: self.offset };
        let rest = self.bytes.get(self.offset..).unwrap_or_default();
        let (stamp, rest) = rest.split_first_chunk::<STAMP_BYTES>().ok_or(short)?;
        let got = *rest.first().ok_or(short)?;
        if !matches!(got, 0xFE | 0xFD) {
            return Err(TlogError::Start { offset: self.offset, got });
        }
        let frame = announced_bytes(rest).and_then(|len| rest.get(..len)).ok_or(short)?;
        Ok(Logged { utc_us: u64::from_be_bytes(*stamp), frame })
    }
}

impl<'a> Iterator for Tlog<'a> {
    type Item = Result<Logged<'a>, TlogError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.offset >= self.bytes.len() {
            return None;
        }
        let entry = self.entry();
        self.offset = match &entry {
            Ok(logged) => self.offset + STAMP_BYTES + logged.frame.len(),
            Err(_) => self.bytes.len(),
        };
        Some(entry)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{RECORDED_ATTITUDE, RECORDED_PRESSURE};

    fn log() -> Vec<u8> {
        let mut bytes = 1_636_061_446_000_000_u64.to_be_bytes().to_vec();
        bytes.extend_from_slice(RECORDED_ATTITUDE);
        bytes.extend_from_slice(&1_636_061_446_000_007_u64.to_be_bytes());
        bytes.extend_from_slice(RECORDED_PRESSURE);
        bytes
    }

    #[test]
    fn tlog_frames_have_their_times() {
        let entries: Vec<_> =
            Tlog::new(&log()).map(|entry| entry.map(|it| (it.utc_us, it.frame.len()))).collect();
        let frames = [RECORDED_ATTITUDE.len(), RECORDED_PRESSURE.len()];
        assert_eq!(entries, [Ok((1_636_061_446_000_000, frames[0])), Ok((1_636_061_446_000_007, frames[1]))]);
    }

    #[test]
    fn truncated_tlog_gives_whole_entries() {
        let (log, first) = (log(), STAMP_BYTES + RECORDED_ATTITUDE.len());
        for len in 0..=log.len() {
            let entries: Vec<_> = Tlog::new(&log[..len]).collect();
            let whole = usize::from(len >= first) + usize::from(len == log.len());
            assert_eq!(entries.iter().filter(|entry| entry.is_ok()).count(), whole, "{len} bytes");
            assert_eq!(entries.len() > whole, ![0, first, log.len()].contains(&len), "{len} bytes");
        }
    }

    #[test]
    fn file_that_is_no_log_is_reported() {
        let error = Tlog::new(&[0; 20]).next().unwrap().unwrap_err();
        assert_eq!(error, TlogError::Start { offset: 0, got: 0 });
        assert!(error.to_string().ends_with("has 0x00 for a frame's start; 0xFE and 0xFD are allowed"));
    }
}
