//! Losses of a damaged log, each with its position.

use core::fmt;

use headrace_geometry::time::{DiveClock, MonoNs};
use serde::{Deserialize, Serialize};

use super::limits::LATEST;

/// Maximum number of losses in the list. Later losses extend the last entry.
const MAX_LOSSES: usize = 1000;

/// Kind of damage to a log.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum LossKind {
    /// The file ends before its closing records, because recording or copying was interrupted.
    Truncated,
    /// Bytes that aren't records, because lengths are wrong or bytes were overwritten.
    Framing,
    /// Another log in the same file, which isn't read.
    AnotherLog,
    /// A chunk with a wrong checksum. None of its messages is delivered.
    Checksum,
    /// A chunk that can't be unpacked, or has content other than records. None of its messages is delivered.
    Contents,
    /// A chunk, or messages outside chunks, that the medium fails to read; with the medium's error.
    Unreadable(String),
    /// A chunk with a compression that this program doesn't support.
    Compression(String),
    /// A chunk or attachment that exceeds the limit for reading into memory.
    TooLarge {
        /// Maximum length of a chunk or attachment, bytes.
        limit: u64,
    },
    /// Chunks that unpack to many times the length of the log. None of their messages is delivered.
    Swells {
        /// Maximum unpacked length, as a multiple of the log's length up to the chunk.
        limit: u64,
    },
    /// A chunk that needs more memory to unpack than allowed.
    Window {
        /// Maximum memory for unpacking a chunk, bytes.
        limit: u64,
    },
    /// The log has more items of a kind, such as channels, than allowed.
    Beyond {
        /// Kind of item that exceeds its limit.
        what: Many,
        /// Maximum number of items of this kind, or their maximum memory.
        limit: u64,
    },
    /// Messages with a timestamp later than allowed.
    Stamped {
        /// Number of messages not delivered because of their timestamps.
        messages: u64,
        /// Earliest timestamp of the messages that were not delivered, ns.
        first: u64,
    },
    /// An attachment that fails its checksum, or that the log lists but doesn't have.
    Attachment(String),
    /// A metadata record that fails its digest, or is missing from a log of this program.
    Metadata(String),
    /// Messages missing from a log of this program, as gaps in the message numbers show.
    Missing {
        /// Number of missing messages.
        messages: u64,
    },
    /// Messages in a log of this program whose numbers have occurred before.
    Repeated {
        /// Number of messages with a number that has occurred before.
        messages: u64,
    },
    /// Messages in a log of this program that come after messages with higher numbers.
    Disordered {
        /// Number of messages that were delivered too late.
        messages: u64,
    },
    /// A record of a kind that isn't allowed in chunks, such as a chunk within a chunk.
    Misplaced,
    /// Messages of a channel whose definition is missing from the log.
    UnknownChannel {
        /// Number of the undefined channel.
        channel: u16,
        /// Number of that channel's messages, which are not delivered.
        messages: u64,
    },
    /// A second definition of a channel that contradicts the first one. The first is used.
    Conflict {
        /// Number of the channel with two definitions.
        channel: u16,
    },
    /// All records are readable, but the summary isn't at the position that the footer states. Records are therefore
    /// missing, or were inserted.
    Displaced,
    /// All records are readable, but their common checksum doesn't match. A byte has therefore changed at an unknown
    /// position.
    DataSection,
    /// Damage within one part of a recording.
    InPart {
        /// Number of the damaged part.
        part: u32,
        /// Damage in that part.
        kind: Box<LossKind>,
    },
    /// Parts missing from a recording. The number of the last one is `None` if unknown.
    PartsMissing {
        /// Number of the first missing part.
        first: u32,
        /// Number of the last missing part.
        last: Option<u32>,
    },
    /// A part whose totals contradict the totals in the next part's header.
    PartUnlike {
        /// Number of the part with contradicting totals.
        part: u32,
        /// Number of messages up to the end of this part, as this part states it.
        messages: u64,
        /// Number of messages up to the end of this part, as the next part's header states it.
        wanted: u64,
    },
    /// A file that is named like a part of a recording, but isn't a readable log.
    PartUnreadable {
        /// Part number that the file name states.
        part: u32,
        /// Reason why the file can't be read, which the text of the loss gives after a colon.
        why: String,
    },
    /// A part whose part metadata is unreadable, so that its number was taken from the file name.
    PartByName {
        /// Part number that the file name states.
        part: u32,
    },
    /// A loss that the log itself states: the recorder left messages out, or the log was recovered from a damaged
    /// one.
    Stated(String),
}

