//! Sampling theory: the spacing of samples on the wall, layouts of several heads, and how fast one may go.

pub mod advice;
pub mod layout;
pub mod spacing;
