//! Simulated vehicles at rest in tunnels, with heads mounted otherwise than in their file, and the estimates.

mod found;
mod jacobian;
mod refused;
mod stand;
