//! Finds the moment from which driving on can no longer undo the fail of a section. It uses the poses and samples of a
//! dive.
//!
//! A place has failed for good at the first moment when both of these conditions hold. First, an empty circle about the
//! place is larger than the target plus an allowance for position errors. Second, the reach of all heads lies beyond
//! this circle. While the vehicle moves forwards, no head can put a sample into it any more. The reach of a head is the
//! wall that the head can hit from its present position and attitude.

use std::ops::Range;

use headrace_geometry::frames::{Pose, head_direction};
use headrace_geometry::math::{self, TAU};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::section_row::SectionRow;

use crate::instrumented::{Dive, Ping};
use headrace_oracle::wall::Wall;

/// Interval at which the vehicle's poses are evaluated.
pub const EVERY: DurNs = DurNs(100_000_000);
/// Number of rays cast in all directions round a head.
const RAYS: u32 = 48;
/// Number of parts into which a section is divided when its earliest fail is searched for.
pub const PARTS: u32 = 16;
/// Tolerance of the chainage from which all heads have passed the wall, m. The program's own value may differ by this
/// much. The program updates its value five times a second, and uses the farthest wall as the reach of a tilted head.
pub const NEAR_M: f64 = 0.12;
/// Distance below which a backward motion of the vehicle counts as sway, m.
const WAY_BACK_M: f64 = 0.05;

/// Range of chainages at which the heads can hit the wall at a moment.
#[derive(Debug, Clone, Copy)]
pub struct Reached {
    /// Time at which the heads have this reach.
    pub at: MonoNs,
    /// Smallest chainage at which any head can sample the wall, m.
    pub rear_m: f64,
    /// Largest chainage at which any head can sample the wall, m.
    pub front_m: f64,
}

/// Computes the reach of the heads at intervals of [`EVERY`] during a dive.
pub fn reached(dive: &Dive) -> Vec<Reached> {
    let mut all: Vec<Reached> = Vec::new();
    for (index, ping) in dive.pings.iter().enumerate() {
        let due = all.last().is_none_or(|last| ping.received.since(last.at).0 >= EVERY.0);
        // The last ping is always included, because the dive ends there.
        let due = due || index + 1 == dive.pings.len();
        if let Some(pose) = ping.pose.filter(|_| due) {
            let [rear_m, front_m] = ends_m(dive, &pose);
            all.push(Reached { at: ping.received, rear_m, front_m });
        }
    }
    all
}

/// Chainage from which on all heads pass every place of the wall, m. It follows from the places at which the heads
/// started.
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

/// Smallest chainage, within a section, at which the centre of an empty circle can lie. The circle's radius is over
/// `radius_m`, and all of the circle lies beyond `passed_m`.
///
/// The result is never too small. It is too large by at most one part of the section ([`PARTS`]).
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

/// First moment at which the reach of all heads lies beyond a chainage.
pub fn left_behind(reached: &[Reached], chainage_m: f64) -> Option<MonoNs> {
    reached.iter().find(|reached| reached.rear_m >= chainage_m).map(|reached| reached.at)
}

/// The wall with all samples of a dive up to a moment.
pub fn wall_until(dive: &Dive, until: MonoNs) -> Wall {
    let before = |ping: &&Ping| ping.received <= until;
    let samples = dive.pings.iter().filter(before).filter_map(|ping| ping.sample);
    Wall::new(samples.map(|sample| sample.place), dive.profile.perimeter_m()).unwrap()
}

/// The flag of a section, with the times at which the flag was due and at which the loop raised and cleared it.
#[derive(Debug, Clone, PartialEq)]
pub struct Flag {
    /// Chainage of the section's start, m.
    pub start_m: f64,
    /// First moment after which forward motion can't undo the fail, seconds.
    pub due_s: Option<f64>,
    /// Earliest possible value of `due_s`, seconds. It allows for the resolution of the search, which is one part of a
    /// section.
    pub may_s: Option<f64>,
    /// End of the dive, seconds.
    pub end_s: f64,
    /// Time at which the loop raised the flag, seconds.
    pub raised_s: Option<f64>,
    /// Time at which the loop cleared the flag, seconds.
    pub cleared_s: Option<f64>,
    /// Distance by which the heads' reach moved on between the due moment and the raising of the flag, m.
    pub late_m: Option<f64>,
    /// Whether the section fails in the end, with all samples of the dive.
    pub fails: bool,
}

