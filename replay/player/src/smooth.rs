//! Stores the filter's steps on disk during a replay, and smooths them from last to first.
//!
//! They are too many for memory: an unlinked file holds them and disappears with the process.

use std::fs::{File, OpenOptions};
use std::io::{BufWriter, Read, Seek, SeekFrom, Write};
use std::path::PathBuf;

use headrace_fusion::filter::settings::Settings;
use headrace_fusion::smooth::backward::Backward;
use headrace_fusion::smooth::journal::JournalReader;
use headrace_fusion::smooth::step::{Placed, WORDS, Words};
use headrace_fusion::smooth::track::Track;

/// Bytes per record.
const RECORD: usize = 8 * WORDS;
/// Records per read.
const BLOCK: u64 = 256;
/// File names to try.
const NAMES: u32 = 1000;

/// Why a dive could not be smoothed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SmoothError {
    /// The file that holds the steps can't be made, written or read.
    #[error("keeping the filter's steps in a file of {}, {bytes} bytes so far: {source}", folder.display())]
    File {
        /// Its folder.
        folder: PathBuf,
        /// Its length, bytes.
        bytes: u64,
        /// Cause.
        source: std::io::Error,
    },
    /// A record read back isn't the one written.
    #[error("reading the filter's steps back: record {record} is damaged")]
    Damaged {
        /// Record number, from zero.
        record: u64,
    },
}

/// Filter steps of a replay in progress.
pub struct Steps {
    journal: JournalReader,
    folder: PathBuf,
    file: BufWriter<File>,
    records: u64,
    failed: Option<std::io::Error>,
}

impl Steps {
    /// For a filter's journal. The file is in the system's temporary folder.
    ///
    /// Errors: it can't be created.
    pub fn new(journal: JournalReader) -> Result<Self, SmoothError> {
        let folder = std::env::temp_dir();
        match nameless(&folder) {
            Ok(file) => {
                let file = BufWriter::with_capacity(1 << 20, file);
                Ok(Self { journal, folder, file, records: 0, failed: None })
            }
            Err(source) => Err(SmoothError::File { folder, bytes: 0, source }),
        }
    }

    /// Takes the steps since the last call; to be called after every tick.
    pub fn take(&mut self) {
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

    /// Number of records.
    pub fn records(&self) -> u64 {
        self.records
    }

    /// Size of the records, bytes.
    pub fn bytes(&self) -> u64 {
        self.records * RECORD as u64
    }

    /// Smooths from the last step to the first, with the filter's settings.
    ///
    /// Errors: the file couldn't be written, or can't be read.
    pub fn smooth(mut self, settings: Settings) -> Result<Track, SmoothError> {
        self.take();
        let (folder, bytes) = (self.folder.clone(), self.bytes());
        let failed = |source| SmoothError::File { folder: folder.clone(), bytes, source };
        if let Some(error) = self.failed {
            return Err(failed(error));
        }
        let mut file = self.file.into_inner().map_err(|error| failed(error.into_error()))?;
        let mut backward = Backward::new(settings);
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

/// A new file in a folder, unlinked.
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
