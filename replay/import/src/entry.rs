//! Entries of a foreign log.

/// Bytes that a file recorded on a line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entry {
    /// Timestamp, nanoseconds of the file's clock.
    pub stamp_ns: u64,
    /// The line, by its name in the format: a CAN interface, for instance.
    pub stream: String,
    /// The bytes as the device sent them.
    pub bytes: Vec<u8>,
}

/// Result of parsing the front of the remaining file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Step {
    /// This many bytes were parsed, with or without entries.
    Took(usize),
    /// This many bytes were lost, for this reason.
    Lost(usize, &'static str),
    /// More bytes are needed. At the end of the file the entry is truncated.
    More,
    /// The front has further entries; none of its bytes is consumed yet.
    Held,
}

/// A format's report at the end, as text.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Told {
    /// Losses.
    pub losses: Vec<String>,
    /// Remarks that aren't losses.
    pub remarks: Vec<String>,
}

/// Epoch of a format's timestamps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Clock {
    /// 1970, UTC.
    Utc,
    /// 1970, in the unknown time zone of the machine that wrote the file.
    Local,
    /// An epoch specific to the format.
    Own,
}

impl Clock {
    /// Its name in the log's metadata.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Utc => "utc",
            Self::Local => "local",
            Self::Own => "own",
        }
    }
}
