//! Sets of sonar heads of a vehicle.

use serde::{Deserialize, Serialize};

/// Maximum number of heads of a vehicle.
pub const MAX_HEADS: usize = 8;

/// A set of sonar heads, given by their numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct HeadSet(u8);

impl HeadSet {
    /// The set of the heads 0 to `count` - 1.
    pub fn first(count: usize) -> Self {
        (0..count).fold(Self::default(), Self::with)
    }

    /// This set plus one head; numbers from [`MAX_HEADS`] up are ignored.
    #[must_use]
    pub fn with(self, head: usize) -> Self {
        Self(self.0 | Self::bit(head))
    }

    /// This set without a head.
    #[must_use]
    pub fn without(self, head: usize) -> Self {
        Self(self.0 & !Self::bit(head))
    }

    /// The union of two sets: heads that are in either set.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// The intersection of two sets: heads that are in both sets.
    #[must_use]
    pub fn intersection(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// This set without the heads of another set.
    #[must_use]
    pub fn difference(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// The set as a number: bit k for head k.
    pub fn bits(self) -> u8 {
        self.0
    }

    /// The set encoded by these bits.
    pub fn from_bits(bits: u8) -> Self {
        Self(bits)
    }

    /// Whether the set contains a head.
    pub fn has(self, head: usize) -> bool {
        self.0 & Self::bit(head) != 0
    }

    /// Number of heads in the set.
    pub fn len(self) -> usize {
        self.0.count_ones() as usize
    }

    /// Whether the set is empty.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Head numbers in ascending order.
    pub fn iter(self) -> impl Iterator<Item = usize> {
        let mut left = self.0;
        core::iter::from_fn(move || {
            let head = (left > 0).then_some(left.trailing_zeros() as usize)?;
            left &= left - 1;
            Some(head)
        })
    }

    fn bit(head: usize) -> u8 {
        if head < MAX_HEADS { 1 << head } else { 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn head_set_counts_and_lists_its_heads() {
        let set = HeadSet::first(4).without(1).with(7).with(99);
        assert_eq!(set.iter().collect::<Vec<_>>(), [0, 2, 3, 7]);
        assert_eq!(HeadSet::from_bits(set.bits()), set);
        assert_eq!(set.without(7).union(HeadSet::default().with(1)), HeadSet::first(4));
        let (both, rest) = (set.intersection(HeadSet::first(3)), set.difference(HeadSet::first(3)));
        assert_eq!((both, rest), (HeadSet::first(3).without(1), HeadSet::from_bits(0b1000_1000)));
        assert_eq!((set.len(), set.is_empty(), HeadSet::default().is_empty()), (4, false, true));
    }
}
