//! Returns that a head loses by chance, counted while it turns.

use bevy_ecs::prelude::Component;
use serde::{Deserialize, Serialize};

use headrace_geometry::math::{self, TAU};
use headrace_sampling::losses::LossRate;

/// Angles told apart: finer than the steps of heads, but for the finest.
const BINS: usize = 1024;
const WORDS: usize = BINS / 64;
/// Pings over which shares are counted: once there are so many, they count half.
const WINDOW: u32 = 4096;
/// Fewer pings count as so many: one lost at the beginning isn't a share.
const LEAST: u32 = 256;
/// Pings as which the share of all is taken for those after a lost one, as long as these are few.
const USUAL: f64 = 50.0;
/// Share of a head's pings from which on it is deaf: what it loses then is lost whatever was heard before.
const NEARLY_ALL: f64 = 0.9;

/// Pings, and how many of them were lost.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
struct Count {
    all: u32,
    lost: u32,
}

impl Count {
    fn add(&mut self, is_lost: bool) {
        self.all += 1;
        self.lost += u32::from(is_lost);
        if self.all >= WINDOW {
            *self = Self { all: self.all / 2, lost: self.lost / 2 };
        }
    }

    fn share(self) -> f64 {
        f64::from(self.lost) / f64::from(self.all.max(LEAST))
    }
}

/// Losses of one head; part of the loop's state.
///
/// Counted are pings at angles at which the head heard the wall when it last pinged there: where a wall sends nothing back turn
/// after turn, nothing is lost by chance.
#[derive(Debug, Clone, Copy, PartialEq, Default, Component, Serialize, Deserialize)]
pub struct LossCount {
    /// By angle, a bit each: the wall was heard there last.
    heard: [u64; WORDS],
    /// Of all pings at wall within range, and those by chance: all, and after a lost one.
    any: Count,
    by_chance: Count,
    after_lost: Count,
    /// The ping before was lost.
    was_lost: bool,
}

impl LossCount {
    /// Counts a ping at wall within range.
    ///
    /// Allocates: never.
    pub fn ping(&mut self, angle_rad: f64, is_lost: bool) {
        let bin = math::floor_to_i64(math::wrap(angle_rad, TAU) / TAU * BINS as f64);
        let bin = usize::try_from(bin).unwrap_or(0) % BINS;
        let Some(word) = self.heard.get_mut(bin / 64) else { return };
        let bit = 1_u64 << (bin % 64);
        let was_heard = *word & bit != 0;
        *word = if is_lost { *word & !bit } else { *word | bit };
        self.any.add(is_lost);
        if was_heard {
            self.by_chance.add(is_lost);
            if self.was_lost {
                self.after_lost.add(is_lost);
            }
        }
        self.was_lost = is_lost;
    }

    /// Shares lost by chance; of a head that hears hardly anything, all.
    pub fn rate(&self) -> LossRate {
        let deaf = ((self.any.share() - NEARLY_ALL) / (1.0 - NEARLY_ALL)).max(0.0);
        let share = self.by_chance.share();
        let Count { all, lost } = self.after_lost;
        let after_lost = (f64::from(lost) + USUAL * share) / (f64::from(all) + USUAL);
        LossRate { share: share.max(deaf), after_lost: after_lost.max(deaf) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_RAD: f64 = 0.9 * TAU / 360.0;

    /// A head that turns for so many pings and loses those for which it is said.
    fn turned(pings: u32, is_lost: impl Fn(u32) -> bool) -> LossRate {
        let mut count = LossCount::default();
        for ping in 0..pings {
            count.ping(f64::from(ping) * STEP_RAD, is_lost(ping));
        }
        count.rate()
    }

    /// Whether a ping is one of so many in a hundred that are lost: splitmix64, without an order in turns of 400 pings.
    fn chance(ping: u32, in_hundred: u64) -> bool {
        let mut z = u64::from(ping).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) % 100 < in_hundred
    }

    #[test]
    fn losses_by_chance_are_counted_as_they_are() {
        for in_hundred in [2_u32, 10, 40, 70] {
            let LossRate { share, after_lost } = turned(8000, |ping| chance(ping, in_hundred.into()));
            let expected = f64::from(in_hundred) / 100.0;
            assert!((share - expected).abs() < 0.03, "{in_hundred}: {share}");
            assert!((after_lost - expected).abs() < 0.08, "{in_hundred}: {after_lost}");
        }
        // In pairs: after the first of two the second is lost, after the second it is as it was.
        let pairs = turned(8000, |ping| chance(ping / 2, 10));
        assert!((pairs.share - 0.1).abs() < 0.03 && (pairs.after_lost - 0.55).abs() < 0.1, "{pairs:?}");
    }

    #[test]
    fn wall_that_is_never_heard_is_not_lost_by_chance() {
        let grazing = turned(8000, |ping| ping % 400 < 120);
        assert!(grazing.share <= 0.0, "{grazing:?}");
        let both = turned(8000, |ping| ping % 400 < 120 || chance(ping, 5));
        assert!((both.share - 0.05).abs() < 0.02, "{both:?}");
    }

    #[test]
    fn a_head_that_becomes_deaf_has_lost_all_within_some_turns() {
        let deaf = turned(24_000, |ping| ping >= 4000);
        assert!(deaf.share > 0.9 && deaf.after_lost > 0.9, "{deaf:?}");
        // A few lost at the beginning say little.
        assert!(turned(410, |ping| ping >= 405).share < 0.03);
        assert_eq!(turned(300, |_| false), LossRate::default());
    }
}
