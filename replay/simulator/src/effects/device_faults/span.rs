//! The time span of a device fault.

use headrace_geometry::time::MonoNs;

/// A span of time. Its end is excluded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Span {
    pub(super) from: MonoNs,
    pub(super) to: MonoNs,
}

impl Span {
    pub(super) fn holds(&self, at: MonoNs) -> bool {
        (self.from..self.to).contains(&at)
    }
}
