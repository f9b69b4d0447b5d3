//! Imports foreign logs.
//!
//! A file is split into entries. The entries are put in time order, and routed to the sensors that would have received
//! them.
//!
//! A [`Format`] splits one kind of file, without I/O; [`FileKind`] lists the known kinds. [`Import`] reads with bounded
//! memory, moves the file's times to a clock that begins at [`BEGIN`], and counts losses. A [`Taker`] is a sensor of
//! the vehicle file; [`routing`] assigns recorded connections to sensors.

#![cfg_attr(not(test), warn(clippy::indexing_slicing))]

pub mod a50;
mod calendar;
pub mod candump;
pub mod csv;
pub mod detect;
mod emulated;
mod entry;
mod error;
mod format;
pub mod imagenex;
mod import;
mod input;
mod kind;
mod losses;
mod order;
pub mod ping;
pub mod ros;
pub mod routing;
#[cfg(test)]
mod tests;
pub mod tlog;

pub use entry::{Clock, Entry, ImportReport, Step};
pub use error::ImportError;
pub use format::Format;
pub use import::{BEGIN, Import, Imported};
pub use input::{Input, Source};
pub use kind::FileKind;
pub use order::Order;
pub use routing::Taker;
