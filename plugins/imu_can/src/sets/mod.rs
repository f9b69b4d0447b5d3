//! Makers' message sets. Values are kept as integer counts, as on the wire. Constants beside them state the
//! size of one count.

pub mod bosch;
mod fields;
pub mod j1939;
pub mod sbg;
pub mod xsens;

pub use fields::{MessageError, scaled};
