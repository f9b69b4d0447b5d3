//! Recordings that did not end in order, because the program or the computer was stopped.

use std::collections::BTreeMap;
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

use headrace_geometry::time::{DiveClock, MonoNs};

use super::backlog::Tally;
use super::error::LogError;
use super::format::Tick;
use super::loss::{Loss, LossKind};
use super::part::{PartHead, Progress, named_part, part_path};
use super::reader::{LogInfo, LogReader, MessageKind};
use super::rotate::{files_of, in_the_way, part_head};
use super::writer::LogHeader;

/// A recording that did not end in order, and that a later dive can continue in a new part.
#[derive(Debug, Clone)]
pub struct Unfinished {
    /// Path that names the recording, as given to `--record`.
    pub recording: PathBuf,
    /// Header of the last part.
    pub info: LogInfo,
    /// Log time of the last message.
    pub last: MonoNs,
    /// First and last time of the log.
    pub span: Option<(MonoNs, MonoNs)>,
    /// Files of the recording's parts, in order; empty if none of them is at [`Self::recording`].
    pub files: Vec<PathBuf>,
    /// Identifier of the recording, which all parts of a dive share.
    pub dive: String,
    /// Number of the last part, and number in its file name.
    pub(super) number: u32,
    pub(super) named: u32,
    /// Totals of all readable messages.
    pub(super) progress: Progress,
    /// The last file, locked so that no other program continues the recording. `None` if the file system has no locks.
    _lock: Option<Arc<File>>,
}

/// An interrupted recording that is continued, and the statement about the interruption in its log.
#[derive(Debug, Clone)]
pub struct Interrupted {
    /// The recording before the interruption.
    pub recording: Unfinished,
    /// Log time at which the recording continues.
    pub to: MonoNs,
    /// Text about the interruption.
    pub words: String,
}

impl Interrupted {
    /// Returns the loss that the part after the interruption states.
    pub fn loss(&self) -> Loss {
        let Self { recording, to, words } = self;
        let kind = Box::new(LossKind::Stated(words.clone()));
        let kind = LossKind::InPart { part: recording.number + 1, kind };
        Loss { kind, offset: 0, bytes: 0, from: Some(recording.last), to: Some(*to) }
    }

    /// Returns the text of the loss, with dive times.
    pub fn loss_text(&self, clock: DiveClock) -> String {
        self.loss().in_dive_time(clock).to_string()
    }
}

impl Unfinished {
    /// Reads the recording named `recording`. Returns `None` if it ended in order, has no data, or is being written.
    /// Also returns `None` if the logs aren't parts of a recording.
    ///
    /// Errors: a log can't be read.
    pub fn read(recording: &Path) -> Result<Option<Self>, LogError> {
        let files = files_of(&[recording.to_owned()])?;
        let Some((last_file, head)) = unended(&files)?.map(|(file, head)| (file.to_owned(), head)) else {
            return Ok(None);
        };
        let lock = match File::open(&last_file).map(|file| (file.try_lock(), file)) {
            Ok((Err(TryLockError::WouldBlock), _)) => return Ok(None),
            Ok((Ok(()), file)) => Some(Arc::new(file)),
            // Some file systems have no locks.
            Ok((Err(TryLockError::Error(_)), _)) | Err(_) => None,
        };
        let span = span_of(&files);
        let mut reader = LogReader::open(&last_file)?;
        let topics: BTreeMap<u16, String> =
            reader.channels().map(|channel| (channel.id, channel.topic.to_owned())).collect();
        let (mut last, mut progress) = (span.map(|(_, last)| last), head.before.clone());
        let mut counts: BTreeMap<u16, u32> = BTreeMap::new();
        while let Some(message) = reader.next()? {
            last = Some(message.log_time);
            progress.messages += 1;
            if message.kind == MessageKind::Tick {
                progress.tick = Tick::decode(message.data).ok().map(|tick| tick.index).or(progress.tick);
            }
            counts.insert(message.channel, message.sequence.wrapping_add(1));
        }
        let next =
            counts.into_iter().filter_map(|(channel, next)| Some((topics.get(&channel)?.clone(), next)));
        progress.sequences.extend(next);
        let named = files.iter().filter_map(|file| named_part(file)).map(|(_, number)| number).max();
        let (info, dive, number) = (reader.header().clone(), head.dive, head.number);
        let unfinished = |last| Self {
            recording: recording.to_owned(),
            info,
            last,
            span,
            files,
            dive,
            number,
            named: named.unwrap_or(1),
            progress,
            _lock: lock,
        };
        Ok(last.map(unfinished))
    }

