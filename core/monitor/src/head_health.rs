//! Head health: whether a turning head detects the wall at all, as judged from its returns.

use serde::{Deserialize, Serialize};

use headrace_geometry::math::{self, TAU};

/// A head counts as detecting no wall after it has turned by this angle without a return, radians: a whole turn.
///
/// Absorbing walls and side tunnels suppress returns over less than a turn.
const DEAF_RAD: f64 = TAU;
/// Averaging angle for the share of returns that are away from the design wall, radians.
const ELSEWHERE_RAD: f64 = TAU / 2.0;
/// A head is stuck if its range stays constant over this angle, radians, although the deviation from the
/// design varies by more than `STUCK_M`, m.
const STUCK_RAD: f64 = TAU / 2.0;
const STUCK_M: f64 = 0.3;
/// Two limits for the share of returns that are away from the design wall. A head detects no wall if its share
/// is above the first limit while another head's share is below the second limit.
const ELSEWHERE: [f64; 2] = [0.85, 0.5];

/// Health of a head; part of the loop's state.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct HeadHealth {
    /// Angle of the latest ping, radians.
    last_rad: f64,
    /// Angle turned since the latest return, radians.
    unheard_rad: f64,
    /// Angle turned while returns came, radians; at most a turn.
    heard_rad: f64,
    /// Share of the latest returns that are away from the design wall.
    elsewhere: f64,
    /// Latest successive returns with the same range.
    same: SameRange,
}

/// Successive returns with ranges identical to the last bit.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
struct SameRange {
    range_m: f64,
    /// Angle that the head turned during the returns with the same range, radians.
    turned_rad: f64,
    /// Smallest and largest deviation from the design wall during the returns with the same range, m.
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

    /// Whether the reported range is constant over half a turn although the wall's distance varies.
    fn is_stuck(&self) -> bool {
        self.turned_rad >= STUCK_RAD && self.off_m[1] - self.off_m[0] > STUCK_M
    }
}

/// A return of a head, compared with the design profile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Heard {
    /// Range that the head reports, m.
    pub range_m: f64,
    /// Deviation of the return's place from the design wall, m.
    pub off_m: f64,
    /// Whether the return agrees with the design.
    pub is_wall: bool,
}

impl HeadHealth {
    /// Adds a ping at an angle, with its return if any.
    ///
    /// Allocates: never.
    pub fn add(&mut self, angle_rad: f64, heard: Option<Heard>) {
        let turned_rad = math::wrap_signed(angle_rad - self.last_rad, TAU).abs();
        self.last_rad = angle_rad;
        let Some(heard) = heard else {
            self.unheard_rad += turned_rad;
            return;
        };
        if self.hears_nothing() {
            // The head gets returns again after a whole turn without any, so all averages start anew.
            *self = Self { last_rad: angle_rad, ..Self::default() };
        }
        self.unheard_rad = 0.0;
        self.heard_rad = (self.heard_rad + turned_rad).min(TAU);
        let weight = (turned_rad / ELSEWHERE_RAD).min(1.0);
        self.elsewhere += weight * (f64::from(u8::from(!heard.is_wall)) - self.elsewhere);
        self.same.add(heard, turned_rad);
    }

    /// Whether a whole turn gave no return.
    pub fn hears_nothing(&self) -> bool {
        self.unheard_rad >= DEAF_RAD
    }

    /// Whether the head is deaf, which means that it detects no wall.
    ///
    /// A head is deaf in three cases. A whole turn gave no return. All returns of half a turn have the same range
    /// although the wall's distance varies. Nearly all returns are off the design while another head detects the wall;
    /// `others` has the [`HeadHealth::elsewhere`] of the other heads. If the returns of all heads are off the design,
    /// the position or the design is wrong, and no head counts as deaf.
    pub fn is_deaf(&self, mut others: impl Iterator<Item = f64>) -> bool {
        let [most, least] = ELSEWHERE;
        self.hears_nothing()
            || self.same.is_stuck()
            || self.elsewhere > most && others.any(|elsewhere| elsewhere < least)
    }

    /// Share of the head's latest returns that are away from the design wall, from 0 to 1.
    ///
    /// The share is 1 until a whole turn gave returns, and again after a whole turn without any return.
    pub fn elsewhere(&self) -> f64 {
        let is_known = self.heard_rad >= TAU && !self.hears_nothing();
        if is_known { self.elsewhere } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_RAD: f64 = 0.9 * TAU / 360.0;

    /// Health of a head after this many pings. Each ping detects the wall, something other than the wall, or nothing.
    fn health(pings: u32, is_wall: impl Fn(u32) -> Option<bool>) -> HeadHealth {
        let mut health = HeadHealth::default();
        for ping in 0..pings {
            let heard =
                is_wall(ping).map(|is_wall| Heard { range_m: 5.0 + f64::from(ping), off_m: 0.0, is_wall });
            health.add(f64::from(ping) * STEP_RAD, heard);
        }
        health
    }

    #[test]
    fn head_detects_no_wall_after_a_turn_without_returns() {
        let from_500 = |pings| health(pings, |ping| (ping < 500).then_some(true));
        assert!(!from_500(890).is_deaf(std::iter::empty()));
        assert!(from_500(901).is_deaf(std::iter::empty()));
        // After a single return, the head counts as detecting the wall again.
        let heard_again = health(902, |ping| (ping < 500 || ping == 901).then_some(true));
        assert!(!heard_again.is_deaf(std::iter::empty()));
        // Three quarters of each turn give no return, as beside a side tunnel or an absorbing wall.
        let side = health(4000, |ping| (ping % 400 < 100).then_some(true));
        assert!(!side.is_deaf(std::iter::empty()));
    }

    #[test]
    fn head_off_the_design_counts_as_detecting_no_wall_if_another_head_detects_it() {
        let elsewhere = health(1200, |ping| Some(ping < 400));
        let [hears, does_not] = [health(1200, |_| Some(true)), health(1200, |_| Some(false))];
        assert!(elsewhere.is_deaf([does_not.elsewhere(), hears.elsewhere()].into_iter()));
        assert!(
            !elsewhere.is_deaf([does_not.elsewhere()].into_iter()),
            "the position or the design is wrong"
        );
        assert!(!elsewhere.is_deaf(std::iter::empty()), "there is no other head");
        assert!(!hears.is_deaf([hears.elsewhere()].into_iter()));
        let begins = health(100, |_| Some(true));
        assert!(!elsewhere.is_deaf([begins.elsewhere()].into_iter()), "the other head isn't known yet");
        // A rock or a niche occupies a third of the turn.
        let rock = health(4000, |ping| Some(ping % 400 >= 130));
        assert!(!rock.is_deaf([hears.elsewhere()].into_iter()));
    }

    #[test]
    fn head_with_constant_range_is_stuck_if_the_wall_distance_varies() {
        let stuck = |pings: u32, spread_m: f64| {
            let mut health = HeadHealth::default();
            for ping in 0..pings {
                let angle_rad = f64::from(ping) * STEP_RAD;
                let off_m = spread_m / 2.0 * math::cos(angle_rad);
                health.add(angle_rad, Some(Heard { range_m: 5.0, off_m, is_wall: true }));
            }
            health.is_deaf(std::iter::empty())
        };
        assert!(stuck(202, 0.4) && !stuck(199, 0.4));
        // In the centre of a round pipe or near it, the wall's distance varies by less than the limit, so a constant
        // range isn't suspicious.
        assert!(!stuck(4000, 0.0) && !stuck(4000, 0.2));
    }
}
