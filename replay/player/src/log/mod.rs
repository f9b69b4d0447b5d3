//! The dive log: an MCAP file with the bytes of every device as received, the order in which the loop consumed them, and
//! the loop's results.
//!
//! [`mod@format`] names channels and metadata and lays out `/loop/tick`. [`LogWriter`] writes a log, [`Recorder`] does so
//! on a thread of its own behind a lock-free queue, and [`LogReader`] reads logs, ours and others', whole or damaged.
//!
//! A log that we write, in the order of the file:
//!
//! | record | content |
//! |---|---|
//! | metadata `headrace` | [`format::FORMAT_KEY`] and the caller's entries: version, digest of the configuration, clock anchors |
//! | metadata `headrace.part` | only of a recording: identity of this part of it ([`PartHead`]) |
//! | attachments | `vehicle.toml` and the files that it names |
//! | a chunk | definitions of all channels, nothing else |
//! | metadata `headrace.channels` | the same definitions again, so that a log survives the loss of that chunk |
//! | metadata `headrace.losses` | only where something is missing: description and time span ([`format::LOSSES`]) |
//! | chunks | messages, each chunk at most half a second of a dive |
//! | metadata `headrace.part.end` | only of a recording: whether another part follows ([`PartEnd`]) |
//! | summary | indexes for viewers |
//!
//! [`DiveLog`] reads one log, or the parts of a recording as one.
//!
//! Recordings of voice notes ([`voice`]) have chunks of their own.
//!
//! The numbers of a channel's messages have no gaps in a log and go on in the next part. Readers report where ours have:
//! records were removed, repeated or moved. A log of ours that is closed without a summary has lost its end.
//!
//! The file is append-only: written bytes are never modified, so a power cut can't damage them. After an error of the medium a
//! file is left as it is, without an end, and the recording goes on in another part, which repeats what wasn't synced: its
//! [`PartHead`] says from which message of each channel on. Readers leave these out of the part before.

#![cfg_attr(not(test), warn(clippy::indexing_slicing))]

mod backlog;
mod channels;
mod chunk;
mod derived_channels;
mod digest;
mod dive_log;
mod error;
mod fault;
mod fields;
pub mod format;
mod framing;
mod limits;
mod loss;
mod medium;
mod merge;
mod numbering;
mod part;
mod queue;
mod reader;
mod recorder;
mod recording;
mod recover;
mod rotate;
mod scan;
mod search;
mod space;
mod storage;
mod trim;
mod unzstd;
pub mod voice;
mod worker;
mod writer;

pub use derived_channels::{DerivedChannels, Made};
pub use digest::{file_digest, files_digest};
pub use dive_log::{DiveLog, DivePlace, PartFile};
pub use error::LogError;
pub use fault::{RecordingEvent, RecordingFault};
pub use loss::{Loss, LossKind, Many};
pub use part::{Part, PartEnd, PartHead, Progress, dive_name, named_part, part_path};
pub use queue::{Full, LinePort};
pub use reader::{ChannelInfo, LogInfo, LogMessage, LogPlace, LogReader, MessageKind};
pub use recorder::{Recorder, RecorderHandle, RecorderPort};
pub use recover::{RECOVERED_FROM, Recovered, recover};
pub use rotate::{Every, Rotation, files_of, in_the_way};
pub use space::LeftOut;
pub use storage::{Disk, Storage, StoredFile};
pub use trim::{Change, TRIMMED, Trim, Trimmed, trim};
pub use voice::VoicePort;
pub use worker::RecorderWorker;
pub use writer::{LogHeader, LogWriter, PartSummary, ResultChannel, SourceInfo, Summary};

#[cfg(test)]
mod tests;
