//! What stands in a foreign log.

/// What a file says was on a line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entry {
    /// When, in nanoseconds of the file's own clock.
    pub stamp_ns: u64,
    /// Which line, by the name that the format gives it: a CAN interface, for instance.
    pub stream: String,
    /// The bytes as the device sent them.
    pub bytes: Vec<u8>,
}

/// What stands at the front of the rest of a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Step {
    /// Entries, or what carries none, in so many bytes.
    Took(usize),
    /// So many bytes that are lost, and why.
    Lost(usize, &'static str),
    /// Not known without more bytes; at the file's end, an entry that is cut off.
    More,
    /// What stands at the front has more entries: none of its bytes is done with.
    Held,
}

/// What a format says at the end besides its bytes, in words.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Told {
    /// What was lost.
    pub losses: Vec<String>,
    /// What is no loss, and should be known all the same.
    pub remarks: Vec<String>,
}

/// What a format's times count from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Clock {
    /// 1970, UTC.
    Utc,
    /// 1970, in the unknown time zone of the machine that wrote the file.
    Local,
    /// Something of its own.
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
