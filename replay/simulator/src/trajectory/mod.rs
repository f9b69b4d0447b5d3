//! Trajectory of the vehicle through the tunnel: its position relative to the axis at any time.

mod advised;
mod composed;
mod flow;
mod knots;
mod legs;
mod parse;
mod pilot;
mod place;
mod recorded;
mod waypoints;

pub use advised::PilotAdvice;
pub use composed::Trajectory;
pub use flow::Flow;
pub use knots::{Knots, Offsets, wandering};
pub use legs::Leg;
pub(crate) use parse::parse;
pub use place::{Ground, Place};

#[cfg(test)]
mod tests;
