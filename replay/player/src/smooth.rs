//! Smooths a dive in two replays.
//!
//! During the first replay, the steps of the navigation filter are stored in a file, because they don't fit in memory.
//! The steps are then smoothed backwards, and the second replay uses the result. The file is unlinked, so it disappears
//! with the process.

use std::fs::{File, OpenOptions};
use std::io::{BufWriter, Read, Seek, SeekFrom, Write};
use std::path::PathBuf;

use headrace_fusion::Navigation;
use headrace_fusion::filter::settings::Settings;
use headrace_fusion::filter::sources::Consistency;
use headrace_fusion::smooth::backward::Backward;
use headrace_fusion::smooth::journal::{Journal, JournalReader};
use headrace_fusion::smooth::step::{Placed, WORDS, Words};
use headrace_fusion::smooth::track::{Track, TrackNavigation};
use headrace_fusion::smooth::two_filters::TwoFilterNavigation;
use headrace_monitor::report::Report;
use headrace_monitor::run::Loop;
use headrace_monitor::smoothing_changes;
use headrace_sensor::reading::MAX_SOURCES;
use headrace_vehicle::VehicleConfig;

/// Capacity of the queue of filter steps.
///
/// It must hold the steps of one tick: at most a minute, with ten epochs per second and up to three steps per epoch.
const QUEUED: usize = 4096;
/// Length of a stored filter step, bytes.
const RECORD: usize = 8 * WORDS;
/// Number of stored filter steps read at once.
const BLOCK: u64 = 256;
/// Maximum number of names tried for the temporary file.
const NAMES: u32 = 1000;

/// Reason why a dive could not be smoothed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SmoothError {
    /// The file for the steps can't be created, written or read.
    #[error("keeping the filter's steps in a file of {}, {bytes} bytes so far: {source}", folder.display())]
    File {
        /// Folder of the temporary file.
        folder: PathBuf,
        /// Length of the temporary file, bytes.
        bytes: u64,
        /// Error from the operating system.
        source: std::io::Error,
    },
    /// Filter steps were lost, because the filter produced them faster than they were stored.
    #[error("keeping the filter's steps: {lost} steps of a tick were lost; a tick may have up to {queued}")]
    Lost {
        /// Number of lost filter steps.
        lost: u64,
        /// Capacity of the queue, filter steps.
        queued: usize,
    },
    /// A filter step read back from the file is invalid, so it differs from the one written.
    #[error("reading the filter's steps back: record {record} is damaged")]
    Damaged {
        /// Index of the damaged filter step in the file, from 0.
        record: u64,
    },
}

/// The first of two replays: runs the filter, and stores its steps for smoothing.
pub struct FirstPass {
    settings: Settings,
    steps: Steps,
    consistency: [Option<Consistency>; MAX_SOURCES],
}

impl FirstPass {
    /// Creates the first pass, and the navigation with which the first replay must be armed.
    ///
    /// The file of steps is in the system's temporary folder.
    ///
    /// Errors: the file can't be created.
    pub fn new(
        vehicle: &VehicleConfig,
        settings: Settings,
    ) -> Result<(Self, Box<dyn Navigation>), SmoothError> {
        let (journal, reader) = Journal::new(QUEUED);
        let steps = Steps::new(reader)?;
        let profile = vehicle.tunnel.profile.clone();
        let navigation = TwoFilterNavigation::new(profile, vehicle.site, settings, journal);
        Ok((Self { settings, steps, consistency: [None; MAX_SOURCES] }, Box::new(navigation)))
    }

    /// Stores the steps of the latest tick. Must be called after every tick.
    pub fn after_tick(&mut self, dive: &Loop) {
        self.steps.take();
        self.consistency = core::array::from_fn(|source| dive.consistency(source));
    }

