//! Entries of a foreign log, and the results of splitting the log into entries.

/// Bytes that a foreign log recorded from one connection, at one time.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entry {
    /// Timestamp of the entry, nanoseconds on the file's clock.
    pub stamp_ns: u64,
    /// Name of the connection in the file, such as a CAN interface.
    pub stream: String,
    /// Bytes as the device sent them.
    pub bytes: Vec<u8>,
}

/// Result of parsing the next bytes of a file to import.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Step {
    /// This many bytes were parsed. They gave any number of entries, even none.
    Took(usize),
    /// This many bytes were lost, for this reason.
    Lost(usize, &'static str),
    /// More bytes are needed. At the end of the file, this means that the last entry is truncated.
    More,
    /// Entries were found, but the next bytes contain more. None of these bytes are consumed yet.
    Held,
}

/// Losses and remarks that a format reports at the end of an import, as text.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ImportReport {
    /// Losses of data.
    pub losses: Vec<String>,
    /// Remarks that don't concern losses of data.
    pub remarks: Vec<String>,
}

/// Epoch of a format's timestamps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Clock {
    /// The timestamps count from 1970 in UTC.
    Utc,
    /// The timestamps count from 1970 in the unknown time zone of the machine that wrote the file.
    Local,
    /// The timestamps count from an epoch that only this kind of file uses.
    Own,
}

/// Timestamps earlier than this time in 2001 don't count as UTC.
const FIRST_UTC_NS: u64 = 1_000_000_000_000_000_000;

impl Clock {
    /// Returns the epoch of a file's timestamps, which should be UTC, from the first of them.
    ///
    /// An early first timestamp means that the recording machine's clock was not set.
    pub(super) fn of_first(first_ns: Option<u64>) -> Self {
        if first_ns.is_some_and(|first_ns| first_ns >= FIRST_UTC_NS) { Self::Utc } else { Self::Own }
    }

    /// Returns the epoch's name in the log's metadata.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Utc => "utc",
            Self::Local => "local",
            Self::Own => "own",
        }
    }
}
