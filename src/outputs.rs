//! Checks, before the work begins, whether a command may overwrite its output files and can write them. Claims
//! keep the outputs of a command different from its inputs and from one another.

use std::fs::OpenOptions;
use std::io::{ErrorKind, Read, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};

use headrace_replay::atomic_file::{is_pipe, number_of};
use headrace_replay::log::{DiveLog, RECOVERED_FROM, TRIMMED, in_the_way, named_part, part_path};

use crate::cli::Overwrite;
use crate::failure::Failure;
use crate::files;

/// Metadata key of a log: name of the simulated scene.
pub(crate) const SIMULATED: &str = "simulated";
/// Metadata key of a log: format from which it was imported.
pub(crate) const IMPORTED: &str = "import_format";
/// First line of a rehearsal's vehicle file.
pub(crate) const REHEARSAL: &str = "# Rehearsal by headrace emulate: ";
/// Last line of an SVG chart of a plan.
pub(crate) const PICTURE: &str = "<!-- headrace plan -->\n";
/// First line of a manual page.
pub(crate) const MANUAL: &str = ".\\\" Written by headrace man.\n";
/// Last line of an HTML page of a dive written by `headrace export`.
pub(crate) const EXPORTED: &str = "<!-- headrace export -->\n";
/// First line of the CSV file with a simulation's ground truth.
pub(crate) const TRUTH: &str = "# true values: ";
/// Text that every report contains.
const REPORT: &str = "\"report_version\":";

/// A kind of output file. An existing file of the same kind is overwritten. Any other existing file is overwritten only
/// with `--force`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Report,
    /// A dive recorded live. It is never overwritten without `--force`.
    Dive,
    Simulation,
    Import,
    Trimmed,
    Recovered,
    Truth,
    Rehearsal,
    Picture,
    Manual,
    Page,
    /// A file of a delivery, which is written into an empty folder.
    Delivered,
    /// The recording of a voice note. An existing recording is never of the same kind, because it doesn't show to which
    /// note it belongs.
    Voice,
    /// A vehicle file. People edit it.
    Vehicle,
}

impl Kind {
    /// Reason why output of this kind doesn't overwrite a file of another kind.
    fn refusal(self) -> &'static str {
        match self {
            Self::Report => "isn't a report",
            Self::Dive => "a recording replaces no file",
            Self::Simulation => "isn't a simulated log",
            Self::Import => "isn't an imported log",
            Self::Trimmed => "isn't a trimmed log",
            Self::Recovered => "isn't a recovered log",
            Self::Truth => "isn't a table of true values",
            Self::Rehearsal => "isn't a rehearsal's vehicle file",
            Self::Picture => "isn't a plan's picture",
            Self::Manual => "isn't a page of headrace's manual",
            Self::Page => "isn't an exported dive",
            Self::Delivered => "a delivery replaces no file",
            Self::Voice => "may be another recording",
            Self::Vehicle => "may have been edited",
        }
    }

    /// Whether an existing file is output of this kind.
    fn is(self, path: &Path) -> bool {
        let logged = |key: &str| {
            let log = DiveLog::open(&[path.to_owned()]);
            log.is_ok_and(|log| log.header().metadata.contains_key(key))
        };
        match self {
            Self::Dive | Self::Delivered | Self::Voice | Self::Vehicle => false,
            Self::Simulation => logged(SIMULATED),
            Self::Import => logged(IMPORTED),
            Self::Trimmed => logged(TRIMMED),
            Self::Recovered => logged(RECOVERED_FROM),
            Self::Report => files::read_report(path)
                .is_ok_and(|text| text.trim_start().starts_with('{') && text.contains(REPORT)),
            Self::Truth => begins(path, TRUTH),
            Self::Rehearsal => begins(path, REHEARSAL),
            Self::Manual => begins(path, MANUAL),
            Self::Page => ends(path, EXPORTED),
            Self::Picture => files::read_report(path).is_ok_and(|text| text.ends_with(PICTURE)),
        }
    }
}

