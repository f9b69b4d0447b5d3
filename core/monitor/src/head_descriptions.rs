//! Head descriptions: names of the heads and their alternative settings, for the pilot's texts.

use bevy_ecs::prelude::Resource;
use headrace_sampling::advice::ModeName;
use headrace_sampling::head::HeadSet;

/// Names of the heads, and their alternative settings, for the texts to the pilot.
#[derive(Debug, Clone, Default, PartialEq, Resource)]
pub struct HeadDescriptions {
    /// Source ids of the heads, by number of the head.
    names: Vec<String>,
    /// Scan mode with a finer step for all heads, if there is one.
    finer: Option<ModeName>,
    /// Range setting at which all heads reach all wall from the tunnel's centre, m; `None` if the present setting
    /// reaches it.
    longer_m: Option<f64>,
}

/// A head's name and alternative settings.
#[derive(Debug, Clone, PartialEq)]
pub struct HeadSettings {
    /// Id of the head's source.
    pub name: String,
    /// Scan mode with a finer step, if there is one.
    pub finer: Option<ModeName>,
    /// Range setting that reaches all wall from the tunnel's centre, m; `None` if the head's own setting reaches it.
    pub longer_m: Option<f64>,
}

impl HeadDescriptions {
    /// Descriptions of all heads, in the order of their sources.
    pub fn of(heads: impl Iterator<Item = HeadSettings>) -> Self {
        let heads: Vec<HeadSettings> = heads.collect();
        let first = heads.first().and_then(|head| head.finer);
        let is_common = heads.iter().all(|head| head.finer == first);
        Self {
            finer: first.filter(|_| is_common),
            longer_m: heads.iter().filter_map(|head| head.longer_m).reduce(f64::max),
            names: heads.into_iter().map(|head| head.name).collect(),
        }
    }

    /// Names of heads that were silent, detected no wall or were distrusted, as text.
    pub(super) fn silent(&self, heads: HeadSet) -> String {
        let names: Vec<&str> =
            heads.iter().map(|head| self.names.get(head).map_or("a head", String::as_str)).collect();
        match names.as_slice() {
            [] => "no wall from the heads".to_owned(),
            all if all.len() > 1 && all.len() == self.names.len() => "no wall from any head".to_owned(),
            [only] => format!("no wall from {only}"),
            [others @ .., last] => format!("no wall from {} and {last}", others.join(", ")),
        }
    }

    /// Name of the finer scan mode, in a form that follows "in".
    pub(super) fn finer_mode(&self) -> String {
        self.finer.map_or_else(|| "a finer mode".to_owned(), |mode| mode.as_str().to_uppercase())
    }

    /// Instruction to set the finer scan mode.
    pub(super) fn set_finer(&self) -> String {
        let heads = if self.finer.is_some() { "set the heads to" } else { "set" };
        format!("{heads} {}", self.finer_mode())
    }

    /// Instruction to set the range at which the heads reach more wall, if one is known.
    pub(super) fn seeing_more(&self) -> Option<String> {
        self.longer_m.map(|_| format!("set {}", self.longer_range()))
    }

    /// Name of the longer range setting, in a form that follows a verb or "with".
    pub(super) fn longer_range(&self) -> String {
        self.longer_m.map_or_else(|| "a longer range".to_owned(), |range_m| format!("a range of {range_m} m"))
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Two heads whose finer mode is FAST. With a range setting of 20 m they reach all wall.
    pub(crate) fn two() -> HeadDescriptions {
        HeadDescriptions {
            names: vec!["bow".to_owned(), "stern".to_owned()],
            finer: Some(ModeName::new("fast")),
            longer_m: Some(20.0),
        }
    }

    #[test]
    fn heads_are_named_after_their_sources() {
        let text = |heads: &[usize]| {
            two().silent(heads.iter().fold(HeadSet::default(), |set, head| set.with(*head)))
        };
        assert_eq!(text(&[1]), "no wall from stern");
        assert_eq!(text(&[0, 1]), "no wall from any head");
        assert_eq!(text(&[0, 1, 3]), "no wall from bow, stern and a head");
        assert_eq!(text(&[]), "no wall from the heads");
    }

    /// A mode is named if all heads have it. A range is named if it is long enough for all heads.
    #[test]
    fn alternative_settings_are_named_only_if_they_suit_all_heads() {
        let head = |finer: &str, longer_m: f64| HeadSettings {
            name: String::new(),
            finer: Some(ModeName::new(finer)),
            longer_m: Some(longer_m).filter(|range_m| *range_m > 0.0),
        };
        let same =
            HeadDescriptions::of([head("fast", 0.0), head("fast", 20.0), head("fast", 10.0)].into_iter());
        assert_eq!((same.set_finer(), same.finer_mode()), ("set the heads to FAST".into(), "FAST".into()));
        assert_eq!(same.seeing_more().as_deref(), Some("set a range of 20 m"));
        let other = HeadDescriptions::of([head("fast", 0.0), head("slow", 0.0)].into_iter());
        assert_eq!(
            (other.set_finer(), other.finer_mode()),
            ("set a finer mode".into(), "a finer mode".into())
        );
        assert_eq!((other.seeing_more(), other.longer_range()), (None, "a longer range".into()));
    }
}
