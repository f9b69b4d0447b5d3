//! The live state: the present state of the dive, as one plain value. `docs/reference/live-state.md` describes
//! it.
//!
//! Every advice update makes a live state, and every tick publishes the latest one. The terminal and the
//! lines of `--json-lines` show it. All fields except [`LiveState::now`] are as of the last update, in data
//! time, and so the same in a replay. [`LiveState::now`] belongs to the tick: a loop without data keeps
//! ticking, and ages are measured up to `now`.

pub(crate) mod condition;
pub mod json;
pub(crate) mod speed_band;
pub(crate) mod state;
pub(crate) mod texts;

#[cfg(test)]
pub(crate) use condition::test_state;
pub use condition::{Condition, Lamp};
pub use speed_band::SpeedBand;
pub(crate) use state::{ActiveObservation, ActiveObservations, source_bits};
pub use state::{
    LEAST_MPS, LIVE_STATE_VERSION, LiveState, OLD_AFTER, PositionDoubt, PositionState, SensorState,
};
pub use texts::SpeedTexts;
