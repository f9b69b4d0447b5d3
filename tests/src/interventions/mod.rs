//! Judges displayed causes by intervention: each dive is simulated with and without each of its injected causes.
//!
//! The true cause of a failed section is the injected cause whose removal brings the hole within the target. If two
//! causes must both be removed, the two together are the true cause. If removing either one of the two is enough, each
//! of them is a right answer. Only simulations decide this, not the program's search for causes.

mod draw;
mod judging;
mod knowing;
mod matrix;
mod remedy;

pub use draw::{Drawn, Injected, KINDS};
pub use judging::{InterventionDive, Judged, Right, Stretch, intervene, kinds, report};
pub use knowing::UpperBound;
pub use matrix::Matrix;
pub use remedy::remedies;
