//! The channels of a log, and the sources that they belong to.

use std::collections::{BTreeMap, BTreeSet};

use super::format::{
    CONNECT_KEY, PLUGIN_KEY, RAW_PREFIX, RESULT_PREFIX, SENT_PREFIX, SOURCE_KEY, TICK_TOPIC, VOICE_TOPIC,
};
use super::framing::Definition;
use super::limits::{HeaderBudget, MAX_CHANNELS, MAX_SOURCES};
use super::loss::Many;
use super::writer::SourceInfo;

/// Sort rank of the first channel that has no raw bytes of a device. The rank of a raw channel is its source number, a
/// u16.
const OTHER_RANK: u32 = 1 << 16;

/// Kind of content that a channel of a log has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ChannelKind {
    Raw(u16),
    Sent(u16),
    Tick,
    Voice,
    Result,
    Other,
}

/// A channel whose definition was found in the log.
#[derive(Debug, Clone)]
pub(super) struct Channel {
    pub(super) definition: Definition,
    pub(super) kind: ChannelKind,
    /// Sort rank among messages with equal times. Raw channels come first, by source; all other channels follow, by
    /// topic.
    pub(super) rank: u32,
}

/// Result of adding a channel's definition.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Admission {
    /// The channel was added, or it was already known with the same definition.
    Known,
    /// The definition contradicts a known channel.
    Conflict,
    /// The channel exceeds a limit on the log's content.
    Beyond(Many),
}

/// All channels of a log that are known so far.
#[derive(Debug, Default)]
pub(super) struct Channels {
    by_id: BTreeMap<u16, Channel>,
    sources: Vec<SourceInfo>,
    others: u32,
    /// Memory used by the channels' definitions.
    budget: HeaderBudget,
    /// The limit that the channel definitions exceeded when the log was opened, if any.
    refused: Option<Many>,
    /// Channel definitions found among the messages, in order of appearance.
    later: Vec<Definition>,
}

impl Channels {
    /// Creates the channels, and numbers their sources.
    ///
    /// Sources get the numbers in their channels' metadata, if every source has a number and the numbers count from 0.
    /// Otherwise the sources are numbered in the order of their names.
    pub(super) fn new(definitions: BTreeMap<u16, Definition>, budget: HeaderBudget) -> Self {
        let mut definitions: Vec<Definition> = definitions.into_values().collect();
        let numbers: BTreeMap<&str, Option<u16>> =
            definitions.iter().filter_map(|d| source_id(&d.topic).map(|id| (id, stated_number(d)))).collect();
        let distinct: BTreeSet<u16> = numbers.values().filter_map(|number| *number).collect();
        let stated = distinct.iter().copied().map(usize::from).eq(0..numbers.len());
        definitions.sort_by_cached_key(|d| (stated.then(|| stated_number(d)), d.topic.clone(), d.id));
        let mut channels = Self { budget, ..Self::default() };
        // Raw channels come first, so that sources with a raw channel get the lower numbers.
        let (raw, others): (Vec<_>, Vec<_>) =
            definitions.into_iter().partition(|d| stated || d.topic.starts_with(RAW_PREFIX));
        for definition in raw.into_iter().chain(others) {
            if let Admission::Beyond(what) = channels.add(definition) {
                channels.refused = Some(what);
            }
        }
        channels
    }

    /// Returns the limit that the channel definitions exceeded when the log was opened; `None` if they exceeded none.
    pub(super) fn refused(&self) -> Option<Many> {
        self.refused
    }

    /// Adds a channel whose definition was found among the messages. A new source gets the next number.
    pub(super) fn admit(&mut self, definition: Definition) -> Admission {
        if let Some(known) = self.by_id.get(&definition.id) {
            return if known.definition == definition { Admission::Known } else { Admission::Conflict };
        }
        if !self.budget.take(definition.cost()) {
            return Admission::Beyond(Many::HeaderBytes);
        }
        let admission = self.add(definition.clone());
        if admission == Admission::Known {
            self.later.push(definition);
        }
        admission
    }

    /// Returns the channel definitions found among the messages so far.
    pub(super) fn later(&self) -> &[Definition] {
        &self.later
    }

