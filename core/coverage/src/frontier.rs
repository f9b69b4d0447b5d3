//! Where samples may still land: decides when a section is open and when it is judged.

use core::ops::Range;

use serde::{Deserialize, Serialize};

use headrace_geometry::time::MonoNs;
use headrace_sampling::head::SILENT_AFTER;

/// Stretch of tunnel on which a head currently lands samples.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Reach {
    /// Least chainage, m.
    pub from_m: f64,
    /// Greatest chainage, m.
    pub to_m: f64,
}

/// Reach of one head: the current stretch, and all chainages swept so far.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HeadReach {
    /// Receive time of the head's last ping, with or without a fix.
    heard: MonoNs,
    /// Reach at its last ping with a fix.
    latest: Reach,
    /// Chainages that its reach has covered.
    swept: Reach,
}

impl HeadReach {
    /// Reach after a ping with a fix at `now`; `before` is the reach before that ping.
    pub fn after(before: Option<Self>, now: MonoNs, reach: Reach) -> Self {
        let swept = before.map_or(reach, |before| before.swept.with(reach));
        Self { heard: now, latest: reach, swept }
    }

    /// Records a ping without a fix: the head is alive, its reach stays where it was at the last fix.
    pub fn heard(&mut self, now: MonoNs) {
        self.heard = now;
    }

    /// Reach at the last ping with a fix.
    pub fn latest(&self) -> Reach {
        self.latest
    }

    fn is_alive(&self, now: MonoNs) -> bool {
        now.since(self.heard).0.abs() <= SILENT_AFTER.0
    }
}

/// Tracks the reach of all heads along the tunnel. The reach of each head is stored with the head and passed in.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Frontier {
    /// Chainages that any head's reach has covered.
    swept: Option<Reach>,
    /// Index range of the sections within the reach of the live heads plus a margin.
    zone: Option<Range<i64>>,
    /// Time of its last change.
    zone_moved: Option<MonoNs>,
    /// Time of the first ping with a fix.
    begun: Option<MonoNs>,
    course: Option<Course>,
}

/// Direction of travel along the tunnel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Course {
    /// Farthest chainage on this course, m: the middle of the heads' combined reach.
    farthest_m: f64,
    astern: bool,
}

/// Hysteresis for a reversal of the course, m: yaw and tether slack look like a smaller one.
const TURNED_M: f64 = 0.25;

impl Course {
    /// Updates the course with the middle of the current reach.
    fn to(self, middle_m: f64) -> Self {
        let ahead_m = if self.astern { self.farthest_m - middle_m } else { middle_m - self.farthest_m };
        match ahead_m {
            ahead_m if ahead_m > 0.0 => Self { farthest_m: middle_m, ..self },
            ahead_m if ahead_m < -TURNED_M => Self { farthest_m: middle_m, astern: !self.astern },
            _ => self,
        }
    }
}

/// Where samples have landed and may still land at a given time.
#[derive(Debug, Clone, PartialEq)]
pub struct Outlook {
    /// The time.
    pub at: MonoNs,
    /// Chainages that have been within reach of any head.
    pub swept: Option<Reach>,
    /// Stretch covered by every live head; `None` if empty.
    pub swept_by_all: Option<Reach>,
    /// Where samples may still land without the vehicle turning back.
    pub to_come: Option<Reach>,
    /// The zone of sections in reach, once unchanged for longer than [`SILENT_AFTER`]: the vehicle is (nearly) stationary.
    pub still_zone: Option<Range<i64>>,
}

/// Change of the frontier by one ping.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Moved {
    /// Sections newly behind the zone.
    pub left_behind: Range<i64>,
    /// Sections newly ahead of the zone: the vehicle is backing up.
    pub left_ahead: Range<i64>,
    /// Where samples may still land without the vehicle turning back.
    pub to_come: Option<Reach>,
}

impl Frontier {
    /// Chainages that have been within reach of any head.
    pub fn swept(&self) -> Option<Reach> {
        self.swept
    }

    /// The outlook at `at`, given all heads' reaches.
    pub fn outlook(&self, heads: impl Iterator<Item = HeadReach> + Clone, at: MonoNs) -> Outlook {
        let common = |a: Reach, b: Reach| Reach { from_m: a.from_m.max(b.from_m), to_m: a.to_m.min(b.to_m) };
        let alive = heads.clone().filter(|head| head.is_alive(at));
        Outlook {
            at,
            swept: self.swept,
            swept_by_all: alive.map(|head| head.swept).reduce(common).filter(|all| all.from_m <= all.to_m),
            to_come: self.to_come(heads, at),
            still_zone: self.still_zone(at),
        }
    }

    /// `None` within [`SILENT_AFTER`] of the first ping: it isn't known yet which heads are alive.
    fn still_zone(&self, now: MonoNs) -> Option<Range<i64>> {
        let over = |since: Option<MonoNs>| since.is_some_and(|since| now.since(since).0 > SILENT_AFTER.0);
        self.zone.clone().filter(|_| over(self.begun) && over(self.zone_moved))
    }

    /// Where samples may still land without the vehicle turning back: the current reach and everything ahead.
    fn to_come(&self, heads: impl Iterator<Item = HeadReach>, now: MonoNs) -> Option<Reach> {
        let reach = reach(heads, now)?;
        Some(match self.course {
            Some(Course { astern: true, .. }) => Reach { from_m: f64::NEG_INFINITY, ..reach },
            _ => Reach { to_m: f64::INFINITY, ..reach },
        })
    }

