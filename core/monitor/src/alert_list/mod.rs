//! List of alerts with the life cycle of IMO MSC.302(87): raised, acknowledged, silenced, rectified, cleared.
//!
//! Each situation has one alert, whose number never changes. Conditions are checked at each advice update.
//! Missed stretches are added when their sections are judged. Commands take effect at their place in the
//! packet stream. The list is therefore the same in a replay, however the stream was cut into ticks. The list
//! holds figures, no texts: [`texts`] makes the texts for display. `docs/reference/alerts.md` has the table.

pub(crate) mod alert;
mod conditions;
pub mod json;
pub(crate) mod kind;
mod life_cycle;
mod list;
mod runs;
#[cfg(test)]
mod tests;
pub mod texts;
mod timer;

pub use alert::{Acknowledgement, AlertChange, AlertState, Figures, ListedAlert};
pub(super) use conditions::AdviceUpdate;
pub use json::{AlertCountsJson, LeftJson, ListedAlertJson, NoteJson, SettingJson, SpokenJson};
pub use kind::{AlertClass, ListKind, Priority};
pub(super) use life_cycle::AlertOutputs;
pub use list::{AlertList, MOST_LISTED, SILENCE};
pub(super) use runs::RunInput;
pub use texts::TextContext;

pub use super::observations::{Occurrence, Occurrences};