/// Kinds of items whose number is limited.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Many {
    /// Chunks, and runs of messages outside chunks.
    Pieces,
    /// Channels of the log.
    Channels,
    /// Sources of the log.
    Sources,
    /// Memory of definitions and metadata, bytes.
    HeaderBytes,
    /// Memory of attachments, bytes.
    AttachmentBytes,
}

impl Many {
    fn as_str(self) -> &'static str {
        match self {
            Self::Pieces => "chunks",
            Self::Channels => "channels",
            Self::Sources => "sources",
            Self::HeaderBytes => "bytes of definitions and metadata",
            Self::AttachmentBytes => "bytes of attachments",
        }
    }
}

/// A loss: a damaged range of a log.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Loss {
    /// Kind of damage.
    pub kind: LossKind,
    /// Offset of the damaged range in the file, bytes.
    pub offset: u64,
    /// Length of the damaged range in the file, bytes.
    pub bytes: u64,
    /// Receive time of the last message before the loss; `None` if unknown.
    pub from: Option<MonoNs>,
    /// Receive time of the first message after the loss; `None` if unknown.
    pub to: Option<MonoNs>,
}

impl fmt::Display for LossKind {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Truncated => out.write_str("the file ends before its closing records"),
            Self::Framing => out.write_str("bytes that aren't records"),
            Self::AnotherLog => out.write_str("another log begins in the same file and isn't read: save it as a file"),
            Self::Checksum => out.write_str("a chunk that fails its checksum"),
            Self::Contents => out.write_str("a chunk that can't be decompressed"),
            Self::Unreadable(error) => write!(out, "the medium can't read them: {error}"),
            Self::Compression(name) => write!(out, "a chunk compressed as {name:?}; zstd and lz4 are supported"),
            Self::TooLarge { limit } => {
                write!(out, "larger than the {limit} bytes that are read into memory")
            }
            Self::Swells { limit } => {
                write!(
                    out,
                    "chunks that would unpack to over {limit} times the length of the log: they are skipped"
                )
            }
            Self::Window { limit } => {
                write!(out, "a chunk whose unpacking would take more than {limit} bytes")
            }
            Self::Beyond { what, limit } => {
                write!(out, "more than {limit} {}: the rest isn't read", what.as_str())
            }
            Self::Stamped { messages, first } => write!(
                out,
                "{messages} messages stamped {first} ns or later: the latest time allowed is {} ns",
                LATEST.0
            ),
            Self::Missing { messages } => {
                write!(out, "{messages} messages are missing: their sequence numbers are skipped")
            }
            Self::Repeated { messages } => {
                write!(out, "{messages} messages are duplicates: their numbers occurred before")
            }
            Self::Disordered { messages } => {
                write!(out, "{messages} messages are out of order: they follow messages with higher numbers")
            }
            Self::Misplaced => out.write_str(
                "a chunk with a record that is not allowed in chunks, such as another chunk: the record is not read",
            ),
            Self::Attachment(name) => write!(out, "attachment {name:?} is damaged"),
            Self::Metadata(name) => write!(out, "metadata {name:?} is damaged"),
            Self::UnknownChannel { channel, messages } => {
                write!(out, "{messages} messages of channel {channel}, which the log doesn't define")
            }
            Self::Conflict { channel } => write!(out, "channel {channel} is defined twice, differently"),
            Self::Displaced => out.write_str(
                "whole records are missing or were inserted: the summary isn't where the log says",
            ),
            Self::DataSection => {
                out.write_str("a byte has changed: the checksum over the whole log does not match")
            }
            Self::Stated(words) => out.write_str(words),
            Self::InPart { part, kind } => write!(out, "part {part}: {kind}"),
            Self::PartsMissing { .. } | Self::PartUnlike { .. } | Self::PartUnreadable { .. } | Self::PartByName { .. } => {
                self.write_of_part(out)
            }
        }
    }
}

