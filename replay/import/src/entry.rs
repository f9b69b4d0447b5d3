//! Entries of a foreign log.

/// Bytes that a file recorded on a line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entry {
    /// Timestamp, nanoseconds of the file's clock.
    pub stamp_ns: u64,
    /// The line, by the name that the format gives it: a CAN interface, for instance.
    pub stream: String,
    /// The bytes as the device sent them.
    pub bytes: Vec<u8>,
}

/// Result of parsing the front of the remaining file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Step {
    /// This many bytes parsed; they gave entries or carry none.
    Took(usize),
    /// This many bytes lost, and why.
    Lost(usize, &'static str),
    /// More bytes are needed; at the end of the file, a truncated entry.
    More,
    /// The front has further entries: none of its bytes is consumed yet.
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
    /// An epoch of the format's own.
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
