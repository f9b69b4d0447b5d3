//! Access rights of a device file, and the command that grants access to the file.

use std::fs;
use std::os::unix::fs::MetadataExt as _;

use super::machine::Machine;
use crate::fix_hint;
use crate::open_error::OpenError;

/// Access rights of a device file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Rights {
    /// Name of the owner, or the owner's id if it has no name.
    pub owner: String,
    /// Name of the group, or the group's id if it has no name.
    pub group: String,
    /// The nine permission bits, as for `chmod`.
    pub mode: u32,
    /// Whether the user can read and write the file.
    pub may_open: bool,
    /// Whether the group has access and isn't root's group.
    by_group: bool,
    /// Whether `/etc/group` lists the user in the group. A session that began before the user was added lacks
    /// the group's rights.
    listed: bool,
}

impl Rights {
    /// Returns the rights of a device file; `None` if it doesn't exist.
    pub(super) fn of(machine: &Machine, path: &str) -> Option<Self> {
        let file = fs::metadata(machine.path(path)).ok()?;
        let (uid, gids) = machine.ids();
        let mode = file.mode() & 0o777;
        let bits = if uid == file.uid() {
            mode >> 6
        } else if gids.contains(&file.gid()) {
            mode >> 3
        } else {
            mode
        };
        let group = machine.name_of("/etc/group", file.gid());
        // A user must never be advised to join root's group.
        let by_group = mode >> 3 & 0o6 == 0o6 && group.as_deref().is_some_and(|group| group != "root");
        let group = group.unwrap_or_else(|| file.gid().to_string());
        let by_mode = uid == 0 || bits & 0o6 == 0o6;
        Some(Self {
            owner: machine.name_of("/etc/passwd", file.uid()).unwrap_or_else(|| file.uid().to_string()),
            listed: by_group && machine.is_listed(&group),
            group,
            mode,
            may_open: machine.asked_kernel(path).unwrap_or(by_mode),
            by_group,
        })
    }

    /// Returns the error for a device file that the user can't open.
    pub(super) fn trouble(&self, path: &str) -> Option<OpenError> {
        (!self.may_open).then(|| OpenError::denied(path, &self.remedy(path)))
    }

    fn remedy(&self, path: &str) -> String {
        if self.listed {
            fix_hint::log_in_again(&self.group)
        } else if self.by_group {
            fix_hint::join(&self.group)
        } else {
            fix_hint::rule(path)
        }
    }
}

/// Returns the command that gives the current user access to a device file.
pub(crate) fn remedy_for(path: &str) -> String {
    let rights = Rights::of(&Machine::ours(), path);
    rights.map_or_else(|| fix_hint::rule(path), |rights| rights.remedy(path))
}
