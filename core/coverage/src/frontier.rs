//! Frontier: the stretch where samples may still land.
//!
//! It decides when a section is open and when it is judged. The *reach of the heads* (in the code: zone) contains the
//! sections on which samples of the awaited heads may land now, plus a margin.

use core::ops::Range;

use serde::{Deserialize, Serialize};

use headrace_geometry::math;
use headrace_geometry::time::MonoNs;
use headrace_sampling::head::SILENT_AFTER;

/// Range of chainages in which a head's samples currently land.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Reach {
    /// Smallest chainage of the reach, m.
    pub from_m: f64,
    /// Largest chainage of the reach, m.
    pub to_m: f64,
}

/// Reach of one head: the stretch where its samples land now, and the stretch that they have covered so far.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HeadReach {
    /// Receive time of the head's latest ping, with or without a fix; `None` before the first ping.
    heard: Option<MonoNs>,
    /// Reach at the head's latest ping with a fix.
    ///
    /// For a silent head, it is the reach at the latest advice update with a fix.
    latest: Reach,
    /// Chainages that the head's reach has covered; `None` before the first ping with a fix.
    swept: Option<Reach>,
}

impl HeadReach {
    /// Creates the reach after a ping with a fix at `now`. `before` is the reach before this ping.
    pub fn after(before: Option<Self>, now: MonoNs, reach: Reach) -> Self {
        debug_assert!(reach.is_ordered(), "a reach begins before it ends: {reach:?}");
        let swept = before.and_then(|before| before.swept).map_or(reach, |swept| swept.with(reach));
        Self { heard: Some(now), latest: reach, swept: Some(swept) }
    }

    /// Creates the reach of a silent head. Its samples would land at `reach` if it pinged.
    pub fn silent_at(before: Option<Self>, reach: Reach) -> Self {
        debug_assert!(reach.is_ordered(), "a reach begins before it ends: {reach:?}");
        before.map_or(Self { heard: None, latest: reach, swept: None }, |before| Self {
            latest: reach,
            ..before
        })
    }

    /// Records a ping without a fix.
    ///
    /// The head is alive. Its reach stays that of the latest fix.
    pub fn heard(&mut self, now: MonoNs) {
        self.heard = Some(now);
    }

    /// Returns the last known reach of the head.
    pub fn latest(&self) -> Reach {
        self.latest
    }

    fn is_alive(&self, now: MonoNs) -> bool {
        self.heard.is_some_and(|heard| is_within_silence(heard, now))
    }
}

fn is_within_silence(since: MonoNs, now: MonoNs) -> bool {
    now.since(since).0.abs() <= SILENT_AFTER.0
}

/// Tracks the reach of all heads along the tunnel, and the coverage extent.
///
/// The caller stores the reach of each head, and passes it to the methods.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Frontier {
    /// Chainages that the reach of any head has covered.
    swept: Option<Reach>,
    /// Coverage extent: chainages where the vehicle and its heads have been, and chainages with samples.
    ///
    /// It also contains the places of heads that do not ping.
    way: Option<Reach>,
    /// Stretch where all heads have been, whether they ping or not. All of their combined reach has moved across it.
    ///
    /// It is empty (`from_m` above `to_m`) until all heads have passed the same wall.
    through: Option<Reach>,
    /// Zone: index range of the sections within reach of the awaited heads, plus a margin.
    ///
    /// A head is awaited if its samples may still land.
    zone: Option<Range<i64>>,
    /// Time of the latest change of the zone.
    zone_moved: Option<MonoNs>,
    /// Time of the latest ping of any head.
    heard: Option<MonoNs>,
    /// Time of the first ping, or of the latest ping that ended a silence of all heads.
    ///
    /// Before the first ping, it is the time of the first advice update.
    woken: Option<MonoNs>,
    course: Option<Course>,
    /// Number of times that the vehicle has turned back.
    turns: u32,
}

/// Direction of travel along the tunnel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Course {
    /// Farthest chainage that the centre of the heads' combined reach has had on this course, m.
    farthest_m: f64,
    astern: bool,
    /// Number of heads in the combined reach.
    heads: usize,
}

