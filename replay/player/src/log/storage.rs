//! Storage for a recorder's files: the disk, or in tests a storage whose operations can fail or wait.

use std::fs::{File, Metadata, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};

use crate::atomic_file::{folder_of, number_of};

/// Storage for files that are created once and then only grow.
pub trait Storage: Send {
    /// Creates a file. Once this function returns, the file's name survives a power cut.
    ///
    /// Errors: the file exists already; system errors.
    fn create(&mut self, path: &Path) -> io::Result<Box<dyn StoredFile>>;

    /// Removes a file.
    ///
    /// Errors: the file doesn't exist; system errors.
    fn remove(&mut self, path: &Path) -> io::Result<()>;

    /// Free bytes on the file's medium; `None` if unknown.
    fn free_bytes(&mut self, path: &Path) -> Option<u64>;
}

/// A file open for writing. Dropping it writes nothing more.
pub trait StoredFile: Send {
    /// Appends `bytes`, or as many of them from the first on as the medium accepts. Returns the number of bytes
    /// appended.
    ///
    /// Errors: a system error; after `Interrupted` the caller tries again.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize>;

    /// Syncs the file. Once this function returns, everything written so far survives a power cut.
    ///
    /// After an error, only what was on the medium at the latest successful sync is certain. If another program has
    /// changed the file, nothing in it is certain.
    ///
    /// Errors: a system error; another program has deleted, truncated or replaced the file.
    fn sync(&mut self) -> io::Result<()>;
}

/// The disk: the file systems of this machine.
#[derive(Debug, Clone, Copy, Default)]
pub struct Disk;

impl Storage for Disk {
    fn create(&mut self, path: &Path) -> io::Result<Box<dyn StoredFile>> {
        // The file is opened in append mode. If another program truncates the file, its length stays below the number
        // of bytes written, which shows the fault.
        let file = OpenOptions::new().append(true).create_new(true).open(path)?;
        // The lock shows other programs that the file is being written. On file systems without locks, the error is
        // ignored.
        file.try_lock().ok();
        // The folder is synced only on Unix, because other systems can't open folders.
        let synced = if cfg!(unix) {
            File::open(folder_of(path)).and_then(|folder| folder.sync_all())
        } else {
            Ok(())
        };
        if let Err(error) = synced {
            // After an error, the new file is removed, so that none is left behind.
            self.remove(path).ok();
            return Err(error);
        }
        tracing::info!(path = %path.display(), "log created");
        Ok(Box::new(DiskFile::new(file, path)))
    }

    fn remove(&mut self, path: &Path) -> io::Result<()> {
        std::fs::remove_file(path)
    }

    fn free_bytes(&mut self, path: &Path) -> Option<u64> {
        let disk = rustix::fs::statvfs(folder_of(path)).ok()?;
        // Space on the disk that is available to users other than root.
        Some(disk.f_bavail.saturating_mul(disk.f_frsize))
    }
}

/// Kind of change that another program has made to a recording's file. After it, the file's content is gone or is at
/// another path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(super) enum Taken {
    #[error("another program has deleted the file")]
    Deleted,
    #[error("another program has cut the file short")]
    CutShort,
    #[error("another program has put another file in its place")]
    Replaced,
}

impl Taken {
    /// Whether an error means that another program has changed the file.
    pub(super) fn is_in(error: &io::Error) -> bool {
        error.get_ref().is_some_and(<dyn std::error::Error + Send + Sync>::is::<Self>)
    }
}

/// A file on the disk, which other programs may delete, truncate or replace.
///
/// If another program moves the file, writing continues in the moved file, and nothing is lost.
struct DiskFile {
    file: File,
    path: PathBuf,
    written: u64,
    /// Device and inode number; `None` unless the file system reports the same numbers for the open file and for its
    /// path.
    known: Option<(u64, u64)>,
    /// Whether the file has been synced once. The first sync doesn't report changes by other programs. If a dive's
    /// first file disappears while it has only a header, the second sync therefore fails, and the dive continues in
    /// another file.
    is_begun: bool,
}

