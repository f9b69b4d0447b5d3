//! The wall at the point where a ray meets it.

use super::vector::V3;

/// The wall at one point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Face {
    /// Unit normal, towards the water.
    pub(super) normal: V3,
    /// Number of the feature that displaced the wall at the point.
    pub(super) feature: Option<u16>,
}
