//! Writes files atomically: at any time, a path has either the complete new file or the unchanged previous file.
//!
//! The content is written beside the destination, synced, and then moved to the destination.

use std::fs::{File, Metadata, OpenOptions};
use std::io::{BufWriter, Error, ErrorKind, Result, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

/// Time to wait for a reader of a named pipe, and number of attempts in that time.
const READER_WITHIN: Duration = Duration::from_secs(2);
const READER_TRIES: u32 = 100;

/// A file being written. If it is dropped before [`AtomicFile::complete`], the previous file is unchanged.
#[derive(Debug)]
pub struct AtomicFile {
    file: BufWriter<File>,
    /// Path of the destination, and how the incomplete file is stored beside it; `None` if the destination is written
    /// in place.
    beside: Option<(PathBuf, Beside)>,
}

/// Name under which an incomplete file is stored beside its destination.
#[derive(Debug)]
enum Beside {
    /// The incomplete file has a temporary name.
    Named(PathBuf),
    /// The incomplete file has no name, so that nothing is left behind even if the program is killed.
    Nameless,
}

impl AtomicFile {
    /// Begins a file at `path`. If `path` is a link, begins a file at its target.
    ///
    /// Pipes, terminals and devices can't be replaced, nor can files in a folder that accepts no new file. Such a
    /// destination is written in place.
    ///
    /// Errors: system errors.
    pub fn create(path: &Path) -> Result<Self> {
        let there = std::fs::metadata(path);
        if there.as_ref().is_ok_and(|there| !there.is_file()) {
            return Self::in_place(path);
        }
        let place = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        let (file, beside) = match beside(&place) {
            Ok(begun) => begun,
            Err(error) if there.is_ok() && is_refused(error.kind()) => return Self::in_place(path),
            Err(error) => return Err(error),
        };
        let whole = Self { file: BufWriter::new(file), beside: Some((place, beside)) };
        if let Ok(there) = there {
            whole.file.get_ref().set_permissions(there.permissions())?;
        }
        Ok(whole)
    }

    fn in_place(path: &Path) -> Result<Self> {
        let file = if is_pipe(path) { open_pipe(path)? } else { File::create(path)? };
        Ok(Self { file: BufWriter::new(file), beside: None })
    }

    /// Syncs what has been written so far.
    ///
    /// Errors: system errors.
    pub fn sync(&mut self) -> Result<()> {
        self.file.flush()?;
        self.file.get_ref().sync_data()
    }

    /// Moves the file to its destination. Once this function returns, the file survives a power cut.
    ///
    /// Errors: a system error, after which the previous file is unchanged.
    pub fn complete(mut self) -> Result<()> {
        self.file.flush()?;
        let Some((place, beside)) = &mut self.beside else { return Ok(()) };
        self.file.get_ref().sync_all()?;
        if matches!(beside, Beside::Nameless) {
            // Only a file with a name can replace another file atomically.
            let name = name_beside(place);
            give_name(self.file.get_ref(), &name)?;
            *beside = Beside::Named(name);
        }
        if let Beside::Named(name) = beside {
            std::fs::rename(name, &*place)?;
        }
        let folder = folder_of(place).to_owned();
        self.beside = None;
        // Systems other than Unix can't open folders. Some file systems can't sync folders, so an error is ignored.
        if cfg!(unix) {
            File::open(folder).and_then(|folder| folder.sync_all()).ok();
        }
        Ok(())
    }
}

/// Writes a file atomically.
///
/// Errors: a system error, after which the previous file is unchanged.
pub fn write(path: &Path, content: &[u8]) -> Result<()> {
    let mut file = AtomicFile::create(path)?;
    file.write_all(content)?;
    file.complete()
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> Result<()> {
        self.file.flush()
    }
}

impl Seek for AtomicFile {
    fn seek(&mut self, to: SeekFrom) -> Result<u64> {
        self.file.seek(to)
    }
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        let Some((_, Beside::Named(name))) = &self.beside else { return };
        if let Err(error) = std::fs::remove_file(name) {
            tracing::warn!("{} is left behind: {error}", name.display());
        }
    }
}

