//! A recording with its parts.
//!
//! If a part can't be written any more, it is left without an end. The recording begins another part, and repeats in it
//! the messages that may be missing from the previous part.
//!
//! After an error, nothing written since the latest sync is reliable, because a file system may discard the data and
//! still report success for the next sync. Messages are therefore kept in memory until they are synced.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::Duration;

use headrace_geometry::time::MonoNs;

use super::backlog::{Backlog, Head, Tally};
use super::error::LogError;
use super::fault::{RecordingEvent, RecordingFault, add};
use super::part::{PartHead, part_path};
use super::rotate::{Every, Rotation};
use super::storage::{Buffered, Storage, Taken};
use super::unfinished::Interrupted;
use super::writer::{Lane, LogHeader, LogWriter, PartSummary, Summary};

/// Number of unsynced bytes from which on a sync is due.
const SYNC_BYTES: usize = 4 << 20;
/// Wait after the first failed retry. The wait doubles after each further failed retry. The first retry is immediate.
const FIRST_WAIT: Duration = Duration::from_millis(250);
const LONGEST_WAIT: Duration = Duration::from_secs(8);
/// Number of attempts to write the unsynced messages after the dive has ended.
const LAST_ATTEMPTS: u32 = 3;
/// Maximum number of statements of losses kept while no part can be begun.
const MAX_STATEMENTS: usize = 100;
/// Maximum number of names tried for a part. Another name is tried if a file with the previous name exists.
const NAMES: u32 = 1000;

/// The part of the recording that is being written.
struct OpenPart {
    path: PathBuf,
    log: LogWriter<Buffered>,
    /// Log time of the part's first message, or time of the latest attempt to begin another part.
    began: Option<MonoNs>,
    /// File size at which the open part should end, bytes.
    ends_at: u64,
    /// Whether at most the part's header has been synced so far.
    fresh: bool,
    /// Number of synced raw messages in this part.
    raw_messages: u64,
    /// Number of synced messages in this part, and the total length of the synced messages, bytes.
    certain: (u64, u64),
    /// Log time of the last message before this part.
    before: Option<MonoNs>,
}

/// An interruption of the recording, during which no part can be written.
struct Outage {
    fault: RecordingFault,
    retry_at: Duration,
    wait: Duration,
}

/// A statement of a loss: time before the loss, time after it, and text.
type Statement = (Option<MonoNs>, Option<MonoNs>, String);

/// A recording in one or several parts.
pub(super) struct Recording {
    storage: Box<dyn Storage>,
    path: PathBuf,
    rotation: Rotation,
    /// Header of all parts. Only the field `part` differs between the parts.
    header: LogHeader,
    open: Option<OpenPart>,
    /// Number of the latest part that has any content.
    number: u32,
    /// Number in the file name of the latest part.
    named: u32,
    /// Totals of all messages that are synced or lost. All later messages are in the backlog.
    settled: Tally,
    backlog: Backlog,
    /// Statements of losses that the log doesn't have on its medium yet.
    statements: Vec<Statement>,
    /// Whether packets have been written, but not yet the tick that consumed them.
    within_tick: bool,
    outage: Option<Outage>,
    /// Number of messages for channels that are missing from the header, and the first such channel.
    refused: Option<(u64, Lane)>,
    sum: Summary,
    events: Vec<RecordingEvent>,
    now: Duration,
}

impl Recording {
    /// Begins a recording with its first part.
    ///
    /// Errors: the part can't be created or written.
    pub(super) fn begin(
        storage: Box<dyn Storage>,
        path: &Path,
        rotation: &Rotation,
        header: &LogHeader,
    ) -> Result<Self, LogError> {
        let mut recording = Self::empty(storage, path, rotation, header);
        recording.open = Some(recording.begin_synced_part()?);
        recording.number = 1;
        Ok(recording)
    }

    fn empty(storage: Box<dyn Storage>, path: &Path, rotation: &Rotation, header: &LogHeader) -> Self {
        Self {
            storage,
            path: path.to_owned(),
            rotation: rotation.clone(),
            header: header.clone(),
            open: None,
            number: 0,
            named: 0,
            settled: Tally::default(),
            backlog: Backlog::default(),
            statements: Vec::new(),
            within_tick: false,
            outage: None,
            refused: None,
            sum: Summary::default(),
            events: Vec::new(),
            now: Duration::ZERO,
        }
    }

