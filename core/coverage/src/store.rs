//! Samples on the unrolled wall. The wall is divided into bricks; a brick has several rows of square cells around the
//! perimeter.
//!
//! Bricks near the vehicle are open: they hold unpacked samples, listed by cell. In bricks farther away, samples are
//! packed to four bytes each. A packed brick is opened again when the vehicle comes back or a pass search needs it.
//! Full cells are thinned, so memory in use grows with the wall seen, not with the duration of the dive. All memory is
//! allocated before the dive starts. The OS maps a page on first use.

mod open;
mod packed;
mod passes;
mod sample_store;
mod thinning;

pub use self::sample_store::{Fidelity, Kept, SampleStore, StoreError, StoreLayout, StoreUse, WallSample};
