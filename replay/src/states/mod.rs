//! States of a dive in a file of their own, so that a player can go to any of its moments at once.
//!
//! The file is a help, not a record: whoever has lost it replays from the beginning. It begins with [`MAGIC`] and a u64,
//! the identity of whatever the states depend on (the log, the vehicle, the program). Then come entries, each: u64 kind,
//! u64 key, u64 bytes that follow, u64 their xxHash64, and these bytes, zstd. All little-endian.
//!
//! | kind | key | bytes |
//! |---|---|---|
//! | 0 | digest of the content | a block: a part of one or more states |
//! | 1 | the moment, ns | a state: the place in the log, and the keys of the blocks of [`Loop::save`](headrace_monitor::run::Loop::save), which stand before it |

mod blocks;
mod file;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use headrace_geometry::time::MonoNs;
use xxhash_rust::xxh64::xxh64;

use crate::player::PlayerPlace;
use file::{Entry, Kind, StatesFile};

pub use file::MAGIC;

/// What is looked at of a log's beginning and end.
const LOOKED_AT_BYTES: u64 = 1 << 18;

/// Why states can't be kept or had back.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StatesError {
    /// The file can't be used.
    #[error("{doing} {path}, which keeps a dive's states: {source}")]
    File {
        /// What was attempted.
        doing: &'static str,
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A state isn't as it was written.
    #[error("reading {path}: the state of {at_s} s is damaged; remove the file, it can be made again")]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The state's moment, on the log's clock.
        at_s: f64,
    },
}

/// The identity of what states depend on: files as a whole, and other settings as bytes.
///
/// Errors: a file can't be read.
pub fn identity(files: &[&Path], settings: &[&[u8]]) -> Result<u64, StatesError> {
    let mut identity = 0;
    let mut block = vec![0; 1 << 16];
    for path in files {
        let failed = |source| StatesError::File { doing: "reading", path: (*path).to_owned(), source };
        let mut file = File::open(path).map_err(failed)?;
        loop {
            let len = file.read(&mut block).map_err(failed)?;
            if len == 0 {
                break;
            }
            identity = xxh64(block.get(..len).unwrap_or_default(), identity);
        }
    }
    Ok(settings.iter().fold(identity, |identity, bytes| xxh64(bytes, identity)))
}

/// The identity of a log, of which not all is read: its length, its beginning and its end.
///
/// Errors: it can't be read.
pub fn log_identity(path: &Path) -> Result<u64, StatesError> {
    let failed = |source| StatesError::File { doing: "reading", path: path.to_owned(), source };
    let mut file = File::open(path).map_err(failed)?;
    let len = file.metadata().map_err(failed)?.len();
    let mut bytes = Vec::new();
    for from in [0, len.saturating_sub(LOOKED_AT_BYTES)] {
        file.seek(SeekFrom::Start(from)).map_err(failed)?;
        (&mut file).take(LOOKED_AT_BYTES).read_to_end(&mut bytes).map_err(failed)?;
    }
    Ok(xxh64(&bytes, len))
}

/// States in a file, by their moments.
pub struct States {
    file: StatesFile,
    moments: BTreeMap<MonoNs, Entry>,
    blocks: BTreeMap<u64, Entry>,
}

impl States {
    /// Opens a file of states, or makes it. States of another identity are dropped, and what isn't whole at the end.
    ///
    /// Errors: the file can't be opened, read or written; or it is another kind of file, which stays as it is.
    pub fn open(path: &Path, identity: u64) -> Result<Self, StatesError> {
        let (file, entries) = StatesFile::open(path, identity)?;
        let mut states = Self { file, moments: BTreeMap::new(), blocks: BTreeMap::new() };
        for entry in entries {
            states.note(entry);
        }
        Ok(states)
    }

    /// States that nobody keeps beyond this run.
    ///
    /// Errors: there is no room for temporary files.
    pub fn temporary() -> Result<Self, StatesError> {
        let file = StatesFile::temporary()?;
        Ok(Self { file, moments: BTreeMap::new(), blocks: BTreeMap::new() })
    }

    fn note(&mut self, entry: Entry) {
        match entry.kind {
            Kind::Block => self.blocks.insert(entry.key, entry),
            Kind::State => self.moments.insert(MonoNs(entry.key), entry),
        };
    }

    /// How many states there are, and the bytes of their file.
    pub fn usage(&self) -> (usize, u64) {
        (self.moments.len(), self.file.len())
    }

    /// The latest moment of which there is a state, up to `at`.
    pub fn latest(&self, at: MonoNs) -> Option<MonoNs> {
        self.moments.range(..=at).next_back().map(|(moment, _)| *moment)
    }

    /// Keeps a state.
    ///
    /// Errors: it can't be written.
    pub fn keep(&mut self, at: MonoNs, place: &PlayerPlace, snapshot: &[u8]) -> Result<(), StatesError> {
        let mut keys = Vec::new();
        for block in blocks::blocks(snapshot) {
            let key = xxh64(block, block.len() as u64);
            if !self.blocks.contains_key(&key) {
                let entry = self.file.write(Kind::Block, key, block)?;
                self.note(entry);
            }
            keys.push(key);
        }
        let state = self.file.encoded(&(place, keys))?;
        let entry = self.file.write(Kind::State, at.0, &state)?;
        self.note(entry);
        Ok(())
    }

    /// The state of a moment that [`States::latest`] gave: the place in the log, and the loop's snapshot.
    ///
    /// Errors: it can't be read, or is damaged.
    pub fn take(&mut self, at: MonoNs) -> Result<(PlayerPlace, Vec<u8>), StatesError> {
        let damaged =
            |file: &StatesFile| StatesError::Damaged { path: file.path().to_owned(), at_s: at.as_secs_f64() };
        let Self { file, moments, blocks, .. } = self;
        let entry = moments.get(&at).ok_or_else(|| damaged(file))?;
        let state = file.read(entry)?.ok_or_else(|| damaged(file))?;
        let (place, keys): (PlayerPlace, Vec<u64>) =
            postcard::from_bytes(&state).map_err(|_| damaged(file))?;
        let mut snapshot = Vec::new();
        for key in keys {
            let entry = blocks.get(&key).ok_or_else(|| damaged(file))?;
            snapshot.extend(file.read(entry)?.ok_or_else(|| damaged(file))?);
        }
        Ok((place, snapshot))
    }
}
