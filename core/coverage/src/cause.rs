//! Causes of a failed section, and sets of them.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::passage::Loss;

/// Cause assigned to a fail. Source: docs/why/coverage.md, "Causes".
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// The distance between passes was too large at the speed driven.
    TooFast,
    /// The angular step alone leaves holes that are too large. Lower speed does not help.
    AngularStep,
    /// The wall was farther than the heads' range setting.
    OutOfRange,
    /// The vehicle was off-centre, or its turning swung the beams along the tunnel.
    OffAxis,
    /// The heads' passes were unevenly spread in time. With all heads at their scheduled angles, the section passes.
    Phase,
    /// The hole extends beyond the stretch that all live heads have swept.
    NotPassed,
    /// A head passed through the section without pinging, or without an accepted return.
    HeadSilent,
    /// A head was stalled, or has been out of phase since a stall.
    HeadStalled,
    /// Returns came without a valid position.
    PositionLost,
    /// No returns came although the wall was within range.
    MissingReturns,
    /// The vehicle occluded the beams.
    Occluded,
    /// No cause explains the hole.
    Unknown,
}

impl Cause {
    /// All causes. Those that the pilot can change come first.
    ///
    /// If two causes explain a hole equally well, the first one in this order is named.
    pub const ALL: [Self; 12] = [
        Self::TooFast,
        Self::AngularStep,
        Self::OutOfRange,
        Self::OffAxis,
        Self::Phase,
        Self::NotPassed,
        Self::HeadSilent,
        Self::HeadStalled,
        Self::PositionLost,
        Self::MissingReturns,
        Self::Occluded,
        Self::Unknown,
    ];

    /// Word used for the cause in reports and logs.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::TooFast => "too_fast",
            Self::AngularStep => "angular_step",
            Self::MissingReturns => "missing_returns",
            Self::OutOfRange => "out_of_range",
            Self::Occluded => "occluded",
            Self::OffAxis => "off_axis",
            Self::Phase => "phase",
            Self::HeadStalled => "head_stalled",
            Self::HeadSilent => "head_silent",
            Self::PositionLost => "position_lost",
            Self::NotPassed => "not_passed",
            Self::Unknown => "unknown",
        }
    }

    /// Cause that corresponds to the reason for a missing sample.
    pub fn of_loss(loss: Loss) -> Self {
        match loss {
            Loss::Missing => Self::MissingReturns,
            Loss::OutOfRange => Self::OutOfRange,
            Loss::Occluded => Self::Occluded,
        }
    }
}

/// Set of causes in the order of [`Cause::ALL`]: causes that the pilot can change come first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Causes(u16);

impl Causes {
    /// Set that contains one cause.
    pub fn of(cause: Cause) -> Self {
        Self(1 << cause as u16)
    }

    /// Returns this set with a cause added.
    #[must_use]
    pub fn with(self, cause: Cause) -> Self {
        self.union(Self::of(cause))
    }

    /// Returns this set with a cause removed.
    #[must_use]
    pub fn without(self, cause: Cause) -> Self {
        self.less(Self::of(cause))
    }

    /// Returns this set with the causes of another set removed.
    #[must_use]
    pub fn less(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// Returns this set with the causes of another set added.
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

    /// Number of causes in the set.
    pub fn len(self) -> u32 {
        self.0.count_ones()
    }

    /// Whether the set contains no cause.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The causes in the set, the main cause first.
    pub fn iter(self) -> impl Iterator<Item = Cause> {
        Cause::ALL.into_iter().filter(move |cause| self.has(*cause))
    }

    /// The set as a number: bit k is 1 if the set contains the cause with number k.
    pub fn bits(self) -> u16 {
        self.0
    }

    /// Set of the causes whose bits are 1. Unknown bits are ignored.
    pub fn from_bits(bits: u16) -> Self {
        Cause::ALL.into_iter().filter(|cause| bits & (1 << *cause as u16) != 0).collect()
    }
}

impl FromIterator<Cause> for Causes {
    fn from_iter<I: IntoIterator<Item = Cause>>(causes: I) -> Self {
        causes.into_iter().fold(Self::default(), Self::with)
    }
}

/// Serialises the set as a list of words in text formats such as JSON, and as bits in snapshots.
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
