//! Returns that a head loses by chance, counted while it turns.

use bevy_ecs::prelude::Component;
use serde::{Deserialize, Serialize};

use headrace_geometry::math::{self, TAU};
use headrace_sampling::losses::LossRate;

/// Angles told apart: finer than the steps of heads.
const BINS: usize = 2048;
const WORDS: usize = BINS / 64;
/// Pings over which shares are counted: once there are so many, they count half.
const WINDOW: u32 = 4096;
/// Fewer pings count as so many: one lost at the beginning isn't a share.
const LEAST: u32 = 100;
/// Pings as which the share of all is taken for those after a lost one, as long as these are few.
const USUAL: f64 = 50.0;
/// Share of a head's pings from which on it is nearly deaf: hardly an angle is heard in one turn and the next but one.
const NEARLY_ALL: f64 = 0.75;
/// Angle turned through without a return from which a head is deaf, radians: a whole turn. Walls that swallow what meets them flatly, and
/// side tunnels, are less than that.
const DEAF_RAD: f64 = TAU;
/// Angle over which the share of returns that aren't of the wall counts, radians.
const ELSEWHERE_RAD: f64 = TAU / 2.0;
/// Angle turned through with one range from which a head is stuck at it, radians, and how far the design has to differ meanwhile, m.
const STUCK_RAD: f64 = TAU / 2.0;
const STUCK_M: f64 = 0.3;
/// Share of a head's returns off the design from which it hears no wall, where another one's share is below the second.
const ELSEWHERE: [f64; 2] = [0.85, 0.5];

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

/// A bit for each angle.
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

/// Losses of one head; part of the loop's state.
///
/// Counted are pings at angles at which the head heard the wall a turn before and a turn after: what is silent turn after turn, such as a
/// side tunnel or wall that is met too flatly, isn't lost by chance, neither where it begins nor where it ends.
#[derive(Debug, Clone, Copy, PartialEq, Default, Component, Serialize, Deserialize)]
pub struct LossCount {
    /// By angle: whether the wall was heard there a turn ago, and the turn before.
    heard: Angles,
    heard_before: Angles,
    /// The ping before the one a turn ago was lost.
    followed_lost: Angles,
    /// Of all pings at wall within range, and of those counted: all, and after a lost one.
    any: Count,
    by_chance: Count,
    after_lost: Count,
    /// The last ping was lost.
    was_lost: bool,
    /// Angle of the last ping, radians.
    last_rad: f64,
    /// Angle turned through since the last return, radians.
    unheard_rad: f64,
    /// Share of its latest returns that aren't where the design has its wall.
    elsewhere: f64,
    /// Angle over which returns have been heard, radians, up to a turn.
    heard_rad: f64,
    /// Returns of one range.
    same: SameRange,
}

/// Returns in a row of one range, to the last bit.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
struct SameRange {
    range_m: f64,
    /// Angle turned through meanwhile, radians.
    turned_rad: f64,
    /// Least and largest deviation from the design meanwhile, m.
    off_m: [f64; 2],
}

impl SameRange {
    fn add(&mut self, heard: Heard, turned_rad: f64) {
        let Heard { range_m, off_m, .. } = heard;
        let is_same = self.range_m.to_bits() == range_m.to_bits();
        let [least_m, most_m] = self.off_m;
        *self = if is_same {
            let turned_rad = self.turned_rad + turned_rad;
            Self { range_m, turned_rad, off_m: [least_m.min(off_m), most_m.max(off_m)] }
        } else {
            Self { range_m, turned_rad: 0.0, off_m: [off_m; 2] }
        };
    }

    /// Half a turn of one range, where the wall isn't one distance away.
    fn is_stuck(&self) -> bool {
        self.turned_rad >= STUCK_RAD && self.off_m[1] - self.off_m[0] > STUCK_M
    }
}

/// A return of a head.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Heard {
    /// As the head says, m.
    pub range_m: f64,
    /// Deviation of its place from the design, m.
    pub off_m: f64,
    /// It is where the design has its wall.
    pub is_wall: bool,
}