    /// Updates the frontier for a ping at `now` with reach `pinged`; `heads` are the reaches of all heads, that one
    /// included. A section leaves the zone when it is farther than `margin_m` from the reach of every live head.
    pub fn advance(
        &mut self,
        pinged: Reach,
        heads: impl Iterator<Item = HeadReach> + Clone,
        now: MonoNs,
        section_m: f64,
        margin_m: f64,
    ) -> Moved {
        self.swept = Some(self.swept.map_or(pinged, |swept| swept.with(pinged)));
        let Some(all) = reach(heads.clone(), now) else { return Moved::default() };
        let middle_m = all.middle_m();
        let course = self.course.unwrap_or(Course { farthest_m: middle_m, astern: false });
        self.course = Some(course.to(middle_m));
        // Section k = [kL, (k+1)L) is behind when (k+1)L + margin <= from, ahead when kL - margin >= to.
        let first = headrace_geometry::math::floor_to_i64((all.from_m - margin_m) / section_m);
        let end = -headrace_geometry::math::floor_to_i64(-(all.to_m + margin_m) / section_m);
        let zone = first..end;
        self.begun = self.begun.or(Some(now));
        if self.zone.as_ref() != Some(&zone) {
            self.zone_moved = Some(now);
        }
        let before = self.zone.replace(zone.clone()).unwrap_or(zone.clone());
        Moved {
            left_behind: before.start..zone.start,
            left_ahead: zone.end..before.end,
            to_come: self.to_come(heads, now),
        }
    }
}

/// Combined reach of the live heads.
fn reach(heads: impl Iterator<Item = HeadReach>, now: MonoNs) -> Option<Reach> {
    heads.filter(|head| head.is_alive(now)).map(|head| head.latest).reduce(Reach::with)
}

impl Moved {
    /// True if no section left the zone, or no head is alive.
    pub fn is_nothing(&self) -> bool {
        self.left_behind.is_empty() && self.left_ahead.is_empty() || self.to_come.is_none()
    }
}

impl Reach {
    /// The middle of the stretch, m.
    pub fn middle_m(&self) -> f64 {
        f64::midpoint(self.from_m, self.to_m)
    }

    fn with(self, other: Self) -> Self {
        Self { from_m: self.from_m.min(other.from_m), to_m: self.to_m.max(other.to_m) }
    }
}

/// Distance of a chainage from where samples may still land, m; infinite if none may.
pub fn clear_of(to_come: Option<Reach>, x_m: f64) -> f64 {
    to_come.map_or(f64::INFINITY, |reach| (reach.from_m - x_m).max(x_m - reach.to_m).max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A frontier with its heads.
    #[derive(Default)]
    struct Fixture {
        frontier: Frontier,
        heads: [Option<HeadReach>; 2],
    }

    impl Fixture {
        fn advance(&mut self, head: usize, now: MonoNs, x_m: f64, section_m: f64, margin_m: f64) -> Moved {
            let reach = Reach { from_m: x_m, to_m: x_m };
            self.heads[head] = Some(HeadReach::after(self.heads[head], now, reach));
            let Self { frontier, heads } = self;
            frontier.advance(reach, heads.iter().flatten().copied(), now, section_m, margin_m)
        }

        fn to_come(&self, now: MonoNs) -> Option<Reach> {
            self.frontier.outlook(self.heads.iter().flatten().copied(), now).to_come
        }
    }

    #[test]
    fn a_section_is_left_when_the_last_head_is_a_margin_past_it() {
        let mut frontier = Fixture::default();
        frontier.advance(0, MonoNs(0), 1.0, 0.25, 0.25);
        frontier.advance(1, MonoNs(0), 0.5, 0.25, 0.25);
        let moved = frontier.advance(1, MonoNs(1), 0.749, 0.25, 0.25);
        assert_eq!(moved.left_behind, 1..1);
        let moved = frontier.advance(1, MonoNs(2), 0.75, 0.25, 0.25);
        assert_eq!(moved.left_behind, 1..2, "section [0.25, 0.5) is left once 0.75 is reached");
    }

    #[test]
    fn going_back_leaves_sections_ahead() {
        let mut frontier = Fixture::default();
        frontier.advance(0, MonoNs(0), 2.0, 0.25, 0.25);
        let moved = frontier.advance(0, MonoNs(1), 1.7, 0.25, 0.25);
        assert_eq!(moved.left_ahead, 8..9);
        assert!(moved.left_behind.is_empty());
    }

    #[test]
    fn what_lies_ahead_may_still_come_until_the_vehicle_has_turned_back() {
        let mut frontier = Fixture::default();
        for x_m in [1.0, 2.0, 1.8] {
            frontier.advance(0, MonoNs(0), x_m, 0.25, 0.25);
        }
        let clear = |frontier: &Fixture, x_m: f64| clear_of(frontier.to_come(MonoNs(0)), x_m);
        assert_eq!([1.0, 1.8, 2.5].map(|x_m| clear(&frontier, x_m) > 0.5), [true, false, false]);
        frontier.advance(0, MonoNs(0), 1.7, 0.25, 0.25);
        assert_eq!([1.0, 1.7, 2.5].map(|x_m| clear(&frontier, x_m) > 0.5), [false, false, true]);
        assert!(clear_of(frontier.to_come(MonoNs(3_000_000_000)), 1.7) > 1e9, "nobody is alive");
    }

    #[test]
    fn a_silent_head_is_not_waited_for() {
        let mut frontier = Fixture::default();
        frontier.advance(1, MonoNs(0), 0.0, 0.25, 0.0);
        frontier.advance(0, MonoNs(0), 1.0, 0.25, 0.0);
        let moved = frontier.advance(0, MonoNs(2_000_000_001), 1.0, 0.25, 0.0);
        assert_eq!(moved.left_behind, 0..4);
    }
}