/// Hysteresis for a reversal of the course, m. Yaw and slack of the tether cause smaller movements back and forth.
const TURNED_M: f64 = 0.25;

impl Course {
    /// Updates the course with the centre of the combined reach of `heads` heads.
    ///
    /// If the number of heads changes, the centre moves although the vehicle does not, so the direction is kept.
    fn to(self, middle_m: f64, heads: usize) -> Self {
        if heads != self.heads {
            return Self { farthest_m: middle_m, heads, ..self };
        }
        let ahead_m = if self.astern { self.farthest_m - middle_m } else { middle_m - self.farthest_m };
        match ahead_m {
            ahead_m if ahead_m > 0.0 => Self { farthest_m: middle_m, ..self },
            ahead_m if ahead_m < -TURNED_M => Self { farthest_m: middle_m, astern: !self.astern, ..self },
            _ => self,
        }
    }
}

/// Outlook: where samples have landed and may still land at a given time.
#[derive(Debug, Clone, PartialEq)]
pub struct Outlook {
    /// Time of the outlook.
    pub at: MonoNs,
    /// Coverage extent: chainages where the vehicle and its heads, pinging or not, have been.
    pub way: Option<Reach>,
    /// Stretch that every awaited head has covered; `None` if there is none. A head is awaited if its samples may still
    /// land. Heads that never pinged are left out.
    pub swept_by_all: Option<Reach>,
    /// Whether no head is alive: none has pinged for longer than [`SILENT_AFTER`].
    pub none_alive: bool,
    /// Stretch where samples may still land if the vehicle does not turn back.
    pub to_come: Option<Reach>,
    /// Stretch behind the place where the vehicle began or turned back, where some heads have not been.
    ///
    /// These heads will not reach it on the present course.
    pub not_passed: Option<Reach>,
    /// Stretch where all heads, pinging or not, have been; `None` while there is no such stretch.
    pub through: Option<Reach>,
    /// Zone of the sections within reach of the heads, if it has been unchanged for longer than [`SILENT_AFTER`]. The
    /// vehicle is then nearly stationary.
    pub still_zone: Option<Range<i64>>,
}

/// Change of the frontier by one ping or one advice update.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Moved {
    /// Sections that have just left the zone behind the vehicle.
    pub left_behind: Range<i64>,
    /// Sections that have just left the zone ahead of the vehicle, because it moves backwards.
    pub left_ahead: Range<i64>,
    /// Whether the coverage extent has grown by at least a section, perhaps outside the zone.
    pub way_grown: bool,
    /// Stretch where samples may still land if the vehicle does not turn back.
    pub to_come: Option<Reach>,
}

impl Frontier {
    /// Returns the chainages that have been within reach of any head.
    pub fn swept(&self) -> Option<Reach> {
        self.swept
    }

    /// Returns the coverage extent: chainages where the vehicle and its heads, pinging or not, have been.
    pub fn way(&self) -> Option<Reach> {
        self.way
    }

    /// Number of times the vehicle has turned back so far.
    pub fn turns(&self) -> u32 {
        self.turns
    }

    /// Returns the outlook at `at`. `heads` are the reaches of all heads.
    pub fn outlook(&self, heads: impl Iterator<Item = HeadReach> + Clone, at: MonoNs) -> Outlook {
        let common = |a: Reach, b: Reach| Reach { from_m: a.from_m.max(b.from_m), to_m: a.to_m.min(b.to_m) };
        let swept = self.awaited(heads.clone(), at).filter_map(|head| head.swept);
        Outlook {
            at,
            way: self.way,
            swept_by_all: swept.reduce(common).filter(|all| all.from_m <= all.to_m),
            none_alive: !heads.clone().any(|head| head.is_alive(at)),
            to_come: self.to_come(heads, at),
            not_passed: self.not_passed(),
            through: self.through(),
            still_zone: self.still_zone(at),
        }
    }

