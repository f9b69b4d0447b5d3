//! What a ray meets on a wall.

use super::vector::V3;

/// A place of the wall and what it is.
#[derive(Debug, Clone, Copy)]
pub(super) struct Face {
    /// Unit normal, towards the water.
    pub(super) normal: V3,
    /// The feature that has displaced the wall there.
    pub(super) feature: Option<u16>,
}