    /// Continues an interrupted recording in a new part. The new part states the interruption.
    ///
    /// Errors: the part can't be created or written.
    pub(super) fn go_on(
        storage: Box<dyn Storage>,
        rotation: &Rotation,
        header: &LogHeader,
        earlier: &Interrupted,
    ) -> Result<Self, LogError> {
        let Interrupted { recording: unfinished, to, words } = earlier;
        let mut recording = Self {
            number: unfinished.number,
            named: unfinished.named,
            settled: unfinished.tally(header),
            ..Self::empty(storage, &unfinished.recording, rotation, header)
        };
        recording.rotation.dive.clone_from(&unfinished.dive);
        recording.open = Some(recording.begin_synced_part()?);
        recording.number += 1;
        recording.state(Some(unfinished.last), Some(*to), words);
        Ok(recording)
    }

    /// Returns the free bytes of the recording's medium; `None` if unknown.
    pub(super) fn free_bytes(&mut self) -> Option<u64> {
        self.storage.free_bytes(&self.path)
    }

    /// Returns the log time of the latest message that is either synced or lost.
    pub(super) fn certain_to(&self) -> Option<MonoNs> {
        self.settled.last
    }

    /// Whether an error keeps the recording from being written at present.
    pub(super) fn is_failing(&self) -> bool {
        self.open.is_none()
    }

    /// Returns the recording's events since the previous call.
    pub(super) fn take_events(&mut self) -> Vec<RecordingEvent> {
        core::mem::take(&mut self.events)
    }

    /// Sets the present time, counted from the recording's begin. Tries to begin another part if a retry is due.
    pub(super) fn look(&mut self, now: Duration) {
        self.now = now;
        if self.open.is_none() && self.outage.as_ref().is_some_and(|outage| now >= outage.retry_at) {
            self.resume();
        }
    }

    /// Writes a message to the recording.
    pub(super) fn message(&mut self, lane: Lane, log_time: MonoNs, publish_time: MonoNs, bytes: &[u8]) {
        if !self.header.has(lane) {
            self.refused = Some(self.refused.map_or((1, lane), |(count, first)| (count + 1, first)));
            return;
        }
        if self.is_due(lane, log_time) {
            self.rotate(log_time);
        }
        self.backlog.push(lane, log_time, publish_time, bytes);
        if let Some(part) = &mut self.open {
            if let Err(error) = part.log.message(lane, log_time, publish_time, bytes) {
                self.fail(&error);
            } else if self.backlog.bytes() >= SYNC_BYTES {
                self.sync();
            }
        }
        while let Some(lost) = self.backlog.overflow() {
            self.lose(&lost);
        }
    }

    /// Counts a message that the recording loses.
    fn lose(&mut self, lost: &Head) {
        self.settled.add(lost);
        if let Some(outage) = &mut self.outage {
            outage.fault.lost += 1;
        }
    }

    /// Writes a statement of a loss to the log.
    pub(super) fn state(&mut self, from: Option<MonoNs>, to: Option<MonoNs>, words: &str) {
        if self.statements.len() < MAX_STATEMENTS {
            self.statements.push((from, to, words.to_owned()));
        }
        let Some(part) = &mut self.open else { return };
        match part.log.lost(from, to, words) {
            Ok(()) => self.settle(),
            Err(error) => self.fail(&error),
        }
    }

    /// Syncs everything written so far.
    pub(super) fn sync(&mut self) {
        let Some(part) = &mut self.open else { return };
        match part.log.flush() {
            Ok(()) => self.settle(),
            Err(error) => self.fail(&error),
        }
    }

    /// Marks all messages of the open part as synced.
    fn settle(&mut self) {
        let Some(part) = &mut self.open else { return };
        while let Some(head) = self.backlog.pop() {
            part.raw_messages += u64::from(matches!(head.lane, Lane::Raw(_)));
            part.certain = (part.certain.0 + 1, part.certain.1 + head.len as u64);
            self.sum.messages += 1;
            self.sum.message_bytes += head.len as u64;
            self.settled.add(&head);
        }
        self.statements.clear();
        part.fresh = false;
    }

