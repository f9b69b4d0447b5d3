//! When a fail can no longer be undone by going on forward: from the poses of a dive and all its samples.
//!
//! A place fails for good at the first moment at which a circle about it, larger than the target by what position errors
//! may make of it, is empty, and no head that goes on forward can lay a sample into it: all that any head reaches lies
//! beyond the circle. A head's reach is what rays in its plane meet at its present attitude.

use std::ops::Range;

use headrace_geometry::frames::{Pose, head_direction};
use headrace_geometry::math::{self, TAU};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::report::SectionReport;

use crate::instrumented::{Dive, Ping};
use headrace_oracle::wall::Wall;

/// Poses are looked at so often.
pub const EVERY: DurNs = DurNs(100_000_000);
/// Rays round a head.
const RAYS: u32 = 48;
/// Parts of a section in which its earliest fail is looked for.
pub const PARTS: u32 = 16;
/// The program looks where all heads have been five times a second, and goes by the farthest wall for a tilted head's
/// reach: its place is known to this, m.
pub const NEAR_M: f64 = 0.12;
/// Shorter ways back are wobbling.
const WAY_BACK_M: f64 = 0.05;

/// What heads reach at a moment, and whether the vehicle goes forward.
#[derive(Debug, Clone, Copy)]
pub struct Reached {
    /// When.
    pub at: MonoNs,
    /// The least chainage on which a head can lay a sample, m.
    pub rear_m: f64,
    /// The greatest, m.
    pub front_m: f64,
}

/// What was within reach during a dive.
pub fn reached(dive: &Dive) -> Vec<Reached> {
    let mut all: Vec<Reached> = Vec::new();
    for (index, ping) in dive.pings.iter().enumerate() {
        let due = all.last().is_none_or(|last| ping.received.since(last.at).0 >= EVERY.0);
        // The last one too: it is where the dive ends.
        let due = due || index + 1 == dive.pings.len();
        if let Some(pose) = ping.pose.filter(|_| due) {
            let [rear_m, front_m] = ends_m(dive, &pose);
            all.push(Reached { at: ping.received, rear_m, front_m });
        }
    }
    all
}

/// From where on all heads have been, wherever they were at first, m.
pub fn all_passed_from_m(reached: &[Reached]) -> f64 {
    reached.iter().map(|reached| reached.front_m).fold(f64::INFINITY, f64::min)
}

fn ends_m(dive: &Dive, pose: &Pose) -> [f64; 2] {
    let [mut rear_m, mut front_m] = [f64::INFINITY, f64::NEG_INFINITY];
    for (mount, range_m) in dive.mounts.iter().zip(&dive.ranges_m) {
        let head = pose.place(mount.position);
        for ray in 0..RAYS {
            let angle_rad = TAU * f64::from(ray) / f64::from(RAYS);
            let direction = pose.attitude * (mount.rotation * head_direction(angle_rad));
            let hit = dive.profile.cast([head.y(), head.z()], [direction.y(), direction.z()]);
            let chainage_m =
                hit.filter(|hit| hit.range_m <= *range_m).map(|hit| head.x() + hit.range_m * direction.x());
            rear_m = rear_m.min(chainage_m.unwrap_or(f64::INFINITY));
            front_m = front_m.max(chainage_m.unwrap_or(f64::NEG_INFINITY));
        }
    }
    [rear_m, front_m]
}

/// The least chainage in a section about which a circle of this radius is empty and lies where all heads have been, from
/// `passed_m` on; to a part of the section in [`PARTS`], and never too small.
pub fn first_failing_m(wall: &Wall, [from_m, to_m]: [f64; 2], radius_m: f64, passed_m: f64) -> Option<f64> {
    let from_m = from_m.max(passed_m + radius_m);
    if from_m >= to_m { None } else { first_in_m(wall, [from_m, to_m], radius_m, PARTS) }
}

