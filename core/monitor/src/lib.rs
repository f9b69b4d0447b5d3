//! The loop: three worlds and the alerter, the values that they exchange in a tick, and the view for outlets.
//!
//! [`App`] is assembled from a vehicle's devices and from plugins. Arming turns it into a [`run::Loop`],
//! which converts packets to positions, samples, verdicts and advice. It has no I/O, no thread and no clock:
//! time comes in with the packets.
//!
//! ```
//! use headrace_fusion::direct::DirectNavigation;
//! use headrace_geometry::{time::MonoNs, tunnel::shapes};
//! use headrace_monitor::App;
//! use headrace_vehicle::Mission;
//!
//! let mission = Mission::new(shapes::circle(3.0)?, 0.5);
//! let navigation = DirectNavigation::new(mission.profile.clone(), mission.site);
//! // `App::add_device` adds sensors here, `App::add_plugin` outlets and systems of one's own.
//! let mut dive = App::new(mission).arm(Box::new(navigation))?;
//! let consumed_packets = dive.tick(MonoNs(20_000_000));
//! assert_eq!((consumed_packets, dive.ticks()), (0, 1));
//! // 100 m of tunnel in sections of 0.25 m.
//! assert_eq!(dive.view().coverage().sections.len(), 400);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![cfg_attr(not(test), warn(clippy::cast_possible_truncation))]
#![cfg_attr(test, allow(clippy::cast_possible_truncation))]

pub mod advice_log;
pub mod adviser;
pub mod alert_list;
pub mod alerter;
mod app;
mod arm;
pub mod byte_ring;
pub mod console;
pub mod digest;
pub mod dive_plan;
pub mod entities;
mod error;
pub mod feed;
#[cfg(test)]
mod fixtures;
pub mod head_descriptions;
mod head_health;
mod head_motion;
pub mod live_messages;
pub mod live_state;
pub mod live_text;
mod loss_count;
pub mod merge;
pub mod messages;
pub mod notes;
pub mod notice_outlet;
mod observations;
mod other_settings;
pub mod other_targets;
pub mod outlet;
pub mod page_words;
pub mod part;
pub mod pilot_text;
pub mod placer;
pub mod report;
pub mod resources;
pub mod result_stream;
pub mod ring;
pub mod run;
pub mod section_judgement;
pub mod section_row;
pub mod smoothing_changes;
pub mod source;
pub mod stage;
pub mod surveyor;
pub mod unread;
pub mod unsure_stretch;
pub mod view;
pub mod voice;
pub mod words;

pub use app::{App, Plugin};
pub use error::PluginError;
pub use source::{SourceInfo, SourceSpec};
