//! A dive's log: one file, or the parts of a recording read as one log.
//!
//! Parts are ordered by the part numbers that they contain, not by file names. Opening scans each part once; afterwards
//! the parts are read in order. The totals of earlier parts, which the header of each part has, show whether a part is
//! missing or was replaced.

use std::fs::File;
use std::io::{Read, Seek};
use std::path::{Path, PathBuf};

use headrace_geometry::time::MonoNs;
use serde::{Deserialize, Serialize};

use super::error::LogError;
use super::limits::MAX_SOURCES;
use super::loss::{Loss, LossKind};
use super::part::{Part, Progress, named_part};
use super::reader::{LogInfo, LogMessage, LogPlace, LogReader, MessageKind};
use super::writer::SourceInfo;

/// A file of a dive's log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PartFile {
    /// Path of the log file.
    pub path: PathBuf,
    /// Number of raw messages read from the file so far.
    pub messages: u64,
    /// Part number of the file, if the recording has parts.
    number: Option<u32>,
}

/// Opens the file with this index in the list of files.
type Open<R> = Box<dyn FnMut(usize) -> Result<LogReader<R>, LogError> + Send>;

/// A position in a dive's log, to continue reading from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct DivePlace {
    /// Index of the file in the dive's list of files from which reading continues.
    at: usize,
    place: LogPlace,
    /// Number of raw messages read from each file.
    messages: Vec<u64>,
    earlier: Vec<Loss>,
    late: u64,
    delivered: u64,
}

/// Reads a dive's log from one or several files.
pub struct DiveLog<R = File> {
    open: Open<R>,
    files: Vec<PartFile>,
    /// Index of the file being read.
    at: usize,
    reader: LogReader<R>,
    info: LogInfo,
    has_ticks: bool,
    /// For each source of the file being read, its source number in the dive.
    numbers: Vec<u16>,
    topics: Vec<String>,
    /// Losses outside the files, such as parts that are missing before, between or after the files.
    between: Vec<Loss>,
    /// Losses found in the files that have been read to their end.
    earlier: Vec<Loss>,
    late: u64,
    times: Option<(MonoNs, MonoNs)>,
    /// For each file, its continuation in the next file if the file was cut off.
    resumed: Vec<Option<Resumed>>,
    /// Number of messages delivered from the file being read.
    delivered: u64,
}

/// Continuation of a recording in the next part, after a part was cut off.
#[derive(Debug, Clone)]
struct Resumed {
    /// Totals of the messages before the next part. The next part repeats all messages that come after these totals.
    before: Progress,
    /// Number of messages in the cut-off part that the next part doesn't repeat.
    messages: u64,
    /// First log time of the next part.
    at: Option<MonoNs>,
}

impl DiveLog<File> {
    /// Opens a log, or the parts of a recording; see [`super::files_of`].
    ///
    /// Errors: a file can't be read, isn't MCAP, or has a later format; several files aren't parts of one recording.
    pub fn open(files: &[PathBuf]) -> Result<Self, LogError> {
        let log = match files {
            [file] => Self::single(LogReader::open(file)?, file),
            files => Self::parts(files)?,
        };
        let span_s = log.times.map(|(from, to)| to.since(from).as_secs_f64());
        tracing::info!(files = ?files, sources = log.info.sources.len(), ticks = log.has_ticks, span_s, "log opened");
        Ok(log)
    }

    fn single(reader: LogReader<File>, file: &Path) -> Self {
        let path = file.to_owned();
        let number = reader.header().part.as_ref().map(|part| part.head.number);
        let between = between(&[Glance::of(&reader, number.unwrap_or_default())], &[]);
        let files = vec![PartFile { path: path.clone(), messages: 0, number }];
        Self::start(Box::new(move |_| LogReader::open(&path)), reader, files, between)
    }

