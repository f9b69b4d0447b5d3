//! The tables, each as a list of columns.

pub(crate) mod dives;
pub(crate) mod runs;
pub(crate) mod sections;
pub(crate) mod sources;
