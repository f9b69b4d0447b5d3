//! Makers' message sets. Values are kept as raw integers, as on the wire. A constant next to each message states the
//! physical size of one raw unit.

pub mod bosch;
mod fields;
pub mod j1939;
pub mod sbg;
pub mod xsens;

pub use fields::{MessageError, scaled};
