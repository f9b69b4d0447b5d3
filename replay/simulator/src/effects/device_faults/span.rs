//! When a device is broken.

use headrace_geometry::time::MonoNs;

/// From a time to another, which is excluded.
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
