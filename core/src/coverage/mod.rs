//! Coverage: samples on the unrolled wall, the holes between them, and the verdict on each section.

pub mod cause;
pub mod frontier;
pub mod hole;
pub mod sections;
pub mod store;

pub use cause::{Cause, Evidence};
pub use frontier::{Frontier, Reach};
pub use hole::{Hole, HoleFinder};
pub use sections::{Doubt, Judgement, Passage, Request, Section, Sections, Spread, Verdict};
pub use store::{SampleIndex, SampleStore, StoreError, StoreLayout, WallSample};
