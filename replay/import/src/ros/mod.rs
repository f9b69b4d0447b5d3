//! Recordings of ROS: messages of known types become the bytes that sensors of the vehicle file would have sent.
//!
//! [`bag`] reads bags of ROS 1, [`mcap`] those of ROS 2. Both hand messages to [`Feeds`], which knows by a mapping, or by there being no
//! choice, whose they are.

pub mod bag;
mod clocks;
mod feed;
mod matching;
pub mod mcap;
mod message;
mod points;
mod ranges;
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
    /// The name of its messages' type.
    pub type_name: String,
    /// The type, where it is known and can be read; else why not.
    pub known: Result<Type, String>,
}

/// Who gets the messages of which topic.
#[derive(Default)]
pub struct Feeds {
    by_topic: BTreeMap<String, Feed>,
    /// What was matched without being said, in words.
    matched: Vec<String>,
}

impl Feeds {
    /// What was matched without being said, in words.
    pub fn matched(&self) -> &[String] {
        &self.matched
    }

    /// How long before a message its values may have been: the beams of a head's turn come together.
    pub(super) fn reach_ns(&self) -> u64 {
        if self.by_topic.values().any(Feed::is_of_head) { 40_000_000_000 } else { WINDOW_NS }
    }

    /// Takes a message. Those of other topics, and of types that aren't the topic's, are nobody's.
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
            // Counted as passed over.
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