    /// Returns the zone of sections within reach of the heads if the vehicle is nearly stationary.
    ///
    /// `None` within [`SILENT_AFTER`] of the first ping, because it is not known yet which heads are alive.
    fn still_zone(&self, now: MonoNs) -> Option<Range<i64>> {
        let over = |since: Option<MonoNs>| since.is_some_and(|since| now.since(since).0 > SILENT_AFTER.0);
        self.zone.clone().filter(|_| over(self.woken) && over(self.zone_moved))
    }

    /// Whether a head has been silent for so long that sections no longer wait for it while other heads ping.
    pub fn is_silent(&self, head: Option<&HeadReach>, now: MonoNs) -> bool {
        match head.and_then(|head| head.heard) {
            Some(heard) => !is_within_silence(heard, now),
            None => !self.is_waking(now),
        }
    }

    /// Whether it is not known yet which heads are alive.
    ///
    /// True for [`SILENT_AFTER`] after the first ping, and after a ping that ended a silence of all heads.
    fn is_waking(&self, now: MonoNs) -> bool {
        self.woken.is_none_or(|woken| is_within_silence(woken, now))
    }

    /// Returns the awaited heads, whose samples may still land.
    ///
    /// All heads are awaited if none is alive, or if it is not known yet which heads are alive.
    fn awaited(
        &self,
        heads: impl Iterator<Item = HeadReach> + Clone,
        now: MonoNs,
    ) -> impl Iterator<Item = HeadReach> + Clone {
        let all = self.is_waking(now) || !heads.clone().any(|head| head.is_alive(now));
        heads.filter(move |head| all || head.is_alive(now))
    }

    /// Returns the combined reach of the awaited heads.
    fn reach(&self, heads: impl Iterator<Item = HeadReach> + Clone, now: MonoNs) -> Option<Reach> {
        self.awaited(heads, now).map(|head| head.latest).reduce(Reach::with)
    }

    /// Returns the stretch where samples may still land if the vehicle does not turn back.
    ///
    /// It contains the current reach and everything ahead.
    fn to_come(&self, heads: impl Iterator<Item = HeadReach> + Clone, now: MonoNs) -> Option<Reach> {
        let reach = self.reach(heads, now)?;
        Some(match self.course {
            Some(Course { astern: true, .. }) => Reach { from_m: f64::NEG_INFINITY, ..reach },
            _ => Reach { to_m: f64::INFINITY, ..reach },
        })
    }

    /// Records the combined reach of all heads at an advice update, whether they ping or not.
    pub fn pass(&mut self, all: Reach) {
        debug_assert!(all.is_ordered(), "a reach begins before it ends: {all:?}");
        let through = self.through.unwrap_or(Reach { from_m: all.to_m, to_m: all.from_m });
        self.through =
            Some(Reach { from_m: through.from_m.min(all.to_m), to_m: through.to_m.max(all.from_m) });
    }

    /// Returns the stretch where all heads have been, whether they ping or not. `None` while there is none.
    pub fn through(&self) -> Option<Reach> {
        self.through.filter(|through| through.from_m <= through.to_m)
    }

    fn not_passed(&self) -> Option<Reach> {
        let Reach { from_m, to_m } = self.through?;
        Some(match self.course {
            Some(Course { astern: true, .. }) => Reach { from_m: to_m, to_m: f64::INFINITY },
            _ => Reach { from_m: f64::NEG_INFINITY, to_m: from_m },
        })
    }

    /// Records a ping of any head at `now`, with or without a fix.
    pub fn hear(&mut self, now: MonoNs) {
        if !self.heard.is_some_and(|heard| is_within_silence(heard, now)) {
            self.woken = Some(now);
        }
        self.heard = Some(now);
    }

    /// Updates the frontier for a ping at `now` with reach `pinged`.
    ///
    /// `heads` are the reaches of all heads, including that of the head that pinged. A section leaves the zone once it
    /// is farther than `margin_m` from the reach of every awaited head.
    pub fn advance(
        &mut self,
        pinged: Reach,
        heads: impl Iterator<Item = HeadReach> + Clone,
        now: MonoNs,
        section_m: f64,
        margin_m: f64,
    ) -> Moved {
        self.hear(now);
        self.swept = Some(self.swept.map_or(pinged, |swept| swept.with(pinged)));
        self.way = Some(self.way.map_or(pinged, |way| way.with(pinged)));
        debug_assert!(self.has_been_where_it_swept(), "{:?} is within {:?}", self.swept, self.way);
        self.move_zone(heads, now, section_m, margin_m)
    }