    fn parts(files: &[PathBuf]) -> Result<Self, LogError> {
        let Arranged { parts, mut losses } = arrange(files)?;
        let glances: Vec<Glance> = parts.iter().map(|(_, glance)| glance.clone()).collect();
        let missing = between(&glances, &losses);
        losses.extend(missing);
        let files: Vec<PartFile> = parts
            .into_iter()
            .map(|(path, glance)| PartFile { path, messages: 0, number: Some(glance.number) })
            .collect();
        let paths: Vec<PathBuf> = files.iter().map(|file| file.path.clone()).collect();
        let open = Box::new(move |at: usize| {
            let path = paths.get(at).map(PathBuf::as_path);
            LogReader::open(path.unwrap_or(Path::new("")))
        });
        let first = open(0)?;
        let times = glances.iter().filter_map(|glance| glance.times);
        let times = times.reduce(|all, one| (all.0.min(one.0), all.1.max(one.1)));
        let mut log = Self { times, resumed: resumed(&glances), ..Self::start(open, first, files, losses) };
        log.pass_over();
        Ok(log)
    }
}

impl<R: Read + Seek> DiveLog<R> {
    /// Creates a dive log with a single file, from its reader.
    pub fn of(reader: LogReader<R>) -> Self {
        let file = PartFile { path: PathBuf::new(), messages: 0, number: None };
        // A single log has no second file to open, so this function is never called.
        let open = |_| Err(LogError::NoLogs { folder: PathBuf::new() });
        Self::start(Box::new(open), reader, vec![file], Vec::new())
    }

    fn start(open: Open<R>, mut reader: LogReader<R>, files: Vec<PartFile>, between: Vec<Loss>) -> Self {
        let attachments = reader.take_attachments();
        let mut info = LogInfo { attachments, ..reader.header().clone() };
        if files.len() > 1 {
            info.part = None;
        }
        let mut log = Self {
            open,
            files,
            at: 0,
            has_ticks: reader.has_ticks(),
            reader,
            info,
            numbers: Vec::new(),
            topics: Vec::new(),
            between,
            earlier: Vec::new(),
            late: 0,
            times: None,
            resumed: Vec::new(),
            delivered: 0,
        };
        log.times = log.reader.times();
        log.number_sources();
        log
    }

    /// Returns the log's header. If there are several parts, it is the first part's header.
    pub fn header(&self) -> &LogInfo {
        &self.info
    }

    /// Returns the topics of the result channels known so far.
    pub(crate) fn result_topics(&self) -> Vec<String> {
        self.channels_found().0
    }

    /// Whether the log contains the ticks of the loop that wrote it.
    pub fn has_ticks(&self) -> bool {
        self.has_ticks
    }

    /// Whether the file being read has a channel of voice recordings.
    pub(super) fn has_voices(&self) -> bool {
        self.reader.has_voices()
    }

    /// Skips messages earlier than `at`, judged by the chunk headers. Call it before reading the first message.
    ///
    /// Errors: a later file of the log can't be opened.
    pub(super) fn pass_before(&mut self, at: MonoNs) -> Result<(), LogError> {
        while self.at + 1 < self.files.len() && self.reader.times().is_none_or(|(_, last)| last < at) {
            self.go_on()?;
        }
        self.reader.pass_before(at);
        Ok(())
    }

    /// Returns the files of the dive's log, in reading order.
    pub fn files(&self) -> &[PartFile] {
        &self.files
    }

    /// Returns damage and gaps found so far. The list is complete when [`DiveLog::next`] has returned `None`.
    pub fn losses(&self) -> Vec<Loss> {
        let present = self.reader.losses().iter().filter_map(|loss| self.in_part(loss));
        self.between.iter().chain(&self.earlier).cloned().chain(present).collect()
    }

    /// Returns the first and last log time, from the chunk headers.
    pub fn times(&self) -> Option<(MonoNs, MonoNs)> {
        self.times
    }

    /// Returns the topics with several channels in the file being read, each with its channel numbers.
    ///
    /// Channels of the same topic share one source.
    pub fn doubles(&self) -> Vec<(String, Vec<u16>)> {
        self.reader.doubles()
    }

