//! The wall where a ray meets it.

use super::vector::V3;

/// The wall at a point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Face {
    /// Unit normal, towards the water.
    pub(super) normal: V3,
    /// The feature that displaced the wall there.
    pub(super) feature: Option<u16>,
}
