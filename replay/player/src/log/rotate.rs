//! Rotation of a recording in parts, on the recorder's thread.
//!
//! Parts end between ticks, so that each contains whole ticks. The next part is created, with its header synced, before the
//! previous is ended: if the disk refuses a new file, only the rotation fails and the recording goes on.

use std::io::Write;
use std::path::{Path, PathBuf};

use headrace_geometry::time::{DurNs, MonoNs};

use super::LogError;
use super::part::{PartHead, named_part};
use super::writer::{Lane, LogHeader, LogWriter, PartSummary, Summary};

/// When a part of a recording ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Every {
    /// Once its file has that many bytes; the second in which it reaches them is still in it.
    Bytes(u64),
    /// Once its messages span that much of the dive's time.
    Span(DurNs),
}

/// How a recording is split into parts.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Rotation {
    /// When a part ends.
    pub every: Every,
    /// Unique identifier of the recording, see [`super::dive_name`].
    pub dive: String,
}

/// Creates the file of the part with that number.
pub(super) type OpenPart<W> = Box<dyn FnMut(u32) -> Result<(PathBuf, W), LogError> + Send>;

/// The parts of a recording.
pub(super) struct Parts<W: Write> {
    every: Every,
    /// Header of every part; `part` is the current one's.
    header: LogHeader,
    open: OpenPart<W>,
    path: PathBuf,
    /// Log time of the part's first message, or of the last failed rotation.
    began: Option<MonoNs>,
    /// File size from which the part is due to end, bytes.
    ends_at: u64,
    /// Whether packets have been written whose tick hasn't.
    within_tick: bool,
    /// Totals of the ended parts.
    sum: Summary,
}

impl<W: Write> Parts<W> {
    /// Begins the first part.
    ///
    /// Errors: its file can't be created or written.
    pub(super) fn begin(
        rotation: &Rotation,
        header: &LogHeader,
        mut open: OpenPart<W>,
    ) -> Result<(Self, LogWriter<W>), LogError> {
        let (path, writer) = open(1)?;
        let part = PartHead { dive: rotation.dive.clone(), number: 1, ..PartHead::default() };
        let header = LogHeader { part: Some(part), ..header.clone() };
        let log = LogWriter::new(writer, &header)?;
        let ends_at = match rotation.every {
            Every::Bytes(bytes) => bytes,
            Every::Span(_) => u64::MAX,
        };
        let every = rotation.every;
        let (began, within_tick, sum) = (None, false, Summary::default());
        Ok((Self { every, header, open, path, began, ends_at, within_tick, sum }, log))
    }

    /// Whether the part should end before a message.
    pub(super) fn is_due(&mut self, lane: Lane, at: MonoNs, log: &LogWriter<W>) -> bool {
        let between = match lane {
            Lane::Raw(_) => !core::mem::replace(&mut self.within_tick, true),
            Lane::Tick => {
                self.within_tick = false;
                false
            }
            Lane::Sent(_) | Lane::Result(_) => false,
        };
        let began = *self.began.get_or_insert(at);
        between
            && match self.every {
                Every::Bytes(_) => log.bytes() >= self.ends_at,
                Every::Span(span) => at.since(began) >= span,
            }
    }

    /// Begins the next part, whose first message has time `at`, and ends the last.
    ///
    /// Errors: the last can't be ended. If the next can't be begun, the last goes on with a warning; that is not an error.
    pub(super) fn rotate(&mut self, at: MonoNs, log: &mut LogWriter<W>) -> Result<(), LogError> {
        self.began = Some(at);
        let begun = self.next(log);
        let (path, header, next) = match begun {
            Ok(begun) => begun,
            Err(error) => {
                tracing::warn!("the recording goes on in {}: {error}", self.path.display());
                if let Every::Bytes(bytes) = self.every {
                    self.ends_at = log.bytes().saturating_add(bytes);
                }
                return Ok(());
            }
        };
        let last = core::mem::replace(log, next);
        let last_path = core::mem::replace(&mut self.path, path);
        self.header = header;
        tracing::info!(from = %last_path.display(), to = %self.path.display(), "recording goes on in the next part");
        if let Every::Bytes(bytes) = self.every {
            self.ends_at = bytes;
        }
        end(last, last_path, true, &mut self.sum)
    }

    /// Creates the next part and writes its header.
    fn next(&mut self, log: &mut LogWriter<W>) -> Result<(PathBuf, LogHeader, LogWriter<W>), LogError> {
        let part = self.header.part.as_ref();
        let part = PartHead {
            dive: part.map(|part| part.dive.clone()).unwrap_or_default(),
            number: part.map_or(1, |part| part.number + 1),
            before: log.progress(&self.header),
        };
        let (path, writer) = (self.open)(part.number)?;
        let header = LogHeader { part: Some(part), ..self.header.clone() };
        let begun = LogWriter::new(writer, &header).and_then(|mut next| next.flush().map(|()| next));
        if begun.is_err() {
            // A file without a header is no part.
            std::fs::remove_file(&path).ok();
        }
        Ok((path, header, begun?))
    }

    /// Ends the last part, and returns the totals of all parts.
    ///
    /// Errors: the writer's.
    pub(super) fn finish(mut self, log: LogWriter<W>) -> Result<Summary, LogError> {
        end(log, self.path, false, &mut self.sum)?;
        Ok(self.sum)
    }
}

/// Ends a part, and adds it to the totals.
fn end<W: Write>(
    mut log: LogWriter<W>,
    path: PathBuf,
    follows: bool,
    sum: &mut Summary,
) -> Result<(), LogError> {
    log.end_part(follows)?;
    let (_, part) = log.finish()?;
    sum.messages += part.messages;
    sum.message_bytes += part.message_bytes;
    sum.chunks = sum.chunks.saturating_add(part.chunks);
    sum.bytes += part.bytes;
    sum.raw_messages += part.raw_messages;
    sum.parts.push(PartSummary { path, raw_messages: part.raw_messages });
    Ok(())
}

/// An existing file that would be taken for this recording or a part of it.
pub(super) fn in_the_way(recording: &Path) -> std::io::Result<Option<PathBuf>> {
    if recording.exists() {
        return Ok(Some(recording.to_owned()));
    }
    parts_of(recording).map(|parts| parts.into_iter().next())
}

/// The files next to a recording that are named as its parts, in order.
pub(super) fn parts_of(recording: &Path) -> std::io::Result<Vec<PathBuf>> {
    let folder = recording.parent().filter(|folder| !folder.as_os_str().is_empty());
    let mut parts = Vec::new();
    for entry in std::fs::read_dir(folder.unwrap_or(Path::new(".")))? {
        let path = recording.with_file_name(entry?.file_name());
        if let Some((of, number)) = named_part(&path)
            && of == recording
        {
            parts.push((number, path));
        }
    }
    parts.sort();
    Ok(parts.into_iter().map(|(_, path)| path).collect())
}
