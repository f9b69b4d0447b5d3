//! Reads the system's files of this machine, or of a copy of another machine's file tree.

use std::fs;
use std::path::{Path, PathBuf};

use rustix::fs::{Access, access};

/// User for whom access to device files is checked.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum User {
    /// The user running this program. The kernel checks the rights, so access control lists count.
    Ourselves,
    /// Another user. Only file modes are checked.
    Other {
        /// User id.
        uid: u32,
        /// All group ids of the user.
        gids: Vec<u32>,
    },
}

/// A machine whose files below `/dev`, `/sys`, `/proc`, `/etc` and `/lib` are read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Machine {
    root: PathBuf,
    user: User,
}

impl Machine {
    /// This machine, as seen by the user running this program.
    pub fn ours() -> Self {
        Self { root: PathBuf::from("/"), user: User::Ourselves }
    }

    /// A machine whose file tree is below `root`.
    pub fn below(root: &Path, user: User) -> Self {
        Self { root: root.to_owned(), user }
    }

    /// Returns the path, on this host, of the file that is at `absolute` on the machine.
    pub(super) fn path(&self, absolute: &str) -> PathBuf {
        self.root.join(absolute.trim_start_matches('/'))
    }

    pub(super) fn exists(&self, absolute: &str) -> bool {
        self.path(absolute).exists()
    }

    /// Returns the trimmed text of a file; `None` if it is empty or can't be read.
    pub(super) fn text(&self, absolute: &str) -> Option<String> {
        text(&self.path(absolute))
    }

    /// Returns the names in a folder in numeric order: `ttyUSB2` before `ttyUSB10`.
    pub(super) fn names(&self, folder: &str) -> Vec<String> {
        let entries = fs::read_dir(self.path(folder)).into_iter().flatten().flatten();
        let mut names: Vec<String> =
            entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
        names.sort_by_cached_key(|name| {
            let stem = name.trim_end_matches(|c: char| c.is_ascii_digit()).to_owned();
            let number: u64 = name.get(stem.len()..).and_then(|digits| digits.parse().ok()).unwrap_or(0);
            (stem, number)
        });
        names
    }

    /// Returns the user's id and group ids.
    pub(super) fn ids(&self) -> (u32, Vec<u32>) {
        match &self.user {
            User::Other { uid, gids } => (*uid, gids.clone()),
            User::Ourselves => {
                let groups = rustix::process::getgroups().unwrap_or_default();
                let own = rustix::process::getegid();
                let gids = groups.into_iter().chain([own]).map(rustix::process::Gid::as_raw);
                (rustix::process::geteuid().as_raw(), gids.collect())
            }
        }
    }

    /// Asks the kernel whether the user may read and write a file; `None` for another user.
    pub(super) fn asked_kernel(&self, absolute: &str) -> Option<bool> {
        (self.user == User::Ourselves)
            .then(|| access(self.path(absolute), Access::READ_OK | Access::WRITE_OK).is_ok())
    }

    /// Returns the name for an id in `/etc/group` or `/etc/passwd`. The id is the third field in both.
    pub(super) fn name_of(&self, file: &str, number: u32) -> Option<String> {
        let all = self.text(file)?;
        let line = all.lines().find(|line| line.split(':').nth(2) == Some(number.to_string().as_str()))?;
        line.split(':').next().map(str::to_owned)
    }

    /// Whether `/etc/group` lists the user in the group. A session that began before the user was added lacks
    /// the group's rights.
    pub(super) fn is_listed(&self, group: &str) -> bool {
        let listed = || {
            let user = self.name_of("/etc/passwd", self.ids().0)?;
            let all = self.text("/etc/group")?;
            let line = all.lines().find(|line| line.split(':').next() == Some(group))?;
            Some(line.rsplit(':').next()?.split(',').any(|member| member == user))
        };
        listed().unwrap_or(false)
    }

    /// Whether the kernel has registered a protocol of this name, from a module or built in.
    pub(super) fn has_protocol(&self, name: &str) -> bool {
        let all = self.text("/proc/net/protocols").unwrap_or_default();
        all.lines().any(|line| line.split_whitespace().next() == Some(name))
    }

    /// Whether the kernel has this module loaded, built in or available. Write `name` with underscores.
    pub(super) fn has_module(&self, name: &str) -> bool {
        let is_it = |path: &str| {
            let file = path.trim_end_matches(':').rsplit('/').next().unwrap_or_default();
            file.split('.').next().is_some_and(|stem| stem.replace('-', "_") == name)
        };
        let loaded = self.text("/proc/modules").unwrap_or_default();
        let release = self.text("/proc/sys/kernel/osrelease").unwrap_or_default();
        let listed = ["modules.builtin", "modules.dep"].into_iter().any(|list| {
            let list = self.text(&format!("/lib/modules/{release}/{list}")).unwrap_or_default();
            list.lines().filter_map(|line| line.split_whitespace().next()).any(is_it)
        });
        listed
            || self.exists(&format!("/sys/module/{name}"))
            || loaded.lines().any(|line| line.split_whitespace().next() == Some(name))
    }
}

/// Returns the trimmed text of a file; `None` if it is empty or can't be read.
pub(super) fn text(path: &Path) -> Option<String> {
    let bytes = fs::read(path).ok()?;
    Some(String::from_utf8_lossy(&bytes).trim().to_owned()).filter(|text| !text.is_empty())
}