/// Beginning of a file, as text.
fn begin(path: &Path) -> Option<String> {
    let mut bytes = Vec::new();
    std::fs::File::open(path).ok()?.take(4096).read_to_end(&mut bytes).ok()?;
    Some(String::from_utf8_lossy(&bytes).into_owned())
}

fn begins(path: &Path, mark: &str) -> bool {
    begin(path).is_some_and(|text| text.starts_with(mark))
}

/// Whether a file ends with the text `mark`. The file may have any size.
fn ends(path: &Path, mark: &str) -> bool {
    let end = || {
        let mut file = std::fs::File::open(path)?;
        let mut bytes = Vec::new();
        let back = i64::try_from(mark.len()).unwrap_or(i64::MAX);
        file.seek(SeekFrom::End(-back))?;
        file.read_to_end(&mut bytes)?;
        std::io::Result::Ok(bytes == mark.as_bytes())
    };
    end().unwrap_or(false)
}

/// Checks, before the work begins, that a file may be overwritten and can be written. The file isn't changed.
///
/// Errors: the existing file is of another kind and there is no `--force`, or the file can't be written or
/// created.
fn may_write(path: &Path, kind: Kind, force: bool) -> Result<(), Failure> {
    let failed = |source| Failure::Unwritable { path: path.to_owned(), source };
    if path.symlink_metadata().is_err() {
        // The file is created and removed again, because no other check shows for certain that it can be created.
        OpenOptions::new().write(true).create_new(true).open(path).map_err(failed)?;
        return std::fs::remove_file(path).map_err(failed);
    }
    if path.is_dir() {
        return Err(failed(ErrorKind::IsADirectory.into()));
    }
    // Terminals, pipes and /dev/null have no content to lose.
    if path.is_file() && !force && !kind.is(path) {
        return Err(Failure::Usage(format!(
            "writing {}: it exists, and {}; give another name, or overwrite it with --force",
            path.display(),
            kind.refusal()
        )));
    }
    if is_pipe(path) {
        // Opening a pipe would wait for a reader, and closing it would end the reader's input.
        return rustix::fs::access(path, rustix::fs::Access::WRITE_OK).map_err(|error| failed(error.into()));
    }
    OpenOptions::new().write(true).open(path).map(|_| ()).map_err(failed)
}

/// Removes a file that may be overwritten, for writers that create only new files.
///
/// Terminals, pipes and devices remain.
pub(crate) fn make_way(path: &Path) -> Result<(), Failure> {
    if !path.is_file() {
        return Ok(());
    }
    match std::fs::remove_file(path) {
        Err(source) if source.kind() != ErrorKind::NotFound => {
            Err(Failure::Unwritable { path: path.to_owned(), source })
        }
        _ => Ok(()),
    }
}

/// Creates a folder for outputs.
pub(crate) fn folder(path: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(path).map_err(|source| Failure::Unwritable { path: path.to_owned(), source })
}

/// Claims of a command: the files that it reads, and those that it will write.
pub(crate) struct Claims {
    force: bool,
    inputs: Vec<PathBuf>,
    outputs: Vec<Claimed>,
}

/// An output file that a command has claimed.
struct Claimed {
    /// Option or argument that names the output.
    option: &'static str,
    path: PathBuf,
    /// Whether the output is a recording, which may also write files of later parts.
    is_recording: bool,
}

impl Claims {
    /// Creates the claims of a command that reads the files `inputs` and has no output yet.
    pub(crate) fn reading(inputs: impl IntoIterator<Item = PathBuf>, overwrite: &Overwrite) -> Self {
        Self { force: overwrite.force, inputs: inputs.into_iter().collect(), outputs: Vec::new() }
    }

