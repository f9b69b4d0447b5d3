//! Who may open a device file, and what gives the right to it.

use std::fs;
use std::os::unix::fs::MetadataExt as _;

use super::machine::Machine;
use crate::fix_hint;
use crate::open_error::OpenError;

/// Who may open a device file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Rights {
    /// The owner's name, or number where it has none.
    pub owner: String,
    /// The group's name, or number where it has none.
    pub group: String,
    /// Permissions: nine bits, as `chmod` takes them.
    pub mode: u32,
    /// Whether the user may read and write it.
    pub may_open: bool,
    /// Whether the group may, and is one that people may be in.
    by_group: bool,
    /// Whether the group lists the user, but this session was begun before it did.
    listed: bool,
}

impl Rights {
    /// Those to a device file; `None` where there is none.
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
        // Nobody is put into root's group for the sake of a port.
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

    /// What is wrong with them, where something is.
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

/// The line that gives whoever runs this program the right to a device file.
pub(crate) fn remedy_for(path: &str) -> String {
    let rights = Rights::of(&Machine::ours(), path);
    rights.map_or_else(|| fix_hint::rule(path), |rights| rights.remedy(path))
}
