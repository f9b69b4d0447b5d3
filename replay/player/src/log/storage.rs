//! Storage for a recorder's files: the disk or, in tests, anything whose operations can fail or wait.

use std::fs::{File, Metadata, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};

use crate::whole_file::{folder_of, number_of};

/// Storage for files that are created once and only grow.
pub trait Storage: Send {
    /// Creates a file, which must not exist. Once this returns, its name survives a power cut.
    ///
    /// Errors: the file exists; those of the system.
    fn create(&mut self, path: &Path) -> io::Result<Box<dyn StoredFile>>;

    /// Removes a file.
    ///
    /// Errors: the file doesn't exist; those of the system.
    fn remove(&mut self, path: &Path) -> io::Result<()>;

    /// Free bytes on the file's medium; `None` if unknown.
    fn free_bytes(&mut self, path: &Path) -> Option<u64>;
}

/// A file that is open for writing. Closing it by dropping writes nothing.
pub trait StoredFile: Send {
    /// Appends a prefix of these bytes, and returns its length.
    ///
    /// Errors: those of the system; `Interrupted` is retried.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize>;

    /// Syncs the file: once this returns, everything written survives a power cut.
    ///
    /// After an error, nothing written since the last success is certain. If another program has taken the file away,
    /// nothing at all is certain.
    ///
    /// Errors: those of the system; the file was taken away.
    fn sync(&mut self) -> io::Result<()>;
}

/// The file systems of the machine.
#[derive(Debug, Clone, Copy, Default)]
pub struct Disk;

impl Storage for Disk {
    fn create(&mut self, path: &Path) -> io::Result<Box<dyn StoredFile>> {
        // Append mode: if another program truncates the file, it stays shorter than the written length, which shows the
        // fault.
        let file = OpenOptions::new().append(true).create_new(true).open(path)?;
        // Only on Unix, since other systems can't open folders.
        let synced = if cfg!(unix) {
            File::open(folder_of(path)).and_then(|folder| folder.sync_all())
        } else {
            Ok(())
        };
        if let Err(error) = synced {
            // An error must leave no new file behind.
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
        // Space available to users other than root.
        Some(disk.f_bavail.saturating_mul(disk.f_frsize))
    }
}

/// Change by another program to a recording's file, whose content is then gone or not at its path.
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
    /// Whether an error has this cause.
    pub(super) fn is_in(error: &io::Error) -> bool {
        error.get_ref().is_some_and(<dyn std::error::Error + Send + Sync>::is::<Self>)
    }
}

/// A file on the disk that other programs may delete, truncate or replace.
///
/// Writing continues after a move, which loses nothing.
struct DiskFile {
    file: File,
    path: PathBuf,
    written: u64,
    /// Device and inode number, if the file system reports the same for the open file and its name.
    known: Option<(u64, u64)>,
    /// Whether it has been synced once. A dive whose first file disappears with only a header continues in another.
    is_begun: bool,
}

impl DiskFile {
    fn new(file: File, path: &Path) -> Self {
        let own = file.metadata().ok().filter(|own| links(own) > 0).and_then(|own| number_of(&own));
        let there = std::fs::metadata(path).ok().and_then(|there| number_of(&there));
        let known = own.filter(|_| own == there);
        Self { file, path: path.to_owned(), written: 0, known, is_begun: false }
    }

    /// Change to the file by other programs, if any.
    fn taken(&self) -> Option<Taken> {
        // If the system can't tell, the file is assumed to be in place.
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

/// Names that a file has.
#[cfg(unix)]
fn links(file: &Metadata) -> u64 {
    std::os::unix::fs::MetadataExt::nlink(file)
}

#[cfg(not(unix))]
fn links(_: &Metadata) -> u64 {
    1
}

/// Size of the write buffer, bytes.
const BUFFER_BYTES: usize = 64 << 10;

/// A stored file as a writer.
///
/// Flushing syncs everything written since the last sync. Dropping discards buffered bytes.
pub(super) struct Buffered {
    file: Box<dyn StoredFile>,
    buffer: Vec<u8>,
    /// Whether nothing was written since the last sync, so that another one would be useless.
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

/// A single writer as storage, for [`super::Recorder::start`]. Flushing it syncs it, and there is no second file.
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
