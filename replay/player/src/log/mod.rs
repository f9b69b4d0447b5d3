//! The dive log: an MCAP file with the received bytes of every device, their order of consumption, and the loop's
//! results.
//!
//! [`mod@format`] names channels and metadata and defines `/loop/tick`. [`LogWriter`] writes a log. [`Recorder`] writes
//! a log on its own thread, behind a lock-free queue. [`LogReader`] reads logs of this program and of others, intact or
//! damaged.
//!
//! A log of this program, in file order:
//!
//! | record | content |
//! |---|---|
//! | metadata `headrace` | [`format::FORMAT_KEY`] and the caller's entries: version, digest of the configuration, clock anchors |
//! | metadata `headrace.part` | only in a recording: identity of this part ([`PartHead`]) |
//! | attachments | `vehicle.toml` and the files that it names |
//! | a chunk | definitions of all channels, nothing else |
//! | metadata `headrace.channels` | the same definitions again, so that a log survives the loss of that chunk |
//! | metadata `headrace.losses` | only if something is missing: description and time span ([`format::LOSSES`]) |
//! | chunks | messages, each chunk at most half a second of a dive |
//! | metadata `headrace.part.end` | only in a recording: whether another part follows ([`PartEnd`]) |
//! | summary | indexes for viewers |
//!
//! [`DiveLog`] reads one log, or the parts of a recording as one. Recordings of voice notes ([`voice`]) have their own
//! chunks.
//!
//! The message numbers of a channel have no gaps and continue in the next part. In this program's logs, numbers that
//! aren't consecutive show removed, repeated or moved records, and readers report them. A closed log of this program
//! without a summary has lost its end.
//!
//! The file is append-only: written bytes are never modified, so a power cut can't damage them. After an error of the
//! medium a file is left without an end. The recording continues in another part, which repeats the messages that
//! weren't synced. Its [`PartHead`] states the first repeated message of each channel, and readers skip these messages
//! in the previous part.

#![cfg_attr(not(test), warn(clippy::indexing_slicing))]

mod backlog;
mod channels;
mod chunk;
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
mod unfinished;
pub mod voice;
mod worker;
mod writer;

pub use digest::{file_digest, files_digest};
pub use dive_log::{DiveLog, DivePlace, PartFile};
pub use error::LogError;
pub use fault::{RecordingEvent, RecordingFault, RecordingHealth};
pub use loss::{Loss, LossKind, Many};
pub use part::{Part, PartEnd, PartHead, Progress, dive_name, named_part, part_path};
pub use queue::{Full, LinePort};
pub use reader::{ChannelInfo, LogInfo, LogMessage, LogPlace, LogReader, MessageKind};
pub use recorder::{Recorder, RecorderHandle, RecorderPort};
pub use recover::{RECOVERED_FROM, Recovered, recover};
pub use rotate::{Every, Rotation, files_of, in_the_way};
pub use space::{LeftOut, WARN_BELOW_BYTES};
pub use storage::{Disk, Storage, StoredFile};
pub use trim::{Change, TRIMMED, Trim, Trimmed, trim};
pub use unfinished::{Interrupted, Unfinished};
pub use voice::VoicePort;
pub use worker::{DerivedChannels, Made, RecorderWorker};
pub use writer::{LogHeader, LogWriter, PartSummary, ResultChannel, SourceInfo, Summary};

#[cfg(test)]
mod tests;
