//! Counts the returns that a head loses by chance while it turns.

use bevy_ecs::prelude::Component;
use serde::{Deserialize, Serialize};

use super::head_health::{HeadHealth, Heard};
use headrace_geometry::math::{self, TAU};
use headrace_sampling::losses::LossRate;

/// Number of angle bins per turn. A bin is finer than the step of any head.
const BINS: usize = 2048;
const WORDS: usize = BINS / 64;
/// Number of pings at which the counts are halved, so that old pings lose weight.
const WINDOW: u32 = 4096;
/// Minimum divisor, in pings, of a loss share, so that a single loss among few pings doesn't count too much.
const LEAST: u32 = 100;
/// Weight of the overall loss share, in pings, in the estimate of the loss share after a lost ping. This weight matters
/// while few pings are lost.
const USUAL: f64 = 50.0;
/// Share of lost pings above which a head hardly detects the wall. Hardly any angle then gives a return in two
/// successive turns.
const NEARLY_ALL: f64 = 0.75;

/// Number of pings, and number of these pings that gave no return.
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

/// Set of angle bins of a turn: one bit per bin.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
struct Angles([u64; WORDS]);

impl Angles {
    fn has(&self, bin: usize) -> bool {
        self.0.get(bin / 64).is_some_and(|word| word >> (bin % 64) & 1 == 1)
    }

    fn set(&mut self, bin: usize, to: bool) {
        if let Some(word) = self.0.get_mut(bin / 64) {
            let bit = 1 << (bin % 64);
            *word = if to { *word | bit } else { *word & !bit };
        }
    }
}

/// Sonar returns that one head loses by chance; part of the loop's state.
///
/// A ping is counted if the head detected the wall at the same angle a turn before and a turn after. A side tunnel, or
/// wall at a grazing angle, gives no return in turn after turn. Such missing returns aren't losses by chance, so they
/// are not counted.
#[derive(Debug, Clone, Copy, PartialEq, Default, Component, Serialize, Deserialize)]
pub struct LossCount {
    /// Whether the wall was detected at each angle in the latest turn, and in the turn before that.
    heard: Angles,
    heard_before: Angles,
    /// For each angle: whether the ping just before the latest ping at that angle was lost.
    followed_lost: Angles,
    /// Three counts: all pings at wall within range; the pings that count for losses by chance; and, among the second
    /// count, the pings that followed a lost ping.
    any: Count,
    by_chance: Count,
    after_lost: Count,
    /// Whether the latest ping was lost.
    was_lost: bool,
    /// Health of the head.
    health: HeadHealth,
}

impl LossCount {
    /// Counts a ping at wall within range, in the bin of its angle.
    ///
    /// Allocates: never.
    pub fn ping(&mut self, angle_rad: f64, is_lost: bool) {
        let bin = math::floor_to_i64(math::wrap(angle_rad, TAU) / TAU * BINS as f64);
        let bin = usize::try_from(bin).unwrap_or(0) % BINS;
        self.any.add(is_lost);
        if !is_lost && self.heard_before.has(bin) {
            // The ping a turn ago is counted, because the head detected the wall at this angle a turn before that ping
            // and a turn after it.
            let was_lost = !self.heard.has(bin);
            self.by_chance.add(was_lost);
            if self.followed_lost.has(bin) {
                self.after_lost.add(was_lost);
            }
        }
        self.heard_before.set(bin, self.heard.has(bin));
        self.heard.set(bin, !is_lost);
        self.followed_lost.set(bin, self.was_lost);
        self.was_lost = is_lost;
    }

    /// Updates the head's health with a ping, and its return if any.
    ///
    /// Allocates: never.
    pub fn hear(&mut self, angle_rad: f64, heard: Option<Heard>) {
        let was_deaf = self.health.hears_nothing();
        self.health.add(angle_rad, heard);
        if was_deaf && heard.is_some() {
            // While the head detected nothing, all its returns were missing. These losses don't predict the losses from
            // now on.
            *self = Self { health: self.health, ..Self::default() };
        }
    }

    /// Health of the head.
    pub fn health(&self) -> &HeadHealth {
        &self.health
    }

