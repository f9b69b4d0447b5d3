//! Makers' message sets. Values are kept as the wire's integers; constants beside them have their quanta.

pub mod bosch;
mod fields;
pub mod j1939;
pub mod sbg;
pub mod xsens;

pub use fields::{MessageError, scaled};