impl Flag {
    /// Whether the flag was raised only because the dive ended.
    pub fn raised_at_the_end(&self) -> bool {
        self.may_s.is_none() && self.raised_s.is_some_and(|at_s| at_s >= self.end_s - 1e-6)
    }

    /// Delay of the flag after the due moment, seconds.
    pub fn late_s(&self) -> Option<f64> {
        Some(self.raised_s? - self.due_s?)
    }
}

/// Trajectory and samples of a dive that goes out, and perhaps back and forward again.
pub struct Journey {
    reached: Vec<Reached>,
    /// Range of `reached` during the longest backward motion; an empty range at the end of `reached` if the vehicle
    /// never turned back.
    back: Range<usize>,
    /// Samples on the wall at the end of the dive. `turned` has the samples at the moment when the vehicle turned back.
    whole: Wall,
    turned: Option<Wall>,
    /// Time of the first packet on the log's clock, s.
    start_s: f64,
    end_s: f64,
}

impl Journey {
    /// Computes the heads' reach over a dive, and collects the dive's samples.
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
        let start_s = dive.report.dive.start_s;
        Self { reached, back, whole: wall_until(dive, MonoNs(u64::MAX)), turned, start_s, end_s }
    }

    /// Time at which the vehicle turned back, seconds; infinite if never.
    pub fn turned_back_s(&self) -> f64 {
        self.reached.get(self.back.start).map_or(f64::INFINITY, |reached| reached.at.as_secs_f64())
    }

    /// Time at which the vehicle went forward again after turning back, seconds; infinite if never.
    pub fn turned_on_s(&self) -> f64 {
        self.reached.get(self.back.end).map_or(f64::INFINITY, |reached| reached.at.as_secs_f64())
    }

    /// Whether a flagged section had already failed for good when the flag was raised.
    ///
    /// Only samples up to the moment of the flag count, because a vehicle that sways back may fill the circle later.
    pub fn was_due(&self, dive: &Dive, flag: &Flag, sd: f64) -> bool {
        let report = &dive.report;
        let section = report.sections.iter().find(|section| section.start_m >= flag.start_m);
        let Some((section, raised_s)) = section.zip(flag.raised_s) else { return false };
        let raised = MonoNs(math::round_to_i64(raised_s * 1e9).unsigned_abs());
        // The largest reach of several pings around the flag is used, because estimated positions and attitudes are
        // noisy.
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

    /// Due and actual flags of all sections of a dive. A section fails if its hole exceeds the target by `sd` standard
    /// deviations.
    pub fn flags(&self, dive: &Dive, sd: f64) -> Vec<Flag> {
        let target_m = dive.report.target_m;
        dive.report.sections.iter().map(|section| self.flag(target_m, section, sd)).collect()
    }

    fn flag(&self, target_m: f64, section: &SectionRow, sd: f64) -> Flag {
        let ends = [section.start_m, section.end_m];
        let radius_m = 0.5 * (target_m + sd * section.hole_sd_m);
        let due_m = |wall: &Wall, early_m: f64| {
            // For the earliest possible due moment, the tolerance `NEAR_M` is applied in the opposite direction.
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
        let raised_s = section.flagged_s.map(|time_s| self.start_s + time_s);
        let late_m = || {
            let raised_s = raised_s?;
            let before = |reached: &&Reached| reached.at.as_secs_f64() <= raised_s;
            // If the reach or the standard deviation jumps, the flag can be raised at the next tick at the earliest. A
            // delay of this length doesn't count as late.
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
            raised_s,
            cleared_s: section.cleared_s.map(|time_s| self.start_s + time_s),
            fails: self.whole.largest(ends[0], ends[1]).is_none_or(|circle| circle.radius_m > radius_m),
        }
    }
}