    /// Checks, before the work begins, that a file may be overwritten and can be written. The file isn't
    /// changed.
    ///
    /// Errors: the command reads the file or already writes it, the existing file is of another kind and
    /// there is no `--force`, or the file can't be written or created.
    pub(crate) fn claim(&mut self, option: &'static str, path: &Path, kind: Kind) -> Result<(), Failure> {
        self.add(Claimed { option, path: path.to_owned(), is_recording: false })?;
        may_write(path, kind, self.force)
    }

    /// Claims a recording, in parts if `rotated`. The recorder itself creates the first file, whose path is
    /// returned.
    ///
    /// Errors: see [`claim`](Self::claim). Another error is an existing file with the name of another part of this
    /// recording.
    pub(crate) fn claim_recording(
        &mut self,
        option: &'static str,
        path: &Path,
        rotated: bool,
    ) -> Result<PathBuf, Failure> {
        self.add(Claimed { option, path: path.to_owned(), is_recording: true })?;
        let first = if rotated { part_path(path, 1) } else { path.to_owned() };
        self.is_no_input(&first)?;
        may_write(&first, Kind::Dive, self.force)?;
        let failed = |source| Failure::Unwritable { path: path.to_owned(), source };
        match in_the_way(path).map_err(failed)?.iter().find(|file| **file != first) {
            Some(other) => Err(Failure::Usage(format!(
                "writing {} ({option}): {} exists, and would be taken for a part of it; give another name, or move it away",
                path.display(),
                other.display()
            ))),
            None => Ok(first),
        }
    }

    fn add(&mut self, new: Claimed) -> Result<(), Failure> {
        self.is_no_input(&new.path)?;
        for earlier in &self.outputs {
            let shown = (new.path.display(), new.option, earlier.option, earlier.path.display());
            let (path, option, other, other_path) = shown;
            if is_same(&new.path, &earlier.path) {
                return Err(Failure::Usage(format!(
                    "writing {path} ({option}): {other} {other_path} is the same file, given twice; name two files"
                )));
            }
            if new.is_part_of(earlier) || earlier.is_part_of(&new) {
                return Err(Failure::Usage(format!(
                    "writing {path} ({option}): one of this and {other} {other_path} is the name of a part of the other; \
                     give another name"
                )));
            }
        }
        self.outputs.push(new);
        Ok(())
    }

    fn is_no_input(&self, output: &Path) -> Result<(), Failure> {
        let Some(input) = self.inputs.iter().find(|input| is_same(input, output)) else { return Ok(()) };
        let other_name = if input == output { String::new() } else { format!(", as {}", input.display()) };
        Err(Failure::Usage(format!(
            "writing {}: it is read by this command{other_name}; give another name",
            output.display()
        )))
    }
}

impl Claimed {
    /// Whether the output has the file name that a part of `recording` would have.
    fn is_part_of(&self, recording: &Self) -> bool {
        recording.is_recording && named_part(&self.path).is_some_and(|(of, _)| is_same(&of, &recording.path))
    }
}

/// Whether two paths lead to the same file, or will do so once the file exists.
///
/// Special files such as `/dev/null` have no content to lose, so they don't count.
fn is_same(one: &Path, other: &Path) -> bool {
    let is_special = |path: &Path| path.metadata().is_ok_and(|there| !there.is_file() && !there.is_dir());
    if is_special(one) || is_special(other) {
        return false;
    }
    let number = |path: &Path| path.metadata().ok().and_then(|there| number_of(&there));
    place(one) == place(other) || number(one).is_some_and(|one| number(other) == Some(one))
}

/// Canonical path of the file to which a path leads. The file needn't exist.
fn place(path: &Path) -> PathBuf {
    let beside = || {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let folder = folder.unwrap_or(Path::new(".")).canonicalize().ok()?;
        path.file_name().map(|name| folder.join(name))
    };
    path.canonicalize().ok().or_else(beside).unwrap_or_else(|| path.to_owned())
}