fn first_in_m(wall: &Wall, [from_m, to_m]: [f64; 2], radius_m: f64, parts: u32) -> Option<f64> {
    let circle = wall.largest(from_m, to_m).filter(|circle| circle.radius_m > radius_m)?;
    let middle_m = f64::midpoint(from_m, to_m);
    let half = |ends_m: [f64; 2]| first_in_m(wall, ends_m, radius_m, parts / 2);
    if parts < 2 {
        return Some(circle.centre[0]);
    }
    half([from_m, middle_m]).or_else(|| half([middle_m, to_m]))
}

/// The first moment, among these, at which all that is in reach lies beyond a chainage.
pub fn left_behind(reached: &[Reached], chainage_m: f64) -> Option<MonoNs> {
    reached.iter().find(|reached| reached.rear_m >= chainage_m).map(|reached| reached.at)
}

/// The wall as sampled until a moment.
pub fn wall_until(dive: &Dive, until: MonoNs) -> Wall {
    let before = |ping: &&Ping| ping.received <= until;
    let samples = dive.pings.iter().filter(before).filter_map(|ping| ping.sample);
    Wall::new(samples.map(|sample| sample.place), dive.profile.perimeter_m()).unwrap()
}

/// What a section's flag should have been, and what it was.
#[derive(Debug, Clone, PartialEq)]
pub struct Flag {
    /// Chainage at which the section begins, m.
    pub start_m: f64,
    /// The first moment from which going on forward couldn't undo the fail, seconds.
    pub due_s: Option<f64>,
    /// The same, were it as early as the parts of the section leave open.
    pub may_s: Option<f64>,
    /// When the dive ended.
    pub end_s: f64,
    /// When the loop raised it, seconds.
    pub raised_s: Option<f64>,
    /// When the loop cleared it, seconds.
    pub cleared_s: Option<f64>,
    /// How far all that is in reach had gone beyond that moment's when it was raised, m.
    pub late_m: Option<f64>,
    /// Whether the section fails, all samples counted.
    pub fails: bool,
}

impl Flag {
    /// Raised by the end of the dive alone.
    pub fn raised_at_the_end(&self) -> bool {
        self.may_s.is_none() && self.raised_s.is_some_and(|at_s| at_s >= self.end_s - 1e-6)
    }

    /// How long after its moment, seconds.
    pub fn late_s(&self) -> Option<f64> {
        Some(self.raised_s? - self.due_s?)
    }
}

/// A dive's way, out and on again, with what has been sampled.
pub struct Journey {
    reached: Vec<Reached>,
    /// From which to which of these moments the vehicle goes back the longest way; empty at the end where it doesn't.
    back: Range<usize>,
    /// All that has been sampled in the end, and when the vehicle turned back.
    whole: Wall,
    turned: Option<Wall>,
    end_s: f64,
}

impl Journey {
    /// Reach and samples of a dive.
    pub fn of(dive: &Dive) -> Self {
        let reached = reached(dive);
        let (mut most, mut back, mut longest_m) = (0, reached.len()..reached.len(), WAY_BACK_M);
        for (k, here) in reached.iter().enumerate() {
            if here.rear_m > reached[most].rear_m {
                most = k;
            }
            if reached[most].rear_m - here.rear_m > longest_m {
                longest_m = reached[most].rear_m - here.rear_m;
                back = most..k;
            }
        }
        let turned = reached.get(back.start).map(|turned| wall_until(dive, turned.at));
        let end_s = dive.report.dive.start_s + dive.report.dive.duration_s;
        Self { reached, back, whole: wall_until(dive, MonoNs(u64::MAX)), turned, end_s }
    }

    /// When the vehicle turned back, seconds; never is infinite.
    pub fn turned_back_s(&self) -> f64 {
        self.reached.get(self.back.start).map_or(f64::INFINITY, |reached| reached.at.as_secs_f64())
    }

