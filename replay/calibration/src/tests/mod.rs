//! Vehicles that stand in tunnels, heads that sit otherwise than their file says, and what is found.

mod found;
mod jacobian;
mod refused;
mod stand;
