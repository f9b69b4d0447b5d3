//! Errors that concern a log as a whole. Damage within a log is a [`super::Loss`].

use std::io;
use std::path::PathBuf;

/// A log could not be written or read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LogError {
    /// The file could not be created.
    #[error("could not create {}: {source}", path.display())]
    Create {
        /// The file.
        path: PathBuf,
        /// Cause.
        source: io::Error,
    },
    /// The file could not be opened.
    #[error("could not open {}: {source}", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// Cause.
        source: io::Error,
    },
    /// An I/O error while reading.
    #[error("could not read {name} at byte {offset}: {source}")]
    Read {
        /// The log, as the caller named it.
        name: String,
        /// Offset, bytes.
        offset: u64,
        /// Cause.
        source: io::Error,
    },
    /// An I/O error while writing: medium full, removed or read-only.
    #[error("could not write {what} to the log: {source}")]
    Write {
        /// Item being written.
        what: &'static str,
        /// Cause.
        source: io::Error,
    },
    /// Content that MCAP can't represent.
    #[error("could not write {what} to the log: {source}")]
    Encode {
        /// Item being written.
        what: &'static str,
        /// Cause.
        source: mcap::McapError,
    },
    /// Not an MCAP file.
    #[error("{name} is not an MCAP file: it begins with [{found}]; expected [{wanted}]")]
    NotMcap {
        /// The log, as the caller named it.
        name: String,
        /// Its first bytes, in hex.
        found: String,
        /// MCAP's first bytes, in hex.
        wanted: String,
    },
    /// A log written by a later version of this program.
    #[error("{name} is a log of format {found}; this program reads formats up to {known}")]
    TooNew {
        /// The log, as the caller named it.
        name: String,
        /// Its format version.
        found: String,
        /// Latest version supported here.
        known: u32,
    },
    /// A folder without a log.
    #[error("{} holds no log: nothing in it ends in .mcap", folder.display())]
    NoLogs {
        /// The folder.
        folder: PathBuf,
    },
    /// Several logs, one of which isn't part of a recording.
    #[error(
        "{} is not a part of a recording, and only the parts of one are read as one log; name a single log, or the parts alone",
        path.display()
    )]
    NotAPart {
        /// The log.
        path: PathBuf,
    },
    /// Parts of several recordings.
    #[error(
        "{} and {} are parts of different recordings ({one_dive} and {other_dive}); name the parts of one",
        one.display(), other.display()
    )]
    OtherDive {
        /// A part of one of them.
        one: PathBuf,
        /// Its recording.
        one_dive: String,
        /// A part of the other recording.
        other: PathBuf,
        /// Its recording.
        other_dive: String,
    },
    /// A part that occurs twice.
    #[error("{} and {} are both part {number} of the recording; name one of them", one.display(), other.display())]
    PartTwice {
        /// Its number.
        number: u32,
        /// A file.
        one: PathBuf,
        /// The other one.
        other: PathBuf,
    },
    /// A result topic without the result prefix.
    #[error("topic {topic:?} of a result must begin with {:?}", super::format::RESULT_PREFIX)]
    Topic {
        /// The topic.
        topic: String,
    },
    /// A message for a channel that the header did not declare.
    #[error("a message for {channel}, which the log's header does not announce")]
    NoChannel {
        /// The channel, by kind and index.
        channel: String,
    },
    /// More packets in one tick than a tick message can count.
    #[error("a tick of {packets} packets can't be written; a message holds up to {}", u32::MAX)]
    TickTooLong {
        /// Packets in the tick.
        packets: usize,
    },
    /// The recorder's thread could not be started.
    #[error("could not start the recorder's thread: {source}")]
    Thread {
        /// Cause.
        source: io::Error,
    },
    /// A medium that neither accepts data nor fails.
    #[error(
        "the recording wasn't complete {waited_s} s after the dive's end: its medium is too slow or doesn't answer; how much of the log is on it isn't known"
    )]
    Stuck {
        /// Time waited, s.
        waited_s: u64,
    },
    /// A bug in the recorder.
    #[error("the recorder's thread panicked")]
    Panicked,
}

impl LogError {
    /// An error of the MCAP writer; the message includes the operating system's error where there is one.
    pub(super) fn writing(what: &'static str) -> impl Fn(mcap::McapError) -> Self {
        move |error| match error {
            mcap::McapError::Io(source) => Self::Write { what, source },
            source => Self::Encode { what, source },
        }
    }
}