    /// Gives up the open part, and leaves it without an end.
    fn fail(&mut self, error: &LogError) {
        let Some(part) = self.open.take() else { return };
        let OpenPart { path, log, fresh, raw_messages, certain, before, .. } = part;
        let bytes = log.bytes();
        drop(log);
        let is_taken = matches!(error, LogError::Write { source, .. } if Taken::is_in(source));
        let (mut lost, mut from) = (0, self.settled.last);
        // A part without synced content is removed. The first part is kept, because it has the recording's name.
        if is_taken {
            // A deleted or replaced file isn't a part either. A file that is now at its path belongs to another
            // program, so it isn't removed.
            (lost, from) = (certain.0, before);
            self.sum.messages -= certain.0;
            self.sum.message_bytes -= certain.1;
        } else if fresh && self.number > 1 {
            self.number -= 1;
            self.discard(&path);
        } else {
            self.sum.bytes += bytes;
            self.sum.raw_messages += raw_messages;
            self.sum.parts.push(PartSummary { path: path.clone(), raw_messages });
        }
        if self.outage.is_some() {
            self.wait();
            return;
        }
        tracing::error!("nothing is recorded to {}: {error}", path.display());
        let error = error.to_string();
        self.events.push(RecordingEvent::Failed { path: path.clone(), error: error.clone() });
        let fault = RecordingFault { path, error, lost, from, to: None, continued: None };
        self.outage = Some(Outage { fault, retry_at: self.now, wait: FIRST_WAIT });
    }

    fn wait(&mut self) {
        if let Some(outage) = &mut self.outage {
            outage.retry_at = self.now.saturating_add(outage.wait);
            outage.wait = outage.wait.saturating_mul(2).min(LONGEST_WAIT);
        }
    }

    /// Begins another part after an error, and writes the unsynced messages to it.
    fn resume(&mut self) {
        let part = match self.begin_synced_part() {
            Ok(part) => part,
            Err(error) => {
                tracing::debug!("the recording can't continue yet: {error}");
                self.wait();
                return;
            }
        };
        self.number += 1;
        let path = part.path.clone();
        self.open = Some(part);
        if let Err(error) = self.write_again(&path) {
            self.fail(&error);
            // A voice recording is as large as several seconds of a dive. They are dropped because the other messages
            // may then fit.
            for lost in self.backlog.drop_voices() {
                self.lose(&lost);
            }
            return;
        }
        self.settle();
        let Some(Outage { mut fault, .. }) = self.outage.take() else { return };
        fault.continued = Some(path);
        tracing::warn!("{}", fault.words());
        self.events.push(RecordingEvent::Resumed(fault.clone()));
        add(&mut self.sum.faults, fault);
    }

    /// Writes the statements of losses and the backlog of messages to the part just begun, and syncs it.
    fn write_again(&mut self, path: &Path) -> Result<(), LogError> {
        let Some(part) = &mut self.open else { return Ok(()) };
        if let Some(outage) = &mut self.outage {
            outage.fault.to = self.backlog.span().map(|span| span.0);
            let fault = RecordingFault { continued: Some(path.to_owned()), ..outage.fault.clone() };
            part.log.lost(fault.from, fault.to, &fault.words())?;
        }
        for (from, to, words) in &self.statements {
            part.log.lost(*from, *to, words)?;
        }
        let log = &mut part.log;
        self.backlog
            .try_each(|head, bytes| log.message(head.lane, head.log_time, head.publish_time, bytes))?;
        log.flush()
    }

    /// Whether the open part should end before this message.
    fn is_due(&mut self, lane: Lane, at: MonoNs) -> bool {
        // A part ends only between two ticks, so that no tick is split.
        let between = match lane {
            Lane::Raw(_) => !core::mem::replace(&mut self.within_tick, true),
            Lane::Tick => {
                self.within_tick = false;
                false
            }
            Lane::Sent(_) | Lane::Result(_) | Lane::Voice => false,
        };
        let Some(part) = &mut self.open else { return false };
        let began = *part.began.get_or_insert(at);
        between
            && match self.rotation.every {
                Some(Every::Bytes(_)) => part.log.bytes() >= part.ends_at,
                Some(Every::Span(span)) => at.since(began) >= span,
                None => false,
            }
    }

    /// Ends the part and begins the next one, whose first message has time `at`.
    ///
    /// If the next part can't be begun, the present part continues. A slow disk may need 0.3 s for each access, so the
    /// next part's header is only synced together with its first messages.
    fn rotate(&mut self, at: MonoNs) {
        self.sync();
        if self.open.is_none() {
            return;
        }
        let next = self.begin_part();
        let Some(last) = &mut self.open else { return };
        last.began = Some(at);
        match next {
            Err(error) => {
                tracing::warn!("the recording continues in {}: {error}", last.path.display());
                if let Some(Every::Bytes(bytes)) = self.rotation.every {
                    last.ends_at = last.log.bytes().saturating_add(bytes);
                }
            }
            Ok(next) => {
                self.number += 1;
                tracing::info!(from = %last.path.display(), to = %next.path.display(), "recording continues in the next part");
                let next = OpenPart { began: Some(at), ..next };
                if let Some(last) = self.open.replace(next) {
                    self.end(last, true);
                }
            }
        }
    }

