//! Coverage: samples on the unrolled wall, the holes between them, and the verdict on each section.
//!
//! [`SampleStore`] keeps samples. [`HoleFinder`] finds the largest empty circle of a section. [`Sections`] turns holes
//! into verdicts and flags. [`explain`] finds why a section failed. [`Runs`] joins flagged sections into missed
//! stretches.
//!
//! ```
//! use headrace_coverage::{HoleFinder, SampleStore, StoreLayout, WallSample};
//!
//! // Samples every 0.5 m along and around a wall of 10 m perimeter.
//! let layout = StoreLayout { perimeter_m: 10.0, from_m: 0.0, to_m: 5.0, cell_m: 0.25, capacity: 1000 };
//! let mut store = SampleStore::new(layout);
//! for number in 0..200 {
//!     let (x_m, arc_m) = (0.5 * f64::from(number / 20), 0.5 * f64::from(number % 20));
//!     store.insert(WallSample { x_m, arc_m, head: 0, step_m: None, visit: 0 })?;
//! }
//! // The largest empty circle is as wide as the diagonal of the square between four samples.
//! let hole = HoleFinder::default().largest(&store, 1.0, 1.5);
//! assert!(hole.bounded && (hole.diameter_m - 0.5 * 2.0_f64.sqrt()).abs() < 1e-6);
//! # Ok::<(), headrace_coverage::StoreError>(())
//! ```

#![cfg_attr(not(test), warn(clippy::cast_possible_truncation))]
#![cfg_attr(test, allow(clippy::cast_possible_truncation))]

pub mod action;
pub mod again;
pub mod cause;
pub mod deviation;
pub mod evidence;
pub mod explain;
pub mod frontier;
pub mod hole;
pub mod missing_samples;
pub mod openings;
mod origin;
pub mod other_target;
pub mod passage;
pub mod relief;
pub mod runs;
pub mod section;
pub mod sections;
pub mod soundings;
pub mod store;
pub mod trust;
pub mod unsure;
pub mod visits;
pub mod wall;
pub mod wall_limits;

pub use action::Action;
pub use again::{Again, Failing};
pub use cause::{Cause, Causes};
pub use evidence::Evidence;
pub use frontier::{Frontier, HeadReach, Outlook, Reach};
pub use hole::{Hole, HoleFinder};
pub use missing_samples::{MissingSample, MissingSamples};
pub use passage::{Drive, Loss, OtherSettings, PassError, Passage};
pub use relief::Relief;
pub use runs::{Run, RunChange, RunId, Runs};
pub use section::{Judgement, Metres, Section, Spread, Verdict};
pub use sections::{Judging, Request, Sections, WallStretch, back_to_m};
pub use soundings::{GridLayout, GridNode, GridSummary, Soundings};
pub use store::{Fidelity, Kept, SampleStore, StoreError, StoreLayout, StoreUse, WallSample};
pub use trust::{Beam, Distrust};
pub use unsure::{Driven, Largest, Stretch, Unsure};
pub use visits::{Visit, Visits};
pub use wall::{HeadWall, MOST_WAITING, Sorted, Taken};
pub use wall_limits::{PlacedReturn, WallLimits};
