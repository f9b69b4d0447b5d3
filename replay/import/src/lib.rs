//! Foreign logs become ours: a file is cut into entries, these are put in order of time and handed to the sensors that
//! would have heard them.
//!
//! A [`Format`] knows how a kind of file is cut, without I/O; [`FileKind`] names those that are known. [`Import`] reads,
//! keeps what it holds bounded, moves the file's own times to a clock that begins at [`BEGIN`], and counts what is lost.
//! A [`Taker`] is a sensor of the vehicle file; [`routing`] says which one listens to what.

#![cfg_attr(not(test), warn(clippy::indexing_slicing))]

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
mod taker;
#[cfg(test)]
mod tests;
pub mod tlog;

pub use entry::{Clock, Entry, Step, Told};
pub use error::ImportError;
pub use format::Format;
pub use import::{BEGIN, Import, Imported};
pub use input::{Input, Source};
pub use kind::FileKind;
pub use order::Order;
pub use taker::Taker;
