//! The channels of a log and the sources behind them.

use std::collections::{BTreeMap, BTreeSet};

use super::SourceInfo;
use super::format::{
    CONNECT_KEY, PLUGIN_KEY, RAW_PREFIX, RESULT_PREFIX, SENT_PREFIX, SOURCE_KEY, TICK_TOPIC,
};
use super::framing::Definition;

/// Rank of the first channel that isn't raw; source numbers are u16.
const OTHER_RANK: u32 = 1 << 16;

/// What a channel carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ChannelKind {
    Raw(u16),
    Sent(u16),
    Tick,
    Result,
    Other,
}

/// A known channel.
#[derive(Debug, Clone)]
pub(super) struct Channel {
    pub(super) definition: Definition,
    pub(super) kind: ChannelKind,
    /// Place among messages of the same time: raw by source, then the others by topic.
    pub(super) rank: u32,
}

/// All known channels.
#[derive(Debug, Default)]
pub(super) struct Channels {
    by_id: BTreeMap<u16, Channel>,
    sources: Vec<SourceInfo>,
    others: u32,
}

impl Channels {
    /// Numbers the sources: by their channels' metadata where it numbers all of them from 0 on, otherwise by name.
    pub(super) fn new(definitions: BTreeMap<u16, Definition>) -> Self {
        let mut definitions: Vec<Definition> = definitions.into_values().collect();
        let numbers: BTreeMap<&str, Option<u16>> =
            definitions.iter().filter_map(|d| source_id(&d.topic).map(|id| (id, stated_number(d)))).collect();
        let distinct: BTreeSet<u16> = numbers.values().filter_map(|number| *number).collect();
        let stated = distinct.iter().copied().map(usize::from).eq(0..numbers.len());
        definitions.sort_by_cached_key(|d| (stated.then(|| stated_number(d)), d.topic.clone(), d.id));
        let mut channels = Self::default();
        // Raw first: sources with only sent bytes come after those that sent something themselves.
        let (raw, others): (Vec<_>, Vec<_>) =
            definitions.into_iter().partition(|d| stated || d.topic.starts_with(RAW_PREFIX));
        for definition in raw.into_iter().chain(others) {
            channels.admit(definition);
        }
        channels
    }

    /// Adds a channel. A new source gets the next number. `false` if it contradicts a known channel.
    pub(super) fn admit(&mut self, definition: Definition) -> bool {
        if let Some(known) = self.by_id.get(&definition.id) {
            return known.definition == definition;
        }
        let kind = match definition.topic.as_str() {
            TICK_TOPIC => ChannelKind::Tick,
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
        true
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

    pub(super) fn has_ticks(&self) -> bool {
        self.by_id.values().any(|channel| channel.kind == ChannelKind::Tick)
    }

    pub(super) fn result_topics(&self) -> Vec<String> {
        let results = self.by_id.values().filter(|channel| channel.kind == ChannelKind::Result);
        results.map(|channel| channel.definition.topic.clone()).collect()
    }

    /// Topics with several channels, with the channel numbers.
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
        // A file has at most 65536 channels: their numbers are u16.
        u16::try_from(number).unwrap_or(u16::MAX)
    }
}

fn source_id(topic: &str) -> Option<&str> {
    topic.strip_prefix(RAW_PREFIX).or_else(|| topic.strip_prefix(SENT_PREFIX))
}

fn stated_number(definition: &Definition) -> Option<u16> {
    definition.metadata.get(SOURCE_KEY)?.parse().ok()
}

/// The channels listed in the metadata record that repeats them.
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
        Channels::new((0..).zip(topics).map(definition).collect())
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
    fn sources_are_numbered_by_metadata_that_numbers_all() {
        let stated =
            [("/raw/a", Some("1")), ("/raw/b", Some("0")), ("/sent/a", Some("1")), ("/loop/tick", None)];
        assert_eq!(ids(&channels(&stated)), ["b", "a"]);
        assert_eq!(ids(&channels(&[("/raw/a", Some("1")), ("/raw/b", Some("2"))])), ["a", "b"]);
        assert_eq!(ids(&channels(&[("/raw/a", Some("b")), ("/raw/b", Some("0"))])), ["a", "b"]);
    }

    #[test]
    fn a_second_definition_must_agree() {
        let mut channels = channels(&[("/raw/a", None)]);
        let same = channels.get(0).unwrap().definition.clone();
        assert!(channels.admit(same.clone()));
        assert!(!channels.admit(Definition { topic: "/raw/b".to_owned(), ..same }));
    }
}