    /// Restores the channels that were known at an earlier position in the log. `later` holds the definitions found
    /// among the messages up to that position.
    pub(super) fn go_to(&mut self, later: &[Definition]) {
        let same = self.later.iter().zip(later).take_while(|(one, other)| one.id == other.id).count();
        for gone in self.later.drain(same..).rev() {
            self.budget.give_back(gone.cost());
            if let Some(Channel { kind, .. }) = self.by_id.remove(&gone.id)
                && !matches!(kind, ChannelKind::Raw(_))
            {
                self.others -= 1;
            }
        }
        let known = self.by_id.values().filter_map(|channel| match channel.kind {
            ChannelKind::Raw(source) | ChannelKind::Sent(source) => Some(usize::from(source) + 1),
            _ => None,
        });
        self.sources.truncate(known.max().unwrap_or(0));
        for definition in later.iter().skip(same) {
            self.admit(definition.clone());
        }
    }

    fn add(&mut self, definition: Definition) -> Admission {
        if self.by_id.len() >= MAX_CHANNELS {
            return Admission::Beyond(Many::Channels);
        }
        if source_id(&definition.topic).is_some_and(|id| !self.has_room_for(id)) {
            return Admission::Beyond(Many::Sources);
        }
        let kind = match definition.topic.as_str() {
            TICK_TOPIC => ChannelKind::Tick,
            VOICE_TOPIC => ChannelKind::Voice,
            topic if topic.starts_with(RESULT_PREFIX) => ChannelKind::Result,
            topic => match source_id(topic).map(str::to_owned) {
                Some(id) if topic.starts_with(RAW_PREFIX) => {
                    ChannelKind::Raw(self.source(id, &definition.metadata))
                }
                Some(id) => ChannelKind::Sent(self.source(id, &definition.metadata)),
                None => ChannelKind::Other,
            },
        };
        let rank = if let ChannelKind::Raw(source) = kind {
            source.into()
        } else {
            self.others += 1;
            OTHER_RANK + self.others
        };
        self.by_id.insert(definition.id, Channel { definition, kind, rank });
        Admission::Known
    }

    fn has_room_for(&self, id: &str) -> bool {
        self.sources.len() < MAX_SOURCES || self.sources.iter().any(|source| source.id == id)
    }

    pub(super) fn get(&self, id: u16) -> Option<&Channel> {
        self.by_id.get(&id)
    }

    pub(super) fn all(&self) -> impl Iterator<Item = &Definition> {
        self.by_id.values().map(|channel| &channel.definition)
    }

    pub(super) fn sources(&self) -> &[SourceInfo] {
        &self.sources
    }

    pub(super) fn has(&self, kind: ChannelKind) -> bool {
        self.by_id.values().any(|channel| channel.kind == kind)
    }

    pub(super) fn result_topics(&self) -> Vec<String> {
        let results = self.by_id.values().filter(|channel| channel.kind == ChannelKind::Result);
        results.map(|channel| channel.definition.topic.clone()).collect()
    }

    /// Returns the topics that more than one channel has, each with its channel numbers.
    pub(super) fn doubles(&self) -> Vec<(String, Vec<u16>)> {
        let mut topics: BTreeMap<&str, Vec<u16>> = BTreeMap::new();
        for (id, channel) in &self.by_id {
            topics.entry(&channel.definition.topic).or_default().push(*id);
        }
        let several = topics.into_iter().filter(|(_, ids)| ids.len() > 1);
        several.map(|(topic, ids)| (topic.to_owned(), ids)).collect()
    }

    fn source(&mut self, id: String, metadata: &BTreeMap<String, String>) -> u16 {
        let known = self.sources.iter().position(|source| source.id == id);
        let number = known.unwrap_or_else(|| {
            let text = |key| metadata.get(key).cloned().unwrap_or_default();
            self.sources.push(SourceInfo { id, plugin: text(PLUGIN_KEY), connect: text(CONNECT_KEY) });
            self.sources.len() - 1
        });
        // The index is below MAX_SOURCES, which fits into a u16.
        u16::try_from(number).unwrap_or(u16::MAX)
    }
}

fn source_id(topic: &str) -> Option<&str> {
    topic.strip_prefix(RAW_PREFIX).or_else(|| topic.strip_prefix(SENT_PREFIX))
}

fn stated_number(definition: &Definition) -> Option<u16> {
    definition.metadata.get(SOURCE_KEY)?.parse().ok()
}

