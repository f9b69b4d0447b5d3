//! Results of a dive for others: figures, the report as HTML and PDF, and files for other programs.

pub mod collect;
pub mod document;
pub mod files;
pub mod pictures;
pub mod report;