    /// Begins a part, and syncs its header.
    fn begin_synced_part(&mut self) -> Result<OpenPart, LogError> {
        let mut part = self.begin_part()?;
        match part.log.flush() {
            Ok(()) => Ok(part),
            Err(error) => {
                let path = part.path.clone();
                drop(part);
                self.discard(&path);
                Err(error)
            }
        }
    }

    /// Creates the file of the next part, and writes its header.
    fn begin_part(&mut self) -> Result<OpenPart, LogError> {
        let before = self.settled.progress(&self.header);
        let part = PartHead { dive: self.rotation.dive.clone(), number: self.number + 1, before };
        let header = LogHeader { part: Some(part), ..self.header.clone() };
        let (path, file) = self.create()?;
        match LogWriter::new(Buffered::new(file), &header) {
            Ok(log) => {
                let ends_at = match self.rotation.every {
                    Some(Every::Bytes(bytes)) => bytes,
                    Some(Every::Span(_)) | None => u64::MAX,
                };
                let (certain, before) = ((0, 0), self.settled.last);
                Ok(OpenPart {
                    path,
                    log,
                    began: None,
                    ends_at,
                    fresh: true,
                    raw_messages: 0,
                    certain,
                    before,
                })
            }
            Err(error) => {
                // A file without a complete header isn't a part, so it is removed.
                self.discard(&path);
                Err(error)
            }
        }
    }

    /// Creates the next file. A name that a file already has is skipped. For the first part, such a name is an error.
    fn create(&mut self) -> Result<(PathBuf, Box<dyn super::storage::StoredFile>), LogError> {
        let first = self.named + 1;
        for name in first..first.saturating_add(NAMES) {
            let alone = name == 1 && self.rotation.every.is_none();
            let path = if alone { self.path.clone() } else { part_path(&self.path, name) };
            match self.storage.create(&path) {
                Ok(file) => {
                    self.named = name;
                    return Ok((path, file));
                }
                Err(error) if error.kind() == ErrorKind::AlreadyExists && name > 1 => {}
                Err(source) => return Err(LogError::Create { path, source }),
            }
        }
        let path = part_path(&self.path, first);
        Err(LogError::Create { path, source: ErrorKind::AlreadyExists.into() })
    }

    /// Removes the newest file. If that fails, the next part skips the file's name.
    fn discard(&mut self, path: &Path) {
        match self.storage.remove(path) {
            Ok(()) => self.named = self.named.saturating_sub(1),
            Err(error) => tracing::debug!("could not remove {}: {error}", path.display()),
        }
    }

    /// Ends a part whose messages are synced, and adds the part to the totals.
    fn end(&mut self, part: OpenPart, follows: bool) {
        let OpenPart { path, mut log, raw_messages, .. } = part;
        let bytes = log.bytes();
        let ended = log.end_part(follows).and_then(|()| log.finish());
        let (bytes, chunks) = match &ended {
            Ok((_, written)) => (written.bytes, written.chunks),
            Err(_) => (bytes, 0),
        };
        if let Err(error) = ended {
            tracing::error!("{} could not be completed: {error}", path.display());
            let fault = RecordingFault {
                path: path.clone(),
                error: error.to_string(),
                lost: 0,
                from: self.settled.last,
                to: None,
                continued: self.open.as_ref().map(|next| next.path.clone()),
            };
            self.state(fault.from, fault.to, &fault.words());
            add(&mut self.sum.faults, fault);
        }
        self.sum.bytes += bytes;
        self.sum.chunks = self.sum.chunks.saturating_add(chunks);
        self.sum.raw_messages += raw_messages;
        self.sum.parts.push(PartSummary { path, raw_messages });
    }

    /// Ends the recording without an end mark. A later dive can continue it.
    pub(super) fn abandon(mut self) -> Summary {
        self.sync();
        self.sum
    }

    /// Ends the recording, and returns its totals.
    pub(super) fn finish(mut self) -> Summary {
        for _ in 0..LAST_ATTEMPTS {
            if self.open.is_none() {
                self.resume();
            }
            self.sync();
            if let Some(part) = self.open.take() {
                self.end(part, false);
                break;
            }
        }
        if let Some(Outage { mut fault, .. }) = self.outage.take() {
            fault.lost += self.backlog.len();
            add(&mut self.sum.faults, fault);
        }
        if let Some((count, lane)) = self.refused {
            let error = LogError::NoChannel { channel: format!("{lane:?}") }.to_string();
            let (path, continued) = (self.path.clone(), Some(self.path.clone()));
            add(
                &mut self.sum.faults,
                RecordingFault { path, error, lost: count, from: None, to: None, continued },
            );
        }
        self.sum
    }
}