/// Returns the channels from the metadata record that lists them.
pub(super) fn listed(entries: &BTreeMap<String, String>) -> Vec<Definition> {
    let mut definitions: BTreeMap<u16, Definition> = BTreeMap::new();
    for (key, value) in entries {
        let Some((id, key)) = key.split_once('/') else { continue };
        let Ok(id) = id.parse() else { continue };
        let definition = definitions.entry(id).or_insert_with(|| Definition {
            id,
            topic: String::new(),
            metadata: BTreeMap::new(),
            form: None,
        });
        if key == "topic" {
            definition.topic.clone_from(value);
        } else {
            definition.metadata.insert(key.to_owned(), value.clone());
        }
    }
    definitions.into_values().filter(|definition| !definition.topic.is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channels(topics: &[(&str, Option<&str>)]) -> Channels {
        let definition = |(id, (topic, source)): (u16, &(&str, Option<&str>))| {
            let metadata =
                source.map(|source| (SOURCE_KEY.to_owned(), source.to_owned())).into_iter().collect();
            (id, Definition { id, topic: (*topic).to_owned(), metadata, form: None })
        };
        Channels::new((0..).zip(topics).map(definition).collect(), HeaderBudget::default())
    }

    fn ids(channels: &Channels) -> Vec<&str> {
        channels.sources().iter().map(|source| source.id.as_str()).collect()
    }

    #[test]
    fn sources_are_numbered_by_name() {
        let channels = channels(&[("/sent/a", None), ("/raw/z", None), ("/raw/b", None), ("/imu", None)]);
        assert_eq!(ids(&channels), ["b", "z", "a"]);
        assert_eq!(channels.get(1).unwrap().kind, ChannelKind::Raw(1));
        assert_eq!(channels.get(0).unwrap().kind, ChannelKind::Sent(2));
        assert!(channels.get(0).unwrap().rank > channels.get(1).unwrap().rank);
        assert_eq!(channels.get(3).unwrap().kind, ChannelKind::Other);
    }

    #[test]
    fn source_numbers_come_from_metadata_only_if_all_are_valid() {
        let stated =
            [("/raw/a", Some("1")), ("/raw/b", Some("0")), ("/sent/a", Some("1")), ("/loop/tick", None)];
        assert_eq!(ids(&channels(&stated)), ["b", "a"]);
        assert_eq!(ids(&channels(&[("/raw/a", Some("1")), ("/raw/b", Some("2"))])), ["a", "b"]);
        assert_eq!(ids(&channels(&[("/raw/a", Some("b")), ("/raw/b", Some("0"))])), ["a", "b"]);
    }

    #[test]
    fn contradicting_second_definition_of_a_channel_is_refused() {
        let mut channels = channels(&[("/raw/a", None)]);
        let same = channels.get(0).unwrap().definition.clone();
        assert_eq!(channels.admit(same.clone()), Admission::Known);
        assert_eq!(channels.admit(Definition { topic: "/raw/b".to_owned(), ..same }), Admission::Conflict);
    }

    #[test]
    fn channels_defined_after_a_position_are_forgotten_on_return_to_it() {
        let mut channels = channels(&[("/raw/a", None)]);
        let first = channels.get(0).unwrap().definition.clone();
        for (id, topic) in [(7, "/raw/b"), (5, "/imu"), (9, "/sent/c")] {
            let later = Definition { id, topic: topic.to_owned(), ..first.clone() };
            assert_eq!(channels.admit(later), Admission::Known);
        }
        let (all, ranks) = (channels.later().to_vec(), [7, 5, 9].map(|id| channels.get(id).unwrap().rank));
        channels.go_to(&all[..1]);
        assert_eq!((ids(&channels), channels.get(5).is_none()), (vec!["a", "b"], true));
        channels.go_to(&all);
        assert_eq!(ids(&channels), ["a", "b", "c"]);
        assert_eq!([7, 5, 9].map(|id| channels.get(id).unwrap().rank), ranks);
        channels.go_to(&[]);
        assert_eq!((ids(&channels), channels.later().len()), (vec!["a"], 0));
    }

    #[test]
    fn excess_channels_and_sources_are_refused() {
        let topics: Vec<String> = (0..MAX_SOURCES + 2).map(|n| format!("/raw/{n}")).collect();
        let all: Vec<_> = topics.iter().map(|topic| (topic.as_str(), None)).collect();
        let found = channels(&all);
        assert_eq!((found.sources().len(), found.refused()), (MAX_SOURCES, Some(Many::Sources)));
        assert_eq!(channels(&all[2..]).refused(), None);
        let all: Vec<_> = (0..=MAX_CHANNELS).map(|_| ("/imu", None)).collect();
        assert_eq!(channels(&all).refused(), Some(Many::Channels));
        assert_eq!(channels(&all[1..]).refused(), None);
    }
}
