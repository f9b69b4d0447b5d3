//! Claims of one command. They keep outputs different from inputs and from one another.

use std::path::{Path, PathBuf};

use headrace_replay::atomic_file::number_of;
use headrace_replay::log::{in_the_way, named_part, part_path};

use super::{Kind, may_write};
use crate::cli::Overwrite;
use crate::failure::Failure;

/// Files that a command reads, and files that it will write.
pub(crate) struct Claims {
    force: bool,
    inputs: Vec<PathBuf>,
    outputs: Vec<Claimed>,
}

/// An output file.
struct Claimed {
    /// Option or argument that names the output.
    option: &'static str,
    path: PathBuf,
    /// Whether the output is a recording, which may also write parts.
    is_recording: bool,
}

impl Claims {
    /// Creates the claims of a command that reads these files.
    pub(crate) fn reading(inputs: impl IntoIterator<Item = PathBuf>, overwrite: &Overwrite) -> Self {
        Self { force: overwrite.force, inputs: inputs.into_iter().collect(), outputs: Vec::new() }
    }

    /// Checks before the work that a file may be overwritten and can be written. The file isn't changed.
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
    /// Errors: see [`claim`](Self::claim). Another error is an existing file that would pass for another part
    /// of the recording.
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
    /// Whether the output has the name of a part of `recording`.
    fn is_part_of(&self, recording: &Self) -> bool {
        recording.is_recording && named_part(&self.path).is_some_and(|(of, _)| is_same(&of, &recording.path))
    }
}

/// Whether two paths lead to the same file, or will do so once it exists.
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

/// File to which a path leads. The file may not exist yet.
fn place(path: &Path) -> PathBuf {
    let beside = || {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let folder = folder.unwrap_or(Path::new(".")).canonicalize().ok()?;
        path.file_name().map(|name| folder.join(name))
    };
    path.canonicalize().ok().or_else(beside).unwrap_or_else(|| path.to_owned())
}