    /// Returns the name of the latest recording in a folder, as a path. `None` if that recording can't be continued.
    ///
    /// The latest recording is the one whose file was modified last. Files that aren't parts of a recording are
    /// ignored. Logs for which `is_other` returns true are ignored too.
    ///
    /// Errors: the folder can't be read.
    pub fn last_in(folder: &Path, is_other: &dyn Fn(&LogInfo) -> bool) -> Result<Option<PathBuf>, LogError> {
        let failed = |source| LogError::Open { path: folder.to_owned(), source };
        let is_here = folder == Path::new(".");
        let mut logs: Vec<(SystemTime, PathBuf)> = Vec::new();
        for entry in std::fs::read_dir(folder).map_err(failed)? {
            let entry = entry.map_err(failed)?;
            let path = if is_here { entry.file_name().into() } else { folder.join(entry.file_name()) };
            let is_log = path.extension().is_some_and(|extension| extension == "mcap");
            if let Ok(modified) = entry.metadata().and_then(|metadata| metadata.modified())
                && is_log
            {
                logs.push((modified, path));
            }
        }
        logs.sort();
        for (_, path) in logs.into_iter().rev().filter(|(_, path)| part_head(path).is_some()) {
            let Ok(reader) = LogReader::open(&path) else { continue };
            if is_other(reader.header()) {
                continue;
            }
            let recording = named_part(&path).map_or(path, |(recording, _)| recording);
            let files = files_of(std::slice::from_ref(&recording))?;
            return Ok(unended(&files)?.map(|_| recording));
        }
        Ok(None)
    }

    /// Whether the recording named `recording` exists and can be continued, by the conditions of [`Unfinished::read`].
    ///
    /// Errors: a log can't be read.
    pub fn is_at(recording: &Path) -> Result<bool, LogError> {
        let files = files_of(&[recording.to_owned()])?;
        let has_head = files.iter().any(|file| part_head(file).is_some());
        Ok(has_head && unended(&files)?.is_some())
    }

    /// Returns the recording, to be continued at another path. `None` if that path already has parts of the dive.
    #[must_use]
    pub fn at(&self, recording: &Path) -> Option<Self> {
        let present = in_the_way(recording).unwrap_or_default();
        if present.iter().any(|file| part_head(file).is_some_and(|head| head.dive == self.dive)) {
            return None;
        }
        let named = present.iter().map(|file| named_part(file).map_or(1, |(_, number)| number)).max();
        Some(Self {
            recording: recording.to_owned(),
            files: Vec::new(),
            named: self.named.max(named.unwrap_or(0)),
            _lock: None,
            ..self.clone()
        })
    }

    /// Returns the path of the last part.
    pub fn last_part(&self) -> &Path {
        self.files.last().unwrap_or(&self.recording)
    }

    /// Returns the number of the next tick.
    pub fn next_tick(&self) -> u64 {
        self.progress.tick.map_or(0, |tick| tick + 1)
    }

    /// Returns the path of the part in which the recording continues.
    pub fn next_path(&self) -> PathBuf {
        part_path(&self.recording, self.named + 1)
    }

    pub(super) fn tally(&self, header: &LogHeader) -> Tally {
        Tally::of(&self.progress, header, self.last)
    }
}

/// Returns the first and last log time of a recording's files. Only the first and last files with data are opened: a dive
/// goes on after a failure within 2 s, even if it has hundreds of parts.
fn span_of(files: &[PathBuf]) -> Option<(MonoNs, MonoNs)> {
    let times = |file: &PathBuf| LogReader::open(file).ok()?.times();
    let (first, _) = files.iter().find_map(times)?;
    let (_, last) = files.iter().rev().find_map(times)?;
    Some((first, last))
}

/// Returns the last part of a recording and its metadata, if the recording has data, did not end in order, and isn't being
/// written.
fn unended(files: &[PathBuf]) -> Result<Option<(&Path, PartHead)>, LogError> {
    let heads = files.iter().filter_map(|file| Some((file, part_head(file)?)));
    let Some((last, head)) = heads.max_by_key(|(_, head)| head.number) else { return Ok(None) };
    let reader = LogReader::open(last)?;
    let end = reader.header().part.as_ref().and_then(|part| part.end.as_ref());
    let has_ended = end.is_some_and(|end| !end.follows);
    let is_empty = head.number == 1 && reader.times().is_none();
    // The newest file may not have its header yet.
    let is_open = is_being_written(last) || files.last().is_some_and(|file| is_being_written(file));
    Ok(if has_ended || is_empty || is_open { None } else { Some((last.as_path(), head)) })
}

/// Whether a program holds the lock of a log that it writes.
fn is_being_written(log: &Path) -> bool {
    File::open(log).is_ok_and(|file| matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)))
}
