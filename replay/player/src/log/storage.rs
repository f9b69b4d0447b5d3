//! Where a recorder keeps its files: the disk, or in tests anything whose every operation can fail or wait.

use std::fs::{File, OpenOptions};
use std::io;
use std::path::Path;

/// Files that are created once and only grow.
pub trait Storage: Send {
    /// Creates a file, which must not exist. Once this returns its name survives a power cut.
    ///
    /// Errors: it exists; the system's.
    fn create(&mut self, path: &Path) -> io::Result<Box<dyn StoredFile>>;

    /// Removes a file.
    ///
    /// Errors: it doesn't exist; the system's.
    fn remove(&mut self, path: &Path) -> io::Result<()>;

    /// Bytes free beside a file; `None` where that is unknown.
    fn free_bytes(&mut self, path: &Path) -> Option<u64>;
}

/// A file that is open for writing. Closing it by dropping writes nothing.
pub trait StoredFile: Send {
    /// Appends the first of these bytes, and returns how many.
    ///
    /// Errors: the system's; `Interrupted` is tried again.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize>;

    /// Once this returns, what was written survives a power cut. After an error nothing written since the last success may.
    ///
    /// Errors: the system's.
    fn sync(&mut self) -> io::Result<()>;
}

/// The machine's file systems.
#[derive(Debug, Clone, Copy, Default)]
pub struct Disk;

impl Storage for Disk {
    fn create(&mut self, path: &Path) -> io::Result<Box<dyn StoredFile>> {
        let file = OpenOptions::new().write(true).create_new(true).open(path)?;
        // Only on Unix: other systems don't open folders.
        let synced = if cfg!(unix) {
            File::open(folder_of(path)).and_then(|folder| folder.sync_all())
        } else {
            Ok(())
        };
        if let Err(error) = synced {
            // What was not there before shall not be there after an error.
            self.remove(path).ok();
            return Err(error);
        }
        tracing::info!(path = %path.display(), "log created");
        Ok(Box::new(file))
    }

    fn remove(&mut self, path: &Path) -> io::Result<()> {
        std::fs::remove_file(path)
    }

    fn free_bytes(&mut self, path: &Path) -> Option<u64> {
        let disk = rustix::fs::statvfs(folder_of(path)).ok()?;
        // Of what other users than root may take.
        Some(disk.f_bavail.saturating_mul(disk.f_frsize))
    }
}

impl StoredFile for File {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        io::Write::write(self, bytes)
    }

    fn sync(&mut self) -> io::Result<()> {
        self.sync_data()
    }
}

/// The folder that a file is in.
pub(crate) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Bytes gathered before they are passed to the file.
const BUFFER_BYTES: usize = 64 << 10;

/// A stored file as a writer. Flushing syncs; dropping discards what hasn't been passed on.
pub(super) struct Buffered {
    file: Box<dyn StoredFile>,
    buffer: Vec<u8>,
}

impl Buffered {
    pub(super) fn new(file: Box<dyn StoredFile>) -> Self {
        Self { file, buffer: Vec::with_capacity(BUFFER_BYTES) }
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
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.pass_on()?;
        self.file.sync()
    }
}

/// A single writer as storage, for [`super::Recorder::start`]: flushing is its sync, and there is no second file.
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