/// Whether a path is a named pipe. Opening a pipe blocks until a process reads it.
#[cfg(unix)]
pub fn is_pipe(path: &Path) -> bool {
    use std::os::unix::fs::FileTypeExt as _;
    std::fs::metadata(path).is_ok_and(|there| there.file_type().is_fifo())
}

/// Whether a path is a named pipe; always false on this system.
#[cfg(not(unix))]
pub fn is_pipe(_: &Path) -> bool {
    false
}

/// Opens a named pipe for writing, once a process reads it.
///
/// Errors: a system error; no process reads the pipe within [`READER_WITHIN`].
#[cfg(unix)]
fn open_pipe(path: &Path) -> Result<File> {
    use rustix::fs::{Mode, OFlags, fcntl_setfl, open};
    use rustix::io::Errno;
    let mut tries = READER_TRIES;
    loop {
        match open(path, OFlags::WRONLY | OFlags::NONBLOCK | OFlags::CLOEXEC, Mode::empty()) {
            Ok(pipe) => {
                // From here on, writes to the pipe block, so that a slow reader gets everything.
                fcntl_setfl(&pipe, OFlags::empty())?;
                return Ok(pipe.into());
            }
            Err(Errno::NXIO) if tries > 0 => {
                tries -= 1;
                std::thread::sleep(READER_WITHIN / READER_TRIES);
            }
            Err(Errno::NXIO) => {
                let words =
                    format!("it is a pipe that no process has read within {} s", READER_WITHIN.as_secs());
                return Err(Error::new(ErrorKind::TimedOut, words));
            }
            Err(error) => return Err(error.into()),
        }
    }
}

/// Opens a named pipe for writing.
#[cfg(not(unix))]
fn open_pipe(path: &Path) -> Result<File> {
    File::create(path)
}

/// Creates a file beside its destination, without a name if the system supports that.
fn beside(place: &Path) -> Result<(File, Beside)> {
    if let Some(file) = nameless(folder_of(place)) {
        return Ok((file, Beside::Nameless));
    }
    let name = name_beside(place);
    Ok((OpenOptions::new().write(true).create_new(true).open(&name)?, Beside::Named(name)))
}

/// Creates an unlinked file, which can get a name later.
///
/// Returns `None` if the file system, the kernel or a missing `/proc` prevents it.
#[cfg(target_os = "linux")]
fn nameless(folder: &Path) -> Option<File> {
    use rustix::fs::{CWD, Mode, OFlags, openat};
    let flags = OFlags::TMPFILE | OFlags::WRONLY | OFlags::CLOEXEC;
    let file = File::from(openat(CWD, folder, flags, Mode::from_raw_mode(0o666)).ok()?);
    path_of(&file).exists().then_some(file)
}

/// Creates an unlinked file; always `None` on this system.
#[cfg(not(target_os = "linux"))]
fn nameless(_: &Path) -> Option<File> {
    None
}

/// Gives an unlinked file a name.
#[cfg(target_os = "linux")]
fn give_name(file: &File, name: &Path) -> Result<()> {
    use rustix::fs::{AtFlags, CWD, linkat};
    Ok(linkat(CWD, path_of(file), CWD, name, AtFlags::SYMLINK_FOLLOW)?)
}

/// Gives an unlinked file a name; never called on this system.
#[cfg(not(target_os = "linux"))]
fn give_name(_: &File, _: &Path) -> Result<()> {
    Err(ErrorKind::Unsupported.into())
}

/// Returns the path of an open file in the process's list of file descriptors.
#[cfg(target_os = "linux")]
fn path_of(file: &File) -> PathBuf {
    use std::os::fd::AsRawFd as _;
    format!("/proc/self/fd/{}", file.as_raw_fd()).into()
}

