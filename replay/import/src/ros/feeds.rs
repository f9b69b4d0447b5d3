//! Topics, and the sensors that receive their messages.

use std::collections::BTreeMap;

use super::feed::Feed;
use super::message::Type;
use super::wire::Encoding;
use crate::entry::{Entry, ImportReport};
use crate::order::WINDOW_NS;

/// A topic of a ROS recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Topic {
    /// Name of the topic.
    pub name: String,
    /// Name of the topic's message type.
    pub type_name: String,
    /// Message type, if it is supported; otherwise the reason why it isn't.
    pub known: Result<Type, String>,
}

/// The sensors that receive messages, by topic.
#[derive(Default)]
pub struct Feeds {
    pub(super) by_topic: BTreeMap<String, Feed>,
    /// Assignments of topics to sensors made without a mapping, as text.
    pub(super) matched: Vec<String>,
}

impl Feeds {
    /// Returns the assignments of topics to sensors made without a mapping, as text.
    pub fn matched(&self) -> &[String] {
        &self.matched
    }

    /// Returns how old values can be when their message is recorded, ns.
    ///
    /// One message may contain the beams of a head's whole turn.
    pub(super) fn reach_ns(&self) -> u64 {
        if self.by_topic.values().any(Feed::is_of_head) { 40_000_000_000 } else { WINDOW_NS }
    }

    /// Processes a message.
    ///
    /// A message belongs to no sensor if its topic is unassigned, or if its type isn't the type that the topic's sensor
    /// expects.
    pub(crate) fn take(
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
            // A message for no sensor becomes an empty entry, so that the import counts it.
            None => out.push(Entry { stamp_ns: record_ns, stream: String::new(), bytes: Vec::new() }),
        }
    }

    pub(crate) fn report(&self) -> ImportReport {
        let mut report = ImportReport::default();
        for (topic, feed) in &self.by_topic {
            feed.tell(topic, &mut report);
        }
        report
    }
}