    /// Whether any damage or gap has been found so far.
    pub fn has_losses(&self) -> bool {
        !(self.between.is_empty() && self.earlier.is_empty() && self.reader.losses().is_empty())
    }

    /// Returns the number of messages delivered out of order, which means after a message with a later log time. It is
    /// 0 for a log with ticks.
    pub fn late(&self) -> u64 {
        self.late + self.reader.late()
    }

    /// Returns the result topics and the sources of all channels read so far.
    pub(super) fn channels_found(&self) -> (Vec<String>, Vec<SourceInfo>) {
        let mut topics = self.topics.clone();
        topics.extend(self.reader.result_topics().into_iter().filter(|topic| !self.topics.contains(topic)));
        let mut all = self.info.sources.clone();
        let known = |id: &str| self.info.sources.iter().any(|source| source.id == id);
        all.extend(self.reader.sources().iter().filter(|source| !known(&source.id)).cloned());
        (topics, all)
    }

    /// Returns the name of a source, by its number in messages. Only sources of channels read so far are known.
    pub fn source_id(&self, source: u16) -> Option<&str> {
        self.info.sources.get(usize::from(source)).map(|source| source.id.as_str())
    }

    /// Returns the next message; `None` at the end.
    ///
    /// Errors: an I/O error. Damage is not an error.
    #[expect(
        clippy::should_implement_trait,
        reason = "messages borrow from the reader, which no Iterator allows"
    )]
    pub fn next(&mut self) -> Result<Option<LogMessage<'_>>, LogError> {
        while !self.reader.has_next()? {
            if self.at + 1 >= self.files.len() {
                return Ok(None);
            }
            self.go_on()?;
        }
        if self.numbers.len() != self.reader.sources().len() {
            self.number_sources();
        }
        let Self { reader, numbers, files, at, delivered, .. } = self;
        let Some(mut message) = reader.next()? else { return Ok(None) };
        *delivered += 1;
        match &mut message.kind {
            MessageKind::Raw { source } => {
                *source = numbers.get(usize::from(*source)).copied().unwrap_or(*source);
                if let Some(file) = files.get_mut(*at) {
                    file.messages += 1;
                }
            }
            MessageKind::Sent { source } => {
                *source = numbers.get(usize::from(*source)).copied().unwrap_or(*source);
            }
            _ => {}
        }
        Ok(Some(message))
    }

    /// Returns the current reading position.
    pub fn place(&self) -> DivePlace {
        DivePlace {
            at: self.at,
            place: self.reader.place(),
            messages: self.files.iter().map(|file| file.messages).collect(),
            earlier: self.earlier.clone(),
            late: self.late,
            delivered: self.delivered,
        }
    }

    /// Continues from a position of this reader, or of another reader of the same files; see [`LogReader::go_to`].
    ///
    /// Errors: an I/O error.
    pub fn go_to(&mut self, place: &DivePlace) -> Result<(), LogError> {
        if place.at != self.at {
            self.reader = (self.open)(place.at)?;
            self.at = place.at;
            self.pass_over();
        }
        for (file, messages) in self.files.iter_mut().zip(&place.messages) {
            file.messages = *messages;
        }
        (self.earlier, self.late, self.delivered) = (place.earlier.clone(), place.late, place.delivered);
        self.reader.go_to(&place.place)?;
        // The known sources depend on the position in the log, so the sources are numbered again.
        self.number_sources();
        Ok(())
    }

    /// Moves on to the next file of the dive's log.
    fn go_on(&mut self) -> Result<(), LogError> {
        let read: Vec<Loss> = self.reader.losses().iter().filter_map(|loss| self.in_part(loss)).collect();
        self.earlier.extend(read);
        (self.topics, self.info.sources) = self.channels_found();
        self.late += self.reader.late();
        self.at += 1;
        self.reader = (self.open)(self.at)?;
        self.delivered = 0;
        self.number_sources();
        self.pass_over();
        Ok(())
    }

    /// Excludes the messages of the current file that the next file repeats.
    fn pass_over(&mut self) {
        if let Some(Some(resumed)) = self.resumed.get(self.at) {
            self.reader.pass_over(&resumed.before);
        }
    }

    /// Maps the file's sources to the dive's sources by name. Adds new sources, up to the limit for all files.
    fn number_sources(&mut self) {
        self.numbers.clear();
        for source in self.reader.sources() {
            let known = self.info.sources.iter().position(|known| known.id == source.id);
            let number = known.or_else(|| {
                let fits = self.info.sources.len() < MAX_SOURCES;
                fits.then(|| self.info.sources.push(source.clone())).map(|()| self.info.sources.len() - 1)
            });
            self.numbers.push(number.and_then(|number| u16::try_from(number).ok()).unwrap_or(u16::MAX));
        }
    }

    /// Converts a loss of the file being read to a loss of the dive; `None` if the next part has the lost messages.
    fn in_part(&self, loss: &Loss) -> Option<Loss> {
        let mut loss = loss.clone();
        if let Some(Some(resumed)) = self.resumed.get(self.at) {
            // The next part repeats all messages that weren't delivered, and states the fault. The truncation therefore
            // loses nothing.
            if loss.kind == LossKind::Truncated && self.delivered == resumed.messages {
                return None;
            }
            loss.to = loss.to.or(resumed.at);
        }
        let file = self.files.get(self.at).filter(|_| self.files.len() > 1);
        if let Some(part) = file.and_then(|file| file.number) {
            loss.kind = LossKind::InPart { part, kind: Box::new(loss.kind) };
        }
        Some(loss)
    }
}