/// Returns the folder that contains a file.
pub(crate) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Returns the device number and the inode number of a file; `None` if the system has no such numbers.
#[cfg(unix)]
pub fn number_of(file: &Metadata) -> Option<(u64, u64)> {
    use std::os::unix::fs::MetadataExt as _;
    Some((file.dev(), file.ino()))
}

/// Returns the device and inode number of a file; always `None` on this system.
#[cfg(not(unix))]
pub fn number_of(_: &Metadata) -> Option<(u64, u64)> {
    None
}

/// Returns a temporary name beside a file. Programs that read a folder of logs ignore such names.
fn name_beside(place: &Path) -> PathBuf {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let mut name = place.file_name().unwrap_or_default().to_owned();
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    name.push(format!(".{}-{count}.unfinished", std::process::id()));
    place.with_file_name(name)
}

/// Whether an error means that no new file can be created in the folder. An existing file may still be writable.
fn is_refused(kind: ErrorKind) -> bool {
    use ErrorKind::{InvalidFilename, PermissionDenied, ReadOnlyFilesystem};
    matches!(kind, InvalidFilename | PermissionDenied | ReadOnlyFilesystem)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("headrace-whole-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        folder
    }

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap();
        let mut names: Vec<_> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn previous_file_is_unchanged_until_the_new_file_is_complete() {
        let folder = folder("stays");
        let path = folder.join("report.json");
        write(&path, b"old").unwrap();
        let mut file = AtomicFile::create(&path).unwrap();
        file.write_all(b"new").unwrap();
        file.flush().unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        // An unlinked file doesn't appear in its folder, so a killed program leaves nothing behind.
        if nameless(&folder).is_some() {
            assert_eq!(names(&folder), ["report.json"]);
        }
        drop(file);
        assert_eq!(
            (std::fs::read(&path).unwrap(), names(&folder)),
            (b"old".into(), vec!["report.json".into()])
        );
        write(&path, b"new").unwrap();
        assert_eq!(
            (std::fs::read(&path).unwrap(), names(&folder)),
            (b"new".into(), vec!["report.json".into()])
        );
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn replaced_file_keeps_its_link_and_permissions() {
        use std::os::unix::fs::{PermissionsExt as _, symlink};
        let folder = folder("links");
        let (path, link) = (folder.join("real.json"), folder.join("link.json"));
        std::fs::write(&path, "old").unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o640)).unwrap();
        symlink("real.json", &link).unwrap();
        write(&link, b"new").unwrap();
        assert!(link.symlink_metadata().unwrap().is_symlink());
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
        assert_eq!(path.metadata().unwrap().permissions().mode() & 0o777, 0o640);
        write(Path::new("/dev/null"), b"new").unwrap();
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn pipes_are_written_to_a_slow_reader_but_refused_without_a_reader() {
        use rustix::fs::{CWD, FileType, Mode, mknodat};
        let folder = folder("pipe");
        let pipe = folder.join("pipe");
        mknodat(CWD, &pipe, FileType::Fifo, Mode::RUSR | Mode::WUSR, 0).unwrap();
        let error = write(&pipe, b"new").unwrap_err();
        assert_eq!(error.to_string(), "it is a pipe that no process has read within 2 s");
        // The content is larger than a pipe's capacity. The reader starts late and reads slowly.
        let content: Vec<u8> = (0..=255).cycle().take(200_000).collect();
        let read = {
            let pipe = pipe.clone();
            move || {
                std::thread::sleep(Duration::from_millis(200));
                let mut file = File::open(pipe).unwrap();
                std::thread::sleep(Duration::from_millis(200));
                let mut bytes = Vec::new();
                std::io::Read::read_to_end(&mut file, &mut bytes).unwrap();
                bytes
            }
        };
        let reader = std::thread::spawn(read);
        write(&pipe, &content).unwrap();
        assert!(reader.join().unwrap() == content);
        std::fs::remove_dir_all(folder).unwrap();
    }
}
