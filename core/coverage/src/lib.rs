//! Coverage: samples on the unrolled wall, the holes between them, and the verdict on each section.

#![cfg_attr(not(test), warn(clippy::cast_possible_truncation))]
#![cfg_attr(test, allow(clippy::cast_possible_truncation))]

pub mod action;
pub mod cause;
pub mod deviation;
pub mod frontier;
pub mod hole;
pub mod openings;
pub mod passage;
pub mod runs;
pub mod section;
pub mod sections;
pub mod soundings;
pub mod store;
pub mod what_if;

pub use action::Action;
pub use cause::{Cause, Evidence};
pub use frontier::{Frontier, HeadReach, Outlook, Reach};
pub use hole::{Hole, HoleFinder};
pub use passage::{Loss, PassError, Passage};
pub use runs::{Run, RunChange, RunId, Runs};
pub use section::{Judgement, Section, Spread, Verdict};
pub use sections::{Judging, Request, Sections};
pub use soundings::{GridLayout, GridNode, GridSummary, Soundings};
pub use store::{Fidelity, Kept, SampleStore, StoreError, StoreLayout, StoreUse, WallSample};
pub use what_if::Metres;