    /// Updates the frontier for an advice update at `now`. `span` covers the vehicle and its heads, whether they ping
    /// or not.
    ///
    /// `heads` are the reaches of all heads; that of a silent head is where it would ping. While a head is alive, only
    /// pings move the zone.
    pub fn update(
        &mut self,
        span: Reach,
        heads: impl Iterator<Item = HeadReach> + Clone,
        now: MonoNs,
        section_m: f64,
        margin_m: f64,
    ) -> Moved {
        self.woken = self.woken.or(Some(now));
        let index = |x_m: f64| math::floor_to_i64(x_m / section_m);
        debug_assert!(span.is_ordered(), "a span begins before it ends: {span:?}");
        let way = self.way.map_or(span, |way| way.with(span));
        let sections = |way: Reach| (index(way.from_m), index(way.to_m));
        let way_grown = self.way.map(sections) != Some(sections(way));
        self.way = Some(way);
        let moved = match self.zone.clone() {
            Some(zone) if heads.clone().any(|head| head.is_alive(now)) => Moved {
                left_behind: zone.start..zone.start,
                left_ahead: zone.end..zone.end,
                way_grown: false,
                to_come: self.to_come(heads, now),
            },
            _ => self.move_zone(heads, now, section_m, margin_m),
        };
        Moved { way_grown, ..moved }
    }

    /// Whether the coverage extent contains all chainages that the heads' reaches have covered.
    fn has_been_where_it_swept(&self) -> bool {
        self.swept.zip(self.way).is_some_and(|(swept, way)| swept.is_ordered() && way.with(swept) == way)
    }

    fn move_zone(
        &mut self,
        heads: impl Iterator<Item = HeadReach> + Clone,
        now: MonoNs,
        section_m: f64,
        margin_m: f64,
    ) -> Moved {
        let Some(all) = self.reach(heads.clone(), now) else { return Moved::default() };
        let middle_m = all.middle_m();
        let count = self.awaited(heads.clone(), now).count();
        let course = self.course.unwrap_or(Course { farthest_m: middle_m, astern: false, heads: count });
        let course_now = course.to(middle_m, count);
        self.turns += u32::from(course_now.astern != course.astern);
        self.course = Some(course_now);
        // L is the section length. Section k spans [kL, (k+1)L). It is behind the reach if (k+1)L + margin <= from, and
        // ahead of the reach if kL - margin >= to.
        let first = math::floor_to_i64((all.from_m - margin_m) / section_m);
        let end = -math::floor_to_i64(-(all.to_m + margin_m) / section_m);
        debug_assert!(first <= end, "a zone begins before it ends: {all:?} gives {first} to {end}");
        let zone = first..end;
        if self.zone.as_ref() != Some(&zone) {
            self.zone_moved = Some(now);
        }
        let before = self.zone.replace(zone.clone()).unwrap_or(zone.clone());
        Moved {
            left_behind: before.start..zone.start,
            left_ahead: zone.end..before.end,
            way_grown: false,
            to_come: self.to_come(heads, now),
        }
    }
}

impl Moved {
    /// Whether a section has just left the zone within reach of the heads.
    pub(super) fn has_left(&self, section: i64) -> bool {
        self.left_behind.contains(&section) || self.left_ahead.contains(&section)
    }

    /// Whether nothing has changed since the previous ping or update: no section left the zone, and the coverage extent
    /// has not grown.
    ///
    /// Also true if no head's place is known.
    pub fn is_nothing(&self) -> bool {
        let stayed = self.left_behind.is_empty() && self.left_ahead.is_empty() && !self.way_grown;
        stayed || self.to_come.is_none()
    }
}

impl Reach {
    /// Whether the stretch begins at or before its end.
    pub fn is_ordered(&self) -> bool {
        self.from_m <= self.to_m
    }

    /// Centre of the stretch, m.
    pub fn middle_m(&self) -> f64 {
        f64::midpoint(self.from_m, self.to_m)
    }

