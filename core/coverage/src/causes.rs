//! Sets of causes.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::cause::Cause;

/// Set of causes in the order of [`Cause::ALL`]: causes that the pilot can change come first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Causes(u16);

impl Causes {
    /// Set of one cause.
    pub fn of(cause: Cause) -> Self {
        Self(1 << cause as u16)
    }

    /// This set with a cause added.
    #[must_use]
    pub fn with(self, cause: Cause) -> Self {
        self.union(Self::of(cause))
    }

    /// This set with a cause removed.
    #[must_use]
    pub fn without(self, cause: Cause) -> Self {
        self.less(Self::of(cause))
    }

    /// This set with another set's causes removed.
    #[must_use]
    pub fn less(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// The causes in either set.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Whether the set contains a cause.
    pub fn has(self, cause: Cause) -> bool {
        Self::of(cause).is_within(self)
    }

    /// Whether this set is a subset of another.
    pub fn is_within(self, other: Self) -> bool {
        self.0 & !other.0 == 0
    }

    /// Number of causes.
    pub fn len(self) -> u32 {
        self.0.count_ones()
    }

    /// Whether the set is empty.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The causes, the main one first.
    pub fn iter(self) -> impl Iterator<Item = Cause> {
        Cause::ALL.into_iter().filter(move |cause| self.has(*cause))
    }

    /// The set as a number: bit k is set for the cause numbered k.
    pub fn bits(self) -> u16 {
        self.0
    }

    /// Set of the causes whose bits are set. Unknown bits are ignored.
    pub fn from_bits(bits: u16) -> Self {
        Cause::ALL.into_iter().filter(|cause| bits & (1 << *cause as u16) != 0).collect()
    }
}

impl FromIterator<Cause> for Causes {
    fn from_iter<I: IntoIterator<Item = Cause>>(causes: I) -> Self {
        causes.into_iter().fold(Self::default(), Self::with)
    }
}

/// Serialises as a list of words in text formats such as JSON, and as bits in snapshots.
impl Serialize for Causes {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if serializer.is_human_readable() {
            serializer.collect_seq(self.iter())
        } else {
            self.0.serialize(serializer)
        }
    }
}

impl<'de> Deserialize<'de> for Causes {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        if deserializer.is_human_readable() {
            Ok(Vec::<Cause>::deserialize(deserializer)?.into_iter().collect())
        } else {
            Ok(Self::from_bits(u16::deserialize(deserializer)?))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cause_set_serialises_as_words_with_the_main_cause_first() {
        let set = Causes::of(Cause::Occluded).with(Cause::TooFast);
        assert_eq!(serde_json::to_value(set).unwrap(), serde_json::json!(["too_fast", "occluded"]));
        assert_eq!((set.len(), Causes::from_bits(set.bits())), (2, set));
        assert!(Causes::of(Cause::TooFast).is_within(set) && !set.is_within(Causes::of(Cause::TooFast)));
    }
}
