//! Files that are there whole or not at all: written beside their place, and put there once they are complete and synced. What
//! was there before stays until then, and for good where the writing fails.

use std::fs::{File, Metadata, OpenOptions};
use std::io::{BufWriter, Error, ErrorKind, Result, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

/// How long a named pipe is waited for that no process reads.
const READER_WITHIN: Duration = Duration::from_secs(2);
const READER_TRIES: u32 = 100;

/// A file that is being written. Dropping it before [`WholeFile::complete`] leaves what was there before, and nothing else.
#[derive(Debug)]
pub struct WholeFile {
    file: BufWriter<File>,
    /// Where it belongs, and its name until then; `None` for what is written in its place.
    beside: Option<(PathBuf, Beside)>,
}

/// How a file is kept beside its place.
#[derive(Debug)]
enum Beside {
    /// Under a name of its own.
    Named(PathBuf),
    /// Without a name: nothing is left behind, whatever ends the program.
    Nameless,
}

impl WholeFile {
    /// Begins a file that is to be at `path`, or where a link there leads. What can't be replaced is written in its place:
    /// pipes, terminals and devices, and a file whose folder takes no other one.
    ///
    /// Errors: the system's.
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

    /// Puts the file in its place. Once this returns it survives a power cut.
    ///
    /// Errors: the system's; what was there before is there still.
    pub fn complete(mut self) -> Result<()> {
        self.file.flush()?;
        let Some((place, beside)) = &mut self.beside else { return Ok(()) };
        self.file.get_ref().sync_all()?;
        if matches!(beside, Beside::Nameless) {
            // What has no name can't replace a file at once.
            let name = name_beside(place);
            give_name(self.file.get_ref(), &name)?;
            *beside = Beside::Named(name);
        }
        if let Beside::Named(name) = beside {
            std::fs::rename(name, &*place)?;
        }
        let folder = folder_of(place).to_owned();
        self.beside = None;
        // Other systems don't open folders, and not every file system syncs them.
        if cfg!(unix) {
            File::open(folder).and_then(|folder| folder.sync_all()).ok();
        }
        Ok(())
    }
}

/// Writes a whole file.
///
/// Errors: the system's; what was there before is there still.
pub fn write(path: &Path, content: &[u8]) -> Result<()> {
    let mut file = WholeFile::create(path)?;
    file.write_all(content)?;
    file.complete()
}

impl Write for WholeFile {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> Result<()> {
        self.file.flush()
    }
}

impl Seek for WholeFile {
    fn seek(&mut self, to: SeekFrom) -> Result<u64> {
        self.file.seek(to)
    }
}

impl Drop for WholeFile {
    fn drop(&mut self) {
        let Some((_, Beside::Named(name))) = &self.beside else { return };
        if let Err(error) = std::fs::remove_file(name) {
            tracing::warn!("{} is left behind: {error}", name.display());
        }
    }
}

/// Whether a path is a named pipe, which opens only once somebody reads it.
#[cfg(unix)]
pub fn is_pipe(path: &Path) -> bool {
    use std::os::unix::fs::FileTypeExt as _;
    std::fs::metadata(path).is_ok_and(|there| there.file_type().is_fifo())
}

/// Whether a path is a named pipe: this system has none among its files.
#[cfg(not(unix))]
pub fn is_pipe(_: &Path) -> bool {
    false
}

/// Opens a named pipe for writing, once a process reads it.
///
/// Errors: the system's; or nobody reads it within [`READER_WITHIN`].
#[cfg(unix)]
fn open_pipe(path: &Path) -> Result<File> {
    use rustix::fs::{Mode, OFlags, fcntl_setfl, open};
    use rustix::io::Errno;
    let mut tries = READER_TRIES;
    loop {
        match open(path, OFlags::WRONLY | OFlags::NONBLOCK | OFlags::CLOEXEC, Mode::empty()) {
            Ok(pipe) => {
                // A slow reader is waited for.
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

/// Begins a file beside its place: without a name where the system knows such files.
fn beside(place: &Path) -> Result<(File, Beside)> {
    if let Some(file) = nameless(folder_of(place)) {
        return Ok((file, Beside::Nameless));
    }
    let name = name_beside(place);
    Ok((OpenOptions::new().write(true).create_new(true).open(&name)?, Beside::Named(name)))
}

/// A file without a name, which can be given one; `None` where file system or kernel have none, or `/proc` isn't there.
#[cfg(target_os = "linux")]
fn nameless(folder: &Path) -> Option<File> {
    use rustix::fs::{CWD, Mode, OFlags, openat};
    let flags = OFlags::TMPFILE | OFlags::WRONLY | OFlags::CLOEXEC;
    let file = File::from(openat(CWD, folder, flags, Mode::from_raw_mode(0o666)).ok()?);
    path_of(&file).exists().then_some(file)
}

/// A file without a name; `None`, since this system has none.
#[cfg(not(target_os = "linux"))]
fn nameless(_: &Path) -> Option<File> {
    None
}

/// Gives a file without a name one.
#[cfg(target_os = "linux")]
fn give_name(file: &File, name: &Path) -> Result<()> {
    use rustix::fs::{AtFlags, CWD, linkat};
    Ok(linkat(CWD, path_of(file), CWD, name, AtFlags::SYMLINK_FOLLOW)?)
}

/// Gives a file without a name one: there is none.
#[cfg(not(target_os = "linux"))]
fn give_name(_: &File, _: &Path) -> Result<()> {
    Err(ErrorKind::Unsupported.into())
}

/// An open file among the process's own.
#[cfg(target_os = "linux")]
fn path_of(file: &File) -> PathBuf {
    use std::os::fd::AsRawFd as _;
    format!("/proc/self/fd/{}", file.as_raw_fd()).into()
}

/// The folder that a file is in.
pub(crate) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// What a file is besides its names: its device and its number there; `None` where the system has none.
#[cfg(unix)]
pub fn number_of(file: &Metadata) -> Option<(u64, u64)> {
    use std::os::unix::fs::MetadataExt as _;
    Some((file.dev(), file.ino()))
}

/// What a file is besides its names: its device and its number there; `None` where the system has none.
#[cfg(not(unix))]
pub fn number_of(_: &Metadata) -> Option<(u64, u64)> {
    None
}

/// A new name beside a file's, that no folder of logs is read with.
fn name_beside(place: &Path) -> PathBuf {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let mut name = place.file_name().unwrap_or_default().to_owned();
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    name.push(format!(".{}-{count}.unfinished", std::process::id()));
    place.with_file_name(name)
}

/// Whether a folder takes no further file, while one that is in it may still be written.
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
    fn what_was_there_stays_until_the_new_file_is_complete() {
        let folder = folder("stays");
        let path = folder.join("report.json");
        write(&path, b"old").unwrap();
        let mut file = WholeFile::create(&path).unwrap();
        file.write_all(b"new").unwrap();
        file.flush().unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        // A program that is killed now leaves nothing behind.
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
    fn links_and_permissions_stay_and_devices_are_written_to() {
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
    fn pipes_are_written_whole_to_a_reader_and_refused_without_one() {
        use rustix::fs::{CWD, FileType, Mode, mknodat};
        let folder = folder("pipe");
        let pipe = folder.join("pipe");
        mknodat(CWD, &pipe, FileType::Fifo, Mode::RUSR | Mode::WUSR, 0).unwrap();
        let error = write(&pipe, b"new").unwrap_err();
        assert_eq!(error.to_string(), "it is a pipe that no process has read within 2 s");
        // More than a pipe holds, to a reader that comes later and is slow.
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