    /// Returns the smallest stretch that covers both stretches.
    #[must_use]
    pub fn with(self, other: Self) -> Self {
        Self { from_m: self.from_m.min(other.from_m), to_m: self.to_m.max(other.to_m) }
    }
}

/// Distance of a chainage from the stretch where samples may still land, m.
///
/// Infinite if there is no such stretch.
pub fn clear_of(to_come: Option<Reach>, x_m: f64) -> f64 {
    to_come.map_or(f64::INFINITY, |reach| (reach.from_m - x_m).max(x_m - reach.to_m).max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Test fixture: a frontier with its heads.
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
    fn section_leaves_the_reach_of_the_heads_when_the_rear_head_is_a_margin_past_it() {
        let mut frontier = Fixture::default();
        frontier.advance(0, MonoNs(0), 1.0, 0.25, 0.25);
        frontier.advance(1, MonoNs(0), 0.5, 0.25, 0.25);
        let moved = frontier.advance(1, MonoNs(1), 0.749, 0.25, 0.25);
        assert_eq!(moved.left_behind, 1..1);
        let moved = frontier.advance(1, MonoNs(2), 0.75, 0.25, 0.25);
        assert_eq!(moved.left_behind, 1..2, "section [0.25, 0.5) is left once 0.75 is reached");
    }

    #[test]
    fn sections_ahead_leave_the_reach_of_the_heads_when_the_vehicle_moves_backwards() {
        let mut frontier = Fixture::default();
        frontier.advance(0, MonoNs(0), 2.0, 0.25, 0.25);
        let moved = frontier.advance(0, MonoNs(1), 1.7, 0.25, 0.25);
        assert_eq!(moved.left_ahead, 8..9);
        assert!(moved.left_behind.is_empty());
    }

    #[test]
    fn samples_are_expected_ahead_until_the_vehicle_turns_back() {
        let mut frontier = Fixture::default();
        for x_m in [1.0, 2.0, 1.8] {
            frontier.advance(0, MonoNs(0), x_m, 0.25, 0.25);
        }
        let clear = |frontier: &Fixture, x_m: f64| clear_of(frontier.to_come(MonoNs(0)), x_m);
        assert_eq!([1.0, 1.8, 2.5].map(|x_m| clear(&frontier, x_m) > 0.5), [true, false, false]);
        frontier.advance(0, MonoNs(0), 1.7, 0.25, 0.25);
        assert_eq!([1.0, 1.7, 2.5].map(|x_m| clear(&frontier, x_m) > 0.5), [false, false, true]);
        let silent = clear_of(frontier.to_come(MonoNs(3_000_000_000)), 2.5);
        assert!(silent > 0.5, "if no head is alive, all heads are awaited at their latest places");
    }

    #[test]
    fn silent_head_does_not_extend_the_reach_of_the_heads() {
        let mut frontier = Fixture::default();
        frontier.advance(1, MonoNs(0), 0.0, 0.25, 0.0);
        frontier.advance(0, MonoNs(0), 1.0, 0.25, 0.0);
        frontier.advance(0, MonoNs(1_000_000_000), 1.0, 0.25, 0.0);
        let moved = frontier.advance(0, MonoNs(2_000_000_001), 1.0, 0.25, 0.0);
        assert_eq!(moved.left_behind, 0..4);
    }

    impl Fixture {
        /// Updates the test frontier at the time `now_s`, seconds.
        ///
        /// One head is half a metre in front of the vehicle, and the other half a metre behind it, whether they ping or
        /// not.
        fn update(&mut self, now_s: u64, x_m: f64) -> Moved {
            let now = MonoNs(now_s * 1_000_000_000);
            let places = [x_m + 0.5, x_m - 0.5].map(|x_m| Reach { from_m: x_m, to_m: x_m });
            for (head, place) in self.heads.iter_mut().zip(places) {
                if self.frontier.is_silent(head.as_ref(), now) {
                    *head = Some(HeadReach::silent_at(*head, place));
                }
            }
            let Self { frontier, heads } = self;
            frontier.update(places[0].with(places[1]), heads.iter().flatten().copied(), now, 0.25, 0.25)
        }

        fn ping(&mut self, head: usize, now_s: u64, x_m: f64) -> Moved {
            self.advance(head, MonoNs(now_s * 1_000_000_000), x_m, 0.25, 0.25)
        }
    }

    #[test]
    fn vehicle_motion_without_pings_extends_only_the_coverage_extent() {
        let mut frontier = Fixture::default();
        frontier.ping(0, 10, 3.5);
        frontier.ping(1, 10, 2.5);
        frontier.ping(0, 12, 3.5);
        frontier.ping(0, 13, 3.5);
        let to_come = frontier.to_come(MonoNs(13_000_000_000));
        let moved = frontier.update(13, 5.0);
        assert_eq!((moved.left_behind.is_empty(), moved.left_ahead.is_empty()), (true, true));
        assert_eq!((moved.to_come, frontier.to_come(MonoNs(13_000_000_000))), (to_come, to_come));
        assert_eq!(
            to_come,
            Some(Reach { from_m: 3.5, to_m: f64::INFINITY }),
            "head 1 has been silent for 3 s"
        );
        assert_eq!(frontier.frontier.way(), Some(Reach { from_m: 2.5, to_m: 5.5 }));
        assert!(moved.way_grown && !moved.is_nothing());
        assert!(frontier.update(13, 5.1).is_nothing(), "the vehicle is still in the same section");
    }

    #[test]
    fn silent_heads_are_assumed_to_move_with_the_vehicle_if_no_head_is_alive() {
        let mut frontier = Fixture::default();
        frontier.ping(0, 0, 3.5);
        frontier.ping(1, 0, 2.5);
        assert!(frontier.update(1, 3.5).left_behind.is_empty(), "the heads' silence isn't known yet");
        // If the rear head pinged, it would be at 6 m: a quarter of a metre past section [5.5, 5.75).
        assert_eq!(frontier.update(3, 6.5).left_behind, 9..23);
        let to_come = frontier.to_come(MonoNs(3_000_000_000));
        assert_eq!(to_come, Some(Reach { from_m: 6.0, to_m: f64::INFINITY }));
        assert_eq!(frontier.update(4, 5.5).left_ahead, 25..29, "going back leaves sections ahead");
    }

    #[test]
    fn stretch_that_all_heads_passed_begins_where_the_front_head_began_and_ends_at_the_rear_head() {
        let mut frontier = Frontier::default();
        let at = |x_m: f64| Reach { from_m: x_m - 0.5, to_m: x_m + 0.5 };
        assert_eq!((frontier.through(), frontier.not_passed()), (None, None));
        frontier.pass(at(3.0));
        assert_eq!(frontier.through(), None, "the heads are a metre apart");
        assert_eq!(frontier.not_passed(), Some(Reach { from_m: f64::NEG_INFINITY, to_m: 3.5 }));
        for x_m in [4.0, 9.0, 8.5] {
            frontier.pass(at(x_m));
        }
        assert_eq!(frontier.through(), Some(Reach { from_m: 3.5, to_m: 8.5 }));
        frontier.course = Some(Course { farthest_m: 8.5, astern: true, heads: 2 });
        assert_eq!(frontier.not_passed(), Some(Reach { from_m: 8.5, to_m: f64::INFINITY }));
        frontier.pass(at(1.0));
        assert_eq!(frontier.through(), Some(Reach { from_m: 1.5, to_m: 8.5 }));
    }

    #[test]
    fn sections_wait_for_every_head_again_after_all_heads_were_silent() {
        let mut frontier = Fixture::default();
        frontier.update(0, 3.0);
        frontier.update(5, 4.0);
        let moved = frontier.ping(0, 6, 4.5);
        assert_eq!((moved.left_behind.is_empty(), moved.left_ahead.is_empty()), (true, true), "{moved:?}");
        frontier.ping(0, 7, 4.5);
        frontier.ping(0, 8, 4.5);
        let moved = frontier.ping(0, 9, 4.5);
        assert_eq!(moved.left_behind, 13..17, "head 1 stays silent and is no longer awaited");
    }
}