impl LossKind {
    /// Writes the text of a loss that concerns a whole part of a recording.
    fn write_of_part(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PartsMissing { first, last: None } => {
                write!(out, "part {first} of the recording is missing, and any after it")
            }
            Self::PartsMissing { first, last: Some(last) } if first == last => {
                write!(out, "part {first} of the recording is missing")
            }
            Self::PartsMissing { first, last: Some(last) } => {
                write!(out, "parts {first} to {last} of the recording are missing")
            }
            Self::PartUnlike { part, messages, wanted } => write!(
                out,
                "part {part} is not the one that was recorded: it states {messages} messages so far, but the next part \
                 states {wanted}"
            ),
            Self::PartUnreadable { part, why } => {
                write!(out, "the file that is named like part {part} can't be read: {why}")
            }
            Self::PartByName { part } => {
                write!(out, "part {part}: its number is unreadable and was taken from the file name")
            }
            _ => Ok(()),
        }
    }

    /// Whether the loss has a range of bytes in a file.
    fn has_place(&self) -> bool {
        match self {
            Self::InPart { kind, .. } => kind.has_place(),
            Self::Stated(_)
            | Self::PartsMissing { .. }
            | Self::PartUnlike { .. }
            | Self::PartUnreadable { .. }
            | Self::PartByName { .. } => false,
            _ => true,
        }
    }
}

impl Loss {
    /// The same loss with dive times.
    #[must_use]
    pub fn in_dive_time(&self, clock: DiveClock) -> Self {
        let dive_time = |at: MonoNs| MonoNs(0) + clock.time(at);
        Self { from: self.from.map(dive_time), to: self.to.map(dive_time), ..self.clone() }
    }

    /// Whether the loss is the cut-off end of the dive's last file.
    pub(crate) fn is_open_end(&self) -> bool {
        let kind = match &self.kind {
            LossKind::InPart { kind, .. } => kind,
            kind => kind,
        };
        *kind == LossKind::Truncated && self.to.is_none()
    }
}

impl fmt::Display for Loss {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut notes = Vec::new();
        match &self.kind {
            kind if !kind.has_place() => write!(out, "{kind}")?,
            LossKind::InPart { part, kind } => write!(out, "part {part}, byte {}: {kind}", self.offset)?,
            kind => write!(out, "byte {}: {kind}", self.offset)?,
        }
        if self.kind.has_place() {
            notes.push(format!("{} bytes", self.bytes));
        }
        notes.extend(self.from.map(|from| format!("after {:.3} s", from.as_secs_f64())));
        notes.extend(self.to.map(|to| format!("before {:.3} s", to.as_secs_f64())));
        if notes.is_empty() { Ok(()) } else { write!(out, " ({})", notes.join(", ")) }
    }
}

/// List of losses with a limited number of entries.
#[derive(Debug, Default)]
pub(super) struct Losses(Vec<Loss>);

impl Losses {
    pub(super) fn of(list: Vec<Loss>) -> Self {
        Self(list)
    }

    pub(super) fn list(&self) -> &[Loss] {
        &self.0
    }

    pub(super) fn list_mut(&mut self) -> &mut [Loss] {
        &mut self.0
    }

    /// Whether the list is full. Further losses then only extend the last entry.
    pub(super) fn is_full(&self) -> bool {
        self.0.len() >= MAX_LOSSES
    }

    /// Adds a range to the loss of the same kind, or adds a loss if the list has none of this kind.
    pub(super) fn extend(&mut self, kind: LossKind, offset: u64, bytes: u64) {
        if let Some(known) = self.0.iter_mut().rev().find(|loss| loss.kind == kind) {
            known.bytes = known.bytes.saturating_add(bytes);
        } else {
            self.push(Loss { kind, offset, bytes, from: None, to: None });
        }
    }

    pub(super) fn push(&mut self, loss: Loss) {
        tracing::debug!(%loss, "log is damaged");
        if !self.is_full() {
            self.0.push(loss);
        } else if let Some(last) = self.0.last_mut() {
            let end = loss.offset.saturating_add(loss.bytes);
            last.bytes = last.bytes.max(end.saturating_sub(last.offset));
            last.to = loss.to;
        }
    }
}
