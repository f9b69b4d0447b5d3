//! Recordings of ROS: messages of known types become the bytes that sensors of the vehicle file would have sent.
//!
//! [`bag`] reads bags of ROS 1, [`mcap`] those of ROS 2. Both pass messages to [`Feeds`], which assigns topics to
//! sensors by a mapping, or if the choice is unique.

pub mod bag;
mod clocks;
mod feed;
mod matching;
pub mod mcap;
mod message;
mod points;
mod ranges;
mod stated;
mod unpack;
mod wire;

use std::collections::BTreeMap;

use crate::entry::{Entry, Told};
use crate::order::WINDOW_NS;

pub use matching::MatchError;
pub use message::Type;
pub use wire::Encoding;

use feed::Feed;

/// A topic of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Topic {
    /// Its name.
    pub name: String,
    /// Name of its message type.
    pub type_name: String,
    /// The type, if known and readable; otherwise the reason why not.
    pub known: Result<Type, String>,
}

/// Assigns topics to sensors.
#[derive(Default)]
pub struct Feeds {
    by_topic: BTreeMap<String, Feed>,
    /// Automatic matches, as text.
    matched: Vec<String>,
}

impl Feeds {
    /// Automatic matches, as text.
    pub fn matched(&self) -> &[String] {
        &self.matched
    }

    /// Greatest age of values at their message, ns. The beams of a head's whole turn come in one message.
    pub(super) fn reach_ns(&self) -> u64 {
        if self.by_topic.values().any(Feed::is_of_head) { 40_000_000_000 } else { WINDOW_NS }
    }

    /// Processes a message. Messages of other topics, or of another type than their topic's, belong to no sensor.
    pub(super) fn take(
        &mut self,
        topic: &Topic,
        encoding: Encoding,
        record_ns: u64,
        bytes: &[u8],
        out: &mut Vec<Entry>,
    ) {
        let feed = self.by_topic.get_mut(&topic.name);
        match feed.filter(|feed| topic.known.as_ref().is_ok_and(|known| feed.is_of(*known))) {
            Some(feed) => feed.take(encoding, record_ns, bytes, out),
            // Counted as belonging to no sensor.
            None => out.push(Entry { stamp_ns: record_ns, stream: String::new(), bytes: Vec::new() }),
        }
    }

    pub(super) fn told(&self) -> Told {
        let mut told = Told::default();
        for (topic, feed) in &self.by_topic {
            feed.tell(topic, &mut told);
        }
        told
    }
}