/// Part number, part metadata and times of a file, from its first scan.
#[derive(Debug, Clone)]
struct Glance {
    number: u32,
    part: Option<Part>,
    times: Option<(MonoNs, MonoNs)>,
}

impl Glance {
    fn of<R: Read + Seek>(reader: &LogReader<R>, number: u32) -> Self {
        Self { number, part: reader.header().part.clone(), times: reader.times() }
    }
}

/// Parts of a recording in order, and the losses of unreadable parts.
struct Arranged {
    parts: Vec<(PathBuf, Glance)>,
    losses: Vec<Loss>,
}

/// Scans each file, and sorts the files by part number.
fn arrange(files: &[PathBuf]) -> Result<Arranged, LogError> {
    let (mut parts, mut losses): (Vec<(PathBuf, Glance)>, _) = (Vec::new(), Vec::new());
    let mut unread = None;
    for path in files {
        let by_name = named_part(path).map(|(_, number)| number);
        match (LogReader::open(path), by_name) {
            (Ok(reader), by_name) => match (&reader.header().part, by_name) {
                (Some(part), _) => parts.push((path.clone(), Glance::of(&reader, part.head.number))),
                // The power was cut while this part's header was written. The next part therefore has the same number.
                (None, Some(part)) if reader.times().is_none() && !reader.losses().is_empty() => {
                    let why = "it ends within its header".to_owned();
                    losses.push(loss(LossKind::PartUnreadable { part, why }, None, None));
                    unread = Some(LogError::NotAPart { path: path.clone() });
                }
                (None, Some(number)) if !reader.losses().is_empty() => {
                    losses.push(loss(LossKind::PartByName { part: number }, None, None));
                    parts.push((path.clone(), Glance::of(&reader, number)));
                }
                _ => return Err(LogError::NotAPart { path: path.clone() }),
            },
            // The file has no MCAP header, for instance because it was created just before a power cut and is empty.
            (Err(LogError::NotMcap { name, found, wanted }), Some(part)) => {
                let why = format!("it begins with [{found}], which no MCAP file does");
                losses.push(loss(LossKind::PartUnreadable { part, why }, None, None));
                unread = Some(LogError::NotMcap { name, found, wanted });
            }
            (Err(error), _) => return Err(error),
        }
    }
    parts.sort_by_key(|(_, glance)| glance.number);
    agree(&parts)?;
    match unread {
        Some(error) if parts.is_empty() => Err(error),
        _ => Ok(Arranged { parts, losses }),
    }
}