    /// Smooths the filter steps, from the last to the first. Returns the navigation for the second replay.
    ///
    /// Errors: a step was lost, or the file of steps can't be written or read.
    pub fn smooth(self) -> Result<(Box<dyn Navigation>, Changes), SmoothError> {
        let (records, lost) = (self.steps.records, self.steps.journal.dropped());
        if lost > 0 {
            return Err(SmoothError::Lost { lost, queued: QUEUED });
        }
        let track = self.steps.smooth(&self.settings)?;
        let changes = Changes { estimates: track.len() as u64, pieces: track.pieces() as u64 };
        tracing::debug!(records, pieces = changes.pieces, "smoothed");
        Ok((Box::new(TrackNavigation::new(track, self.consistency)), changes))
    }
}

/// Number of smoothed estimates and of separately smoothed pieces, for the report.
#[derive(Debug, Clone, Copy)]
pub struct Changes {
    estimates: u64,
    pieces: u64,
}

impl Changes {
    /// Adds to the second replay's report by how much it differs from the first replay's report.
    pub fn complete(self, first: &Report, second: &mut Report) {
        let changes = smoothing_changes::compare(first, second, self.estimates, self.pieces);
        second.smoothing = Some(changes);
    }
}

/// Filter steps of a replay, stored in a temporary file.
struct Steps {
    journal: JournalReader,
    folder: PathBuf,
    file: BufWriter<File>,
    records: u64,
    failed: Option<std::io::Error>,
}

impl Steps {
    fn new(journal: JournalReader) -> Result<Self, SmoothError> {
        let folder = std::env::temp_dir();
        match nameless(&folder) {
            Ok(file) => {
                let file = BufWriter::with_capacity(1 << 20, file);
                Ok(Self { journal, folder, file, records: 0, failed: None })
            }
            Err(source) => Err(SmoothError::File { folder, bytes: 0, source }),
        }
    }

    fn take(&mut self) {
        while let Some(words) = self.journal.next() {
            if self.failed.is_some() {
                continue;
            }
            match self.file.write_all(&bytes(&words)) {
                Ok(()) => self.records += 1,
                Err(error) => self.failed = Some(error),
            }
        }
    }

    fn smooth(mut self, settings: &Settings) -> Result<Track, SmoothError> {
        self.take();
        let (folder, bytes) = (self.folder.clone(), self.records * RECORD as u64);
        let failed = |source| SmoothError::File { folder: folder.clone(), bytes, source };
        if let Some(error) = self.failed {
            return Err(failed(error));
        }
        let mut file = self.file.into_inner().map_err(|error| failed(error.into_error()))?;
        let mut backward = Backward::new(*settings);
        let mut left = self.records;
        let mut block = Vec::new();
        while left > 0 {
            let count = left.min(BLOCK);
            left -= count;
            block.clear();
            file.seek(SeekFrom::Start(left * RECORD as u64)).map_err(failed)?;
            let taken = (&file).take(count * RECORD as u64).read_to_end(&mut block);
            taken.map_err(failed)?;
            for (record, bytes) in block.as_chunks::<RECORD>().0.iter().enumerate().rev() {
                let damaged = || SmoothError::Damaged { record: left + record as u64 };
                backward.take(&Placed::of_words(&words(bytes)).ok_or_else(damaged)?);
            }
        }
        Ok(backward.finish())
    }
}

/// Creates a new unlinked file in a folder.
fn nameless(folder: &std::path::Path) -> std::io::Result<File> {
    let mut last = std::io::Error::other("no name is free");
    for number in 0..NAMES {
        let path = folder.join(format!("headrace-steps-{}-{number}", std::process::id()));
        match OpenOptions::new().read(true).write(true).create_new(true).open(&path) {
            Ok(file) => {
                std::fs::remove_file(&path)?;
                return Ok(file);
            }
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => last = error,
            Err(error) => return Err(error),
        }
    }
    Err(last)
}

fn bytes(words: &Words) -> [u8; RECORD] {
    let mut bytes = [0; RECORD];
    for (slot, word) in bytes.as_chunks_mut::<8>().0.iter_mut().zip(words) {
        *slot = word.to_le_bytes();
    }
    bytes
}

fn words(bytes: &[u8; RECORD]) -> Words {
    let mut words = [0; WORDS];
    for (slot, bytes) in words.iter_mut().zip(bytes.as_chunks::<8>().0) {
        *slot = u64::from_le_bytes(*bytes);
    }
    words
}
