//! Entries in a file: appended, checked when they are read.

use std::fs::{File, OpenOptions};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use serde::Serialize;
use xxhash_rust::xxh64::xxh64;

use super::StatesError;

/// What a file of states begins with.
pub const MAGIC: &[u8; 16] = b"headrace states\n";
const HEAD_BYTES: u64 = 16 + 8;
const ENTRY_HEAD_BYTES: u64 = 32;
/// States are written while a dive is played: speed goes before size.
const COMPRESSION: i32 = 1;
/// The most that an entry holds when unpacked: a block is far smaller, a place in a log holds a packet.
const MOST_BYTES: usize = 16 << 20;

/// What an entry is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Block = 0,
    State = 1,
}

/// An entry and its place.
#[derive(Debug, Clone, Copy)]
pub(super) struct Entry {
    pub(super) kind: Kind,
    pub(super) key: u64,
    offset: u64,
    len: u64,
    digest: u64,
}

/// The file.
pub(super) struct StatesFile {
    file: File,
    path: PathBuf,
    end: u64,
}

impl StatesFile {
    /// Opens it, or makes it, with the entries that it has. What is of another identity, or not whole, is dropped.
    pub(super) fn open(path: &Path, identity: u64) -> Result<(Self, Vec<Entry>), StatesError> {
        let failed = |doing, source| StatesError::File { doing, path: path.to_owned(), source };
        let file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path);
        let file = file.map_err(|source| failed("opening", source))?;
        let mut states = Self { file, path: path.to_owned(), end: HEAD_BYTES };
        let entries = states.take_up(identity).map_err(|source| failed("reading", source))?;
        Ok((states, entries))
    }

    /// One that goes away when it is closed.
    pub(super) fn temporary() -> Result<Self, StatesError> {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("headrace-states-{}-{number}", std::process::id()));
        let failed = |source| StatesError::File { doing: "making", path: path.clone(), source };
        let file = OpenOptions::new().read(true).write(true).create_new(true).open(&path).map_err(failed)?;
        std::fs::remove_file(&path).map_err(failed)?;
        Ok(Self { file, path, end: HEAD_BYTES })
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    pub(super) fn len(&self) -> u64 {
        self.end
    }

    fn take_up(&mut self, identity: u64) -> std::io::Result<Vec<Entry>> {
        let len = self.file.metadata()?.len();
        let mut head = Vec::new();
        (&mut self.file).take(HEAD_BYTES).read_to_end(&mut head)?;
        let (magic, of) = head.split_at(head.len().min(MAGIC.len()));
        if !magic.is_empty() && magic != MAGIC {
            return Err(std::io::Error::other("it is another kind of file, and stays as it is"));
        }
        if of != identity.to_le_bytes() {
            self.file.set_len(0)?;
            self.file.seek(SeekFrom::Start(0))?;
            self.file.write_all(MAGIC)?;
            self.file.write_all(&identity.to_le_bytes())?;
            return Ok(Vec::new());
        }
        let mut entries = Vec::new();
        while let Some(entry) = self.entry_at_end(len)? {
            self.end = entry.offset + entry.len;
            entries.push(entry);
        }
        self.file.set_len(self.end)?;
        Ok(entries)
    }

    /// The entry behind those that are known; `None` where there is none, or not all of it.
    fn entry_at_end(&mut self, len: u64) -> std::io::Result<Option<Entry>> {
        if self.end + ENTRY_HEAD_BYTES > len {
            return Ok(None);
        }
        self.file.seek(SeekFrom::Start(self.end))?;
        let mut words = [[0; 8]; 4];
        self.file.read_exact(words.as_flattened_mut())?;
        let [kind, key, bytes, digest] = words.map(u64::from_le_bytes);
        let offset = self.end + ENTRY_HEAD_BYTES;
        let whole = offset.checked_add(bytes).is_some_and(|end| end <= len);
        let kind = [Kind::Block, Kind::State].into_iter().find(|known| *known as u64 == kind);
        Ok(kind.filter(|_| whole).map(|kind| Entry { kind, key, offset, len: bytes, digest }))
    }

    /// A value as bytes.
    pub(super) fn encoded(&self, value: &impl Serialize) -> Result<Vec<u8>, StatesError> {
        postcard::to_extend(value, Vec::new())
            .map_err(|error| self.failed("writing to", std::io::Error::other(error)))
    }

    /// Appends an entry.
    pub(super) fn write(&mut self, kind: Kind, key: u64, bytes: &[u8]) -> Result<Entry, StatesError> {
        let packed =
            zstd::bulk::compress(bytes, COMPRESSION).map_err(|source| self.failed("writing to", source))?;
        let (len, digest) = (packed.len() as u64, xxh64(&packed, 0));
        let head = [kind as u64, key, len, digest].map(u64::to_le_bytes);
        let mut write = || {
            self.file.seek(SeekFrom::Start(self.end))?;
            self.file.write_all(&[head.as_flattened(), &packed].concat())
        };
        write().map_err(|source| self.failed("writing to", source))?;
        let entry = Entry { kind, key, offset: self.end + ENTRY_HEAD_BYTES, len, digest };
        self.end = entry.offset + len;
        Ok(entry)
    }

    /// The bytes of an entry; `None` when they are damaged.
    pub(super) fn read(&mut self, entry: &Entry) -> Result<Option<Vec<u8>>, StatesError> {
        let Ok(len) = usize::try_from(entry.len) else { return Ok(None) };
        let mut packed = vec![0; len];
        let read =
            self.file.seek(SeekFrom::Start(entry.offset)).and_then(|_| self.file.read_exact(&mut packed));
        read.map_err(|source| self.failed("reading", source))?;
        let whole = xxh64(&packed, 0) == entry.digest;
        let size = zstd::bulk::Decompressor::upper_bound(&packed).unwrap_or(MOST_BYTES).min(MOST_BYTES);
        Ok(zstd::bulk::decompress(&packed, size).ok().filter(|_| whole))
    }

    fn failed(&self, doing: &'static str, source: std::io::Error) -> StatesError {
        StatesError::File { doing, path: self.path.clone(), source }
    }
}