    /// When it went forward again.
    pub fn turned_on_s(&self) -> f64 {
        self.reached.get(self.back.end).map_or(f64::INFINITY, |reached| reached.at.as_secs_f64())
    }

    /// Whether a section that was flagged failed for good just then, by what had been sampled: later samples that an empty
    /// circle gets because the vehicle swings back don't count.
    pub fn was_due(&self, dive: &Dive, flag: &Flag, sd: f64) -> bool {
        let report = &dive.report;
        let section = report.sections.iter().find(|section| section.start_m >= flag.start_m);
        let Some((section, raised_s)) = section.zip(flag.raised_s) else { return false };
        let raised = MonoNs(math::round_to_i64(raised_s * 1e9).unsigned_abs());
        // Of some pings: places and attitudes are as noisy as navigation is.
        let near = |ping: &&Ping| raised.since(ping.received).0.abs() <= EVERY.0;
        let poses = dive.pings.iter().filter(near).filter_map(|ping| ping.pose);
        let rear_m = poses.map(|pose| ends_m(dive, &pose)[0]).fold(f64::MIN, f64::max);
        let ends = [section.start_m, section.end_m];
        let radius_m = 0.5 * (report.target_m + sd * section.hole_sd_m);
        let passed_m = all_passed_from_m(&self.reached) - NEAR_M;
        let first_m = first_failing_m(&wall_until(dive, raised), ends, radius_m, passed_m);
        let line_m = (ends[1] - ends[0]) / f64::from(PARTS);
        first_m.is_some_and(|first_m| first_m + radius_m - line_m <= rear_m)
    }

    /// The flags of a dive. A fail is a hole larger than the target by `sd` of its standard deviation.
    pub fn flags(&self, dive: &Dive, sd: f64) -> Vec<Flag> {
        let target_m = dive.report.target_m;
        dive.report.sections.iter().map(|section| self.flag(target_m, section, sd)).collect()
    }

    fn flag(&self, target_m: f64, section: &SectionReport, sd: f64) -> Flag {
        let ends = [section.start_m, section.end_m];
        let radius_m = 0.5 * (target_m + sd * section.hole_sd_m);
        let due_m = |wall: &Wall, early_m: f64| {
            // What is early for a flag is late for its moment.
            let near_m = if early_m > 0.0 { -NEAR_M } else { NEAR_M };
            let passed_m = all_passed_from_m(&self.reached) + near_m;
            Some(first_failing_m(wall, ends, radius_m, passed_m)? + radius_m - early_m)
        };
        let due =
            |wall: &Wall, reached: &[Reached], early_m: f64| left_behind(reached, due_m(wall, early_m)?);
        let on = if self.turned.is_some() { self.back.end } else { 0 };
        let first = |early_m: f64| {
            let out =
                self.turned.as_ref().and_then(|wall| due(wall, &self.reached[..self.back.start], early_m));
            out.or_else(|| due(&self.whole, &self.reached[on..], early_m)).map(MonoNs::as_secs_f64)
        };
        let line_m = (section.end_m - section.start_m) / f64::from(PARTS);
        let late_m = || {
            let raised_s = section.flagged_s?;
            let before = |reached: &&Reached| reached.at.as_secs_f64() <= raised_s;
            // Where reach or deviation have just jumped, the tick is what counts.
            let soon_s = 2.0 * EVERY.as_secs_f64();
            first(0.0).filter(|due_s| raised_s > due_s + soon_s)?;
            Some(self.reached.iter().take_while(before).last()?.rear_m - due_m(&self.whole, 0.0)?)
        };
        Flag {
            late_m: late_m(),
            start_m: section.start_m,
            due_s: first(0.0),
            may_s: first(line_m),
            end_s: self.end_s,
            raised_s: section.flagged_s,
            cleared_s: section.cleared_s,
            fails: self.whole.largest(ends[0], ends[1]).is_none_or(|circle| circle.radius_m > radius_m),
        }
    }
}