/// Checks that all parts belong to one recording, and that no part occurs twice.
fn agree(parts: &[(PathBuf, Glance)]) -> Result<(), LogError> {
    let dive = |glance: &Glance| glance.part.as_ref().map(|part| part.head.dive.clone());
    let mut named = parts.iter().filter_map(|(path, glance)| Some((path, dive(glance)?)));
    if let Some((one, one_dive)) = named.next()
        && let Some((other, other_dive)) = named.find(|(_, dive)| *dive != one_dive)
    {
        return Err(LogError::OtherDive { one: one.clone(), one_dive, other: other.clone(), other_dive });
    }
    for pair in parts.windows(2) {
        if let [(one, first), (other, second)] = pair
            && first.number == second.number
        {
            return Err(LogError::PartTwice { number: first.number, one: one.clone(), other: other.clone() });
        }
    }
    Ok(())
}

/// Returns losses before, between and after the parts of a recording. `unread` are the losses of unreadable parts.
fn between(parts: &[Glance], unread: &[Loss]) -> Vec<Loss> {
    let mut losses = Vec::new();
    let from = |glance: &Glance| glance.times.map(|times| times.1);
    let to = |glance: &Glance| glance.times.map(|times| times.0);
    if let Some(first) = parts.first().filter(|first| first.number > 1) {
        losses.push(loss(missing(1, first.number - 1), None, to(first)));
    }
    for pair in parts.windows(2) {
        let [one, next] = pair else { continue };
        if one.number + 1 < next.number {
            losses.push(loss(missing(one.number + 1, next.number - 1), from(one), to(next)));
        } else if let (Some(after), Some(before)) = (after(one), before(next))
            && !after.meets(before)
        {
            let (part, messages, wanted) = (one.number, after.messages, before.messages);
            losses.push(loss(LossKind::PartUnlike { part, messages, wanted }, from(one), to(next)));
        }
    }
    // If the recording was cut off just after the last part, the next part's file exists, but without its header.
    let is_begun = |number| {
        unread.iter().any(|loss| matches!(loss.kind, LossKind::PartUnreadable { part, .. } if part == number))
    };
    if let Some(last) = parts.last().filter(|last| goes_on(last) && !is_begun(last.number + 1)) {
        let kind = LossKind::PartsMissing { first: last.number + 1, last: None };
        losses.push(loss(kind, from(last), None));
    }
    losses
}

/// Returns the continuation of each part that was cut off.
fn resumed(parts: &[Glance]) -> Vec<Option<Resumed>> {
    let pair = |pair: &[Glance]| {
        let [one, next] = pair else { return None };
        let own = before(one).filter(|_| after(one).is_none() && one.number + 1 == next.number)?;
        let before = before(next)?.clone();
        let messages = before.messages.saturating_sub(own.messages);
        Some(Resumed { before, messages, at: next.times.map(|times| times.0) })
    };
    parts.windows(2).map(pair).collect()
}

fn goes_on(glance: &Glance) -> bool {
    glance.part.as_ref().and_then(|part| part.end.as_ref()).is_some_and(|end| end.follows)
}

fn after(glance: &Glance) -> Option<&Progress> {
    Some(&glance.part.as_ref()?.end.as_ref()?.after)
}

fn before(glance: &Glance) -> Option<&Progress> {
    Some(&glance.part.as_ref()?.head.before)
}

fn missing(first: u32, last: u32) -> LossKind {
    LossKind::PartsMissing { first, last: Some(last) }
}

fn loss(kind: LossKind, from: Option<MonoNs>, to: Option<MonoNs>) -> Loss {
    Loss { kind, offset: 0, bytes: 0, from, to }
}
