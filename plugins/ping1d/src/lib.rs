//! ping1d