    /// Upper bound of the rate at which returns are lost by chance. Until enough pings are counted, all lost pings
    /// count.
    pub fn at_most(&self) -> LossRate {
        if self.by_chance.all >= LEAST {
            self.rate()
        } else {
            LossRate { share: self.any.share(), after_lost: 1.0 }
        }
    }

    /// Rate at which returns are lost by chance. If a head hardly detects the wall, all lost pings count.
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

    /// Loss rate of a head that turns for this many pings and loses those for which `is_lost` holds.
    fn turned(pings: u32, is_lost: impl Fn(u32) -> bool) -> LossRate {
        let mut count = LossCount::default();
        for ping in 0..pings {
            count.ping(f64::from(ping) * STEP_RAD, is_lost(ping));
        }
        count.rate()
    }

    #[test]
    fn loss_count_restarts_at_the_first_return_after_a_turn_without_returns() {
        let wall = Heard { range_m: 5.0, off_m: 0.0, is_wall: true };
        let mut count = LossCount::default();
        for ping in 0..4000 {
            count.ping(f64::from(ping) * STEP_RAD, ping >= 500);
            count.hear(f64::from(ping) * STEP_RAD, (ping < 500).then_some(wall));
        }
        assert!(count.health().hears_nothing() && count.rate().share > 0.0);
        count.hear(4000.0 * STEP_RAD, Some(wall));
        assert!(!count.health().hears_nothing() && count.rate() == LossRate::default());
    }

    /// Whether a ping is lost at random, with a probability of `in_hundred` per cent.
    ///
    /// The hash Splitmix64 makes the losses uncorrelated with turns of 400 pings.
    fn chance(ping: u32, in_hundred: u64) -> bool {
        let mut z = u64::from(ping).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) % 100 < in_hundred
    }

    #[test]
    fn share_of_random_losses_is_measured_overall_and_after_a_lost_ping() {
        for in_hundred in [2_u32, 10, 40, 70] {
            let LossRate { share, after_lost } = turned(24_000, |ping| chance(ping, in_hundred.into()));
            let expected = f64::from(in_hundred) / 100.0;
            assert!((share - expected).abs() < 0.03, "{in_hundred}: {share}");
            assert!((after_lost - expected).abs() < 0.08, "{in_hundred}: {after_lost}");
        }
        // Losses come in pairs: the ping after the first loss of a pair is lost, too. After the second loss,
        // the usual loss rate applies again.
        let pairs = turned(24_000, |ping| chance(ping / 2, 10));
        assert!((pairs.share - 0.1).abs() < 0.03 && (pairs.after_lost - 0.55).abs() < 0.1, "{pairs:?}");
    }

    #[test]
    fn upper_bound_counts_all_losses_until_enough_pings_arrived() {
        let mut count = LossCount::default();
        let mut at_most = |pings: std::ops::Range<u32>| {
            for ping in pings {
                count.ping(f64::from(ping) * STEP_RAD, ping % 400 < 120);
            }
            count.at_most()
        };
        // In each turn, 280 of the 400 pings detect the wall. An angle's pings count from its third detection on.
        let early = at_most(0..1000);
        assert!(early.share > 0.3 && early.after_lost >= 1.0, "{early:?}");
        assert_eq!(at_most(1000..1100), LossRate::default());
    }

    #[test]
    fn losses_at_one_angle_in_successive_turns_are_not_random() {
        let grazing = turned(8000, |ping| ping % 400 < 120);
        assert!(grazing.share <= 0.0, "{grazing:?}");
        let both = turned(8000, |ping| ping % 400 < 120 || chance(ping, 5));
        assert!((both.share - 0.05).abs() < 0.02, "{both:?}");
        // Pings at side tunnels give no return. Each side tunnel is in view for three turns.
        let tunnels = turned(24_000, |ping| ping / 400 % 6 > 2 && ping % 400 < 60);
        assert!(tunnels.share <= 0.0, "{tunnels:?}");
    }

    #[test]
    fn loss_rate_of_a_head_without_returns_exceeds_90_percent() {
        let deaf = turned(24_000, |ping| ping >= 4000);
        assert!(deaf.share > 0.9 && deaf.after_lost > 0.9, "{deaf:?}");
        // The few losses in the second turn hardly change the rate.
        assert!(turned(410, |ping| ping >= 405).share < 0.03);
        assert_eq!(turned(300, |_| false), LossRate::default());
    }
}