impl LossCount {
    /// Counts a ping at wall within range.
    ///
    /// Allocates: never.
    pub fn ping(&mut self, angle_rad: f64, is_lost: bool) {
        let bin = math::floor_to_i64(math::wrap(angle_rad, TAU) / TAU * BINS as f64);
        let bin = usize::try_from(bin).unwrap_or(0) % BINS;
        self.any.add(is_lost);
        if !is_lost && self.heard_before.has(bin) {
            // The ping between is the one that is told of.
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

    /// Counts how far the head has turned with nothing heard, and what a return says, if there was one.
    ///
    /// Allocates: never.
    pub fn hear(&mut self, angle_rad: f64, heard: Option<Heard>) {
        let turned_rad = math::wrap_signed(angle_rad - self.last_rad, TAU).abs();
        self.last_rad = angle_rad;
        let Some(heard) = heard else {
            self.unheard_rad += turned_rad;
            return;
        };
        if self.unheard_rad >= DEAF_RAD {
            // What it lost while it heard nothing says nothing of how it loses now.
            *self = Self { last_rad: angle_rad, ..Self::default() };
        }
        self.unheard_rad = 0.0;
        self.heard_rad = (self.heard_rad + turned_rad).min(TAU);
        let weight = (turned_rad / ELSEWHERE_RAD).min(1.0);
        self.elsewhere += weight * (f64::from(u8::from(!heard.is_wall)) - self.elsewhere);
        self.same.add(heard, turned_rad);
    }

    /// Whether a head that turns hears no wall at all: a whole turn gave nothing, half a turn one range that the wall doesn't have, or nearly all
    /// that it hears is elsewhere while one of the others hears the wall. Where all hear something else, that is a matter of the position or
    /// of the design.
    pub fn is_deaf(&self, others: impl Iterator<Item = f64>) -> bool {
        let [most, least] = ELSEWHERE;
        let mut others = others;
        let hears_nothing = self.unheard_rad >= DEAF_RAD || self.same.is_stuck();
        hears_nothing || self.elsewhere > most && others.any(|elsewhere| elsewhere < least)
    }

    /// Share of its latest returns that aren't where the design has its wall, from 0 to 1; 1 before it has heard a whole turn, and where nothing was
    /// heard for one.
    pub fn elsewhere(&self) -> f64 {
        let is_known = self.heard_rad >= TAU && self.unheard_rad < DEAF_RAD;
        if is_known { self.elsewhere } else { 1.0 }
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

    /// A head that turns for so many pings and hears the wall, something else, or nothing.
    fn hearing(pings: u32, is_wall: impl Fn(u32) -> Option<bool>) -> LossCount {
        let mut count = LossCount::default();
        for ping in 0..pings {
            let heard =
                is_wall(ping).map(|is_wall| Heard { range_m: 5.0 + f64::from(ping), off_m: 0.0, is_wall });
            count.hear(f64::from(ping) * STEP_RAD, heard);
        }
        count
    }

    #[test]
    fn a_head_is_deaf_once_it_has_turned_round_and_heard_nothing() {
        let from_500 = |pings| hearing(pings, |ping| (ping < 500).then_some(true));
        assert!(!from_500(890).is_deaf(std::iter::empty()));
        assert!(from_500(901).is_deaf(std::iter::empty()));
        // A single return ends it, and what was lost meanwhile is forgotten.
        let wall = Heard { range_m: 5.0, off_m: 0.0, is_wall: true };
        let mut count = LossCount::default();
        for ping in 0..4000 {
            count.ping(f64::from(ping) * STEP_RAD, ping >= 500);
            count.hear(f64::from(ping) * STEP_RAD, (ping < 500).then_some(wall));
        }
        assert!(count.is_deaf(std::iter::empty()) && count.rate().share > 0.0);
        count.hear(4000.0 * STEP_RAD, Some(wall));
        assert!(!count.is_deaf(std::iter::empty()) && count.rate() == LossRate::default());
        // Three quarters of each turn that nothing comes back from are a side tunnel, or a wall that swallows.
        let side = hearing(4000, |ping| (ping % 400 < 100).then_some(true));
        assert!(!side.is_deaf(std::iter::empty()));
    }

    #[test]
    fn a_head_that_hears_something_else_is_deaf_where_another_one_hears_the_wall() {
        let elsewhere = hearing(1200, |ping| Some(ping < 400));
        let [hears, does_not] = [hearing(1200, |_| Some(true)), hearing(1200, |_| Some(false))];
        assert!(elsewhere.is_deaf([does_not.elsewhere(), hears.elsewhere()].into_iter()));
        assert!(
            !elsewhere.is_deaf([does_not.elsewhere()].into_iter()),
            "the position or the design is wrong"
        );
        assert!(!elsewhere.is_deaf(std::iter::empty()), "a single head");
        assert!(!hears.is_deaf([hears.elsewhere()].into_iter()));
        let begins = hearing(100, |_| Some(true));
        assert!(!elsewhere.is_deaf([begins.elsewhere()].into_iter()), "nothing is known of the other yet");
        // A rock and a niche of a third of the turn.
        let rock = hearing(4000, |ping| Some(ping % 400 >= 130));
        assert!(!rock.is_deaf([hears.elsewhere()].into_iter()));
    }

    #[test]
    fn a_head_is_stuck_at_one_range_where_the_wall_is_not_one_distance_away() {
        let stuck = |pings: u32, spread_m: f64| {
            let mut count = LossCount::default();
            for ping in 0..pings {
                let angle_rad = f64::from(ping) * STEP_RAD;
                let off_m = spread_m / 2.0 * math::cos(angle_rad);
                count.hear(angle_rad, Some(Heard { range_m: 5.0, off_m, is_wall: true }));
            }
            count.is_deaf(std::iter::empty())
        };
        assert!(stuck(202, 0.4) && !stuck(199, 0.4));
        // In the middle of a round pipe, and nearly there.
        assert!(!stuck(4000, 0.0) && !stuck(4000, 0.2));
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
            let LossRate { share, after_lost } = turned(24_000, |ping| chance(ping, in_hundred.into()));
            let expected = f64::from(in_hundred) / 100.0;
            assert!((share - expected).abs() < 0.03, "{in_hundred}: {share}");
            assert!((after_lost - expected).abs() < 0.08, "{in_hundred}: {after_lost}");
        }
        // In pairs: after the first of two the second is lost, after the second it is as it was.
        let pairs = turned(24_000, |ping| chance(ping / 2, 10));
        assert!((pairs.share - 0.1).abs() < 0.03 && (pairs.after_lost - 0.55).abs() < 0.1, "{pairs:?}");
    }

    #[test]
    fn wall_that_is_never_heard_is_not_lost_by_chance() {
        let grazing = turned(8000, |ping| ping % 400 < 120);
        assert!(grazing.share <= 0.0, "{grazing:?}");
        let both = turned(8000, |ping| ping % 400 < 120 || chance(ping, 5));
        assert!((both.share - 0.05).abs() < 0.02, "{both:?}");
        // Side tunnels, passed by for three turns each.
        let tunnels = turned(24_000, |ping| ping / 400 % 6 > 2 && ping % 400 < 60);
        assert!(tunnels.share <= 0.0, "{tunnels:?}");
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
