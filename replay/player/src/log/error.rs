//! Errors that concern a log as a whole. Damage within a log is not an error but a [`super::Loss`].

use std::io;
use std::path::PathBuf;

/// Reason why a log could not be written or read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LogError {
    /// The log file could not be created.
    #[error("could not create {}: {source}", path.display())]
    Create {
        /// Path of the log file.
        path: PathBuf,
        /// Error from the operating system.
        source: io::Error,
    },
    /// The log file could not be opened.
    #[error("could not open {}: {source}", path.display())]
    Open {
        /// Path of the log file.
        path: PathBuf,
        /// Error from the operating system.
        source: io::Error,
    },
    /// Reading the log fails with an I/O error.
    #[error("could not read {name} at byte {offset}: {source}")]
    Read {
        /// Name of the log, given by the caller.
        name: String,
        /// Offset in the log at which reading failed, bytes.
        offset: u64,
        /// Error from the operating system.
        source: io::Error,
    },
    /// Writing fails with an I/O error: the medium is full, removed or read-only.
    #[error("could not write {what} to the log: {source}")]
    Write {
        /// Item that was being written.
        what: &'static str,
        /// Error from the operating system.
        source: io::Error,
    },
    /// MCAP can't represent the content.
    #[error("could not write {what} to the log: {source}")]
    Encode {
        /// Item that was being written.
        what: &'static str,
        /// Reason why MCAP can't represent the item, as text.
        source: mcap::McapError,
    },
    /// The file isn't an MCAP file.
    #[error("{name} is not an MCAP file: it begins with [{found}]; expected [{wanted}]")]
    NotMcap {
        /// Name of the file, given by the caller.
        name: String,
        /// First bytes of the file that isn't MCAP, in hex.
        found: String,
        /// First bytes that an MCAP file must have, in hex.
        wanted: String,
    },
    /// The log was written by a later version of this program.
    #[error("{name} is a log of format {found}; this program reads formats up to {known}")]
    TooNew {
        /// Name of the log, given by the caller.
        name: String,
        /// Format version that the log states.
        found: String,
        /// Latest format version that this program can read.
        known: u32,
    },
    /// The folder contains no log.
    #[error("{} holds no log: nothing in it ends in .mcap", folder.display())]
    NoLogs {
        /// Path of the folder without a log.
        folder: PathBuf,
    },
    /// Several logs were to be read as one recording, and one of them isn't part of a recording.
    #[error(
        "{} is not a part of a recording; name one log, or only the parts of one recording",
        path.display()
    )]
    NotAPart {
        /// Path of the log that isn't part of a recording.
        path: PathBuf,
    },
    /// The files are parts of different recordings.
    #[error(
        "{} and {} are parts of different recordings ({one_dive} and {other_dive}); name only the parts of one recording",
        one.display(), other.display()
    )]
    OtherDive {
        /// Path of a part of one recording.
        one: PathBuf,
        /// Identifier of the recording that `one` belongs to.
        one_dive: String,
        /// Path of a part of another recording.
        other: PathBuf,
        /// Identifier of the recording that `other` belongs to.
        other_dive: String,
    },
    /// Two files have the same part number.
    #[error("{} and {} are both part {number} of the recording; name one of them", one.display(), other.display())]
    PartTwice {
        /// Part number that the two files have.
        number: u32,
        /// Path of one of the files.
        one: PathBuf,
        /// Path of the file that has the same part number as `one`.
        other: PathBuf,
    },
    /// The topic of a result doesn't begin with the result prefix.
    #[error("topic {topic:?} of a result must begin with {:?}", super::format::RESULT_PREFIX)]
    Topic {
        /// Topic of the result.
        topic: String,
    },
    /// The header declares no channel for a message.
    #[error("could not write a message of {channel}: the log's header does not define this channel")]
    NoChannel {
        /// Kind and number of the undeclared channel.
        channel: String,
    },
    /// A tick has more packets than a tick message can count.
    #[error("could not write a tick of {packets} packets: a tick message can count at most {}", u32::MAX)]
    TickTooLong {
        /// Number of packets in the tick.
        packets: usize,
    },
    /// The recorder's thread can't be started.
    #[error("could not start the recorder's thread: {source}")]
    Thread {
        /// Error from the operating system.
        source: io::Error,
    },
    /// At the end of a recording, the medium accepts no data but reports no error.
    #[error(
        "the recording wasn't complete {waited_s} s after the dive's end: its medium is too slow or doesn't answer; the log's end may be missing"
    )]
    Stuck {
        /// Time for which the program has waited until the medium accepts data, s.
        waited_s: u64,
    },
    /// The recorder's thread has panicked, which is a bug.
    #[error("the recorder's thread panicked")]
    Panicked,
}

impl LogError {
    /// Converts an error of the MCAP writer. The message includes the system's error, if there is one.
    pub(super) fn writing(what: &'static str) -> impl Fn(mcap::McapError) -> Self {
        move |error| match error {
            mcap::McapError::Io(source) => Self::Write { what, source },
            source => Self::Encode { what, source },
        }
    }
}