impl DiskFile {
    fn new(file: File, path: &Path) -> Self {
        let own = file.metadata().ok().filter(|own| links(own) > 0).and_then(|own| number_of(&own));
        let there = std::fs::metadata(path).ok().and_then(|there| number_of(&there));
        let known = own.filter(|_| own == there);
        Self { file, path: path.to_owned(), written: 0, known, is_begun: false }
    }

    /// Returns the change that another program has made to the file, if any.
    fn taken(&self) -> Option<Taken> {
        // If the system can't give the file's metadata, the file counts as unchanged.
        let own = self.file.metadata().ok()?;
        if own.len() < self.written {
            return Some(Taken::CutShort);
        }
        let known = self.known?;
        if links(&own) == 0 {
            return Some(Taken::Deleted);
        }
        let there = std::fs::metadata(&self.path).ok()?;
        (number_of(&there) != Some(known)).then_some(Taken::Replaced)
    }
}

impl StoredFile for DiskFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = io::Write::write(&mut self.file, bytes)?;
        self.written += count as u64;
        Ok(count)
    }

    fn sync(&mut self) -> io::Result<()> {
        self.file.sync_data()?;
        let is_begun = core::mem::replace(&mut self.is_begun, true);
        self.taken().filter(|_| is_begun).map_or(Ok(()), |taken| Err(io::Error::other(taken)))
    }
}

/// Returns the number of names (hard links) that a file has.
#[cfg(unix)]
fn links(file: &Metadata) -> u64 {
    std::os::unix::fs::MetadataExt::nlink(file)
}

#[cfg(not(unix))]
fn links(_: &Metadata) -> u64 {
    1
}

/// Size of the write buffer of a file, bytes.
const BUFFER_BYTES: usize = 64 << 10;

/// Writes to a stored file through a buffer.
///
/// Flushing writes the buffer and syncs the file. Dropping discards buffered bytes.
pub(super) struct Buffered {
    file: Box<dyn StoredFile>,
    buffer: Vec<u8>,
    /// Whether nothing was written since the latest sync, so that another sync isn't needed.
    is_synced: bool,
}

impl Buffered {
    pub(super) fn new(file: Box<dyn StoredFile>) -> Self {
        Self { file, buffer: Vec::with_capacity(BUFFER_BYTES), is_synced: false }
    }

    fn pass_on(&mut self) -> io::Result<()> {
        let mut done = 0;
        while let Some(rest) = self.buffer.get(done..).filter(|rest| !rest.is_empty()) {
            match self.file.write(rest) {
                Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
                Ok(more) => done += more,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        self.buffer.clear();
        Ok(())
    }
}

impl io::Write for Buffered {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.buffer.len() >= BUFFER_BYTES {
            self.pass_on()?;
        }
        self.buffer.extend_from_slice(bytes);
        self.is_synced = false;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        if !self.is_synced {
            self.pass_on()?;
            self.file.sync()?;
            self.is_synced = true;
        }
        Ok(())
    }
}

/// A single writer as storage, for [`super::Recorder::start`]. Flushing the writer counts as a sync. No second file can
/// be created.
pub(super) struct OneWriter<W>(pub(super) Option<W>);

struct WriterFile<W>(W);

impl<W: io::Write + Send> StoredFile for WriterFile<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes)
    }

    fn sync(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

impl<W: io::Write + Send + 'static> Storage for OneWriter<W> {
    fn create(&mut self, _: &Path) -> io::Result<Box<dyn StoredFile>> {
        let writer = self.0.take().ok_or(io::ErrorKind::Unsupported)?;
        Ok(Box::new(WriterFile(writer)))
    }

    fn remove(&mut self, _: &Path) -> io::Result<()> {
        Ok(())
    }

    fn free_bytes(&mut self, _: &Path) -> Option<u64> {
        None
    }
}
