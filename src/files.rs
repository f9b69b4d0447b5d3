//! Reads and writes files, and loads built-in and attached files.

use std::cell::RefCell;
use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use headrace_monitor::report::Report;
use headrace_replay::atomic_file::{self, AtomicFile};
use headrace_replay::regular_file;

use crate::failure::Failure;

/// The demonstration's scene, built in so that the binary needs no files.
pub(crate) const DEMO_SCENE: (&str, &str) =
    ("deploy/scenes/demo.toml", include_str!("../deploy/scenes/demo.toml"));
const DEMO_VEHICLE: (&str, &str) =
    ("../vehicles/vita2-4.toml", include_str!("../deploy/vehicles/vita2-4.toml"));

/// Path of the first log on the command line. Messages about several logs name only this one.
pub(crate) fn first_named(logs: &[PathBuf]) -> &Path {
    logs.first().map_or(Path::new(""), PathBuf::as_path)
}

/// Maximum size of a vehicle file, scene or mapping file, and of a text file named in such a file, bytes.
const TEXT_BYTES: u64 = 16 << 20;
/// Maximum size of a report, and of a mesh or trajectory that a scene names, bytes.
const DATA_BYTES: u64 = 256 << 20;

/// Reads a hand-written text file.
pub(crate) fn read(path: &Path) -> Result<String, Failure> {
    read_up_to(path, TEXT_BYTES)
}

/// Reads a report.
pub(crate) fn read_report(path: &Path) -> Result<String, Failure> {
    read_up_to(path, DATA_BYTES)
}

fn read_up_to(path: &Path, bytes: u64) -> Result<String, Failure> {
    regular_file::read_text(path, bytes).map_err(|source| Failure::Read { path: path.to_owned(), source })
}

/// Opens a file of any length.
pub(crate) fn open(path: &Path) -> Result<File, Failure> {
    regular_file::open(path).map_err(|source| Failure::Read { path: path.to_owned(), source })
}

/// Total size of some files, bytes. Unreadable files count as zero.
pub(crate) fn bytes(files: &[PathBuf]) -> u64 {
    files.iter().filter_map(|file| file.metadata().ok()).map(|metadata| metadata.len()).sum()
}

/// Writes a file atomically.
pub(crate) fn write(path: &Path, content: &[u8]) -> Result<(), Failure> {
    atomic_file::write(path, content).map_err(|source| Failure::Write { path: path.to_owned(), source })
}

/// Writes a report as JSON, atomically, without holding the whole text in memory.
///
/// The JSON of a long dive would take more memory than the dive.
pub(crate) fn write_json(path: &Path, report: &Report) -> Result<(), Failure> {
    let failed = |source| Failure::Write { path: path.to_owned(), source };
    let mut file = AtomicFile::create(path).map_err(failed)?;
    serde_json::to_writer_pretty(&mut file, report).map_err(|error| failed(error.into()))?;
    file.flush().and_then(|()| file.complete()).map_err(failed)
}

/// Loader of the text files that `file` refers to, relative to its folder.
pub(crate) fn beside(file: &Path) -> impl Fn(&str) -> Result<String, String> {
    let folder: PathBuf = file.parent().map(Path::to_owned).unwrap_or_default();
    move |name| {
        let path = folder.join(name);
        regular_file::read_text(&path, TEXT_BYTES)
            .map_err(|error| format!("can't be read at {}: {error}", path.display()))
    }
}

/// Loader of the files that `file` refers to, relative to its folder.
pub(crate) fn bytes_beside(file: &Path) -> impl Fn(&str) -> Result<Vec<u8>, String> {
    let beside = Beside::of(file);
    move |name| beside.load(name)
}

/// Loads the files that a file refers to, and keeps a list of their paths.
pub(crate) struct Beside {
    folder: PathBuf,
    read: RefCell<Vec<PathBuf>>,
}

impl Beside {
    pub(crate) fn of(file: &Path) -> Self {
        let folder = file.parent().map(Path::to_owned).unwrap_or_default();
        Self { folder, read: RefCell::new(vec![file.to_owned()]) }
    }

    /// Loads one of the files that a vehicle or scene file refers to.
    pub(crate) fn load(&self, name: &str) -> Result<Vec<u8>, String> {
        let path = self.folder.join(name);
        self.read.borrow_mut().push(path.clone());
        regular_file::read(&path, DATA_BYTES)
            .map_err(|error| format!("can't be read at {}: {error}", path.display()))
    }

    /// Paths of the file itself and of the referenced files loaded so far.
    pub(crate) fn files(&self) -> Vec<PathBuf> {
        self.read.borrow().clone()
    }
}

/// Loader of the demonstration's built-in files.
pub(crate) fn built_in(name: &str) -> Result<Vec<u8>, String> {
    if name == DEMO_VEHICLE.0 { Ok(DEMO_VEHICLE.1.into()) } else { Err("is not built in".to_owned()) }
}

/// Loader of the text files attached to a log.
pub(crate) fn attached(attachments: &[(String, Vec<u8>)]) -> impl Fn(&str) -> Result<String, String> {
    move |name| {
        let content = attachments.iter().find(|(attached, _)| attached == name).map(|(_, content)| content);
        let content = content.ok_or_else(|| "is not attached to the log".to_owned())?;
        String::from_utf8(content.clone())
            .map_err(|_| "is attached to the log, but isn't UTF-8 text".to_owned())
    }
}
