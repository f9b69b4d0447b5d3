//! Tests with simulated vehicles at rest, whose heads are mounted differently from their file.

mod found;
mod jacobian;
mod refused;
mod stand;
