//! Recordings of ROS. Messages of known types become the bytes that the vehicle file's sensors would have sent.
//!
//! [`bag`] reads bags of ROS 1, [`mcap`] reads recordings of ROS 2. Both pass messages to [`Feeds`], which assigns
//! topics to sensors. The assignment comes from a mapping, or is automatic if only one is possible.

pub mod bag;
mod clocks;
mod feed;
mod feeds;
mod matching;
pub mod mcap;
mod message;
mod points;
mod wire;

pub use feeds::{Feeds, Topic};
pub use matching::MatchError;
pub use message::Type;
pub use wire::Encoding;
