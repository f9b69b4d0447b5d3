//! The vehicle's smoothed trajectory, and navigation along it.

use core::ops::Range;

use super::step::Placed;
use crate::filter::pose_sd::PoseSd;
use crate::filter::sources::Consistency;
use crate::filter::state::{State, rotation, rotation_vector};
use crate::filter::{CARRIES, CLOCK_JUMP};
use crate::relative::Relative;
use crate::{Fix, Navigation, NoFix, Times};
use headrace_geometry::frames::{Body, Pose, Vec3};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::device::SensorInfo;
use headrace_sensor::reading::MAX_SOURCES;
use headrace_sensor::reading::Reading;
use headrace_snapshot::stateful;

/// State of the inertial unit at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Point {
    at: MonoNs,
    pose: Pose,
    speed_mps: f64,
    sd: PoseSd,
}

/// A contiguous span of the track.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Piece {
    clock: u32,
    unit_at: Vec3<Body>,
    points: Range<usize>,
    relatives: Range<usize>,
}

/// See the module's description.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Track {
    pieces: Vec<Piece>,
    points: Vec<Point>,
    relatives: Vec<(MonoNs, Relative)>,
    /// Length of the filter's epochs: so far beyond its last point it goes.
    epoch: DurNs,
}

impl Point {
    pub(super) fn of(at: MonoNs, state: &State, sd: &PoseSd) -> Self {
        let pose = Pose { position: state.position, attitude: state.attitude };
        Self { at, pose, speed_mps: state.velocity_mps.x(), sd: *sd }
    }
}

impl Piece {
    /// Begins at these counts of points and relatives, in reverse order.
    pub(super) fn begin(placed: &Placed, points: usize, relatives: usize) -> Self {
        Self {
            clock: placed.clock,
            unit_at: placed.unit_at,
            points: points..points,
            relatives: relatives..relatives,
        }
    }

    pub(super) fn end(&mut self, points: usize, relatives: usize) {
        (self.points.end, self.relatives.end) = (points, relatives);
    }
}

impl Track {
    /// From pieces, points and relatives in reverse order.
    pub(super) fn of_reversed(
        mut pieces: Vec<Piece>,
        mut points: Vec<Point>,
        mut relatives: Vec<(MonoNs, Relative)>,
        epoch: DurNs,
    ) -> Self {
        points.reverse();
        relatives.reverse();
        pieces.reverse();
        let turned = |range: &Range<usize>, len: usize| len - range.end..len - range.start;
        for piece in &mut pieces {
            piece.points = turned(&piece.points, points.len());
            piece.relatives = turned(&piece.relatives, relatives.len());
        }
        Self { pieces, points, relatives, epoch }
    }

    /// Number of pieces: one more than of breaks.
    pub fn pieces(&self) -> usize {
        self.pieces.len()
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether it has no points.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Fix at time `at` of the clock after it had been set back `clock` times.
    ///
    /// Errors: the part that isn't known well enough there.
    pub fn fix(&self, clock: u32, at: MonoNs) -> Result<Fix, NoFix> {
        let begun = |piece: &&Piece| {
            piece.clock == clock && self.points_of(piece).first().is_some_and(|first| first.at <= at)
        };
        let piece = self.pieces.iter().rev().find(begun).ok_or(NoFix::Heading)?;
        let points = self.points_of(piece);
        // Beyond the last point, the last leg is extrapolated.
        let next = points.partition_point(|point| point.at <= at).min(points.len().saturating_sub(1));
        let (before, after) = (points.get(next.saturating_sub(1)), points.get(next));
        let (before, after) = before.zip(after).ok_or(NoFix::Heading)?;
        let span = after.at.since(before.at);
        if span.0 > CARRIES.0 || at.since(after.at).0 > self.epoch.0 {
            return Err(NoFix::Heading);
        }
        let share = if span.0 > 0 { at.since(before.at).as_secs_f64() / span.as_secs_f64() } else { 1.0 };
        let relative = self.relative(piece, at);
        before.sd.standing(relative)?;
        after.sd.standing(relative)?;
        let pose = between(&before.pose, &after.pose, share);
        let arm = pose.attitude * -piece.unit_at;
        let speed_mps = before.speed_mps + (after.speed_mps - before.speed_mps) * share;
        let pose = Pose { position: pose.position + arm, attitude: pose.attitude };
        let tie = u32::try_from(piece.points.start).unwrap_or(u32::MAX);
        let [relative, revisit] = [relative, before.sd.independent()].map(|of| of.moved(arm));
        Ok(Fix { pose, speed_mps, relative, revisit, tie, settled: 0 })
    }

    fn points_of(&self, piece: &Piece) -> &[Point] {
        self.points.get(piece.points.clone()).unwrap_or_default()
    }

    /// Covariance relative to the heads' previous pass, interpolated linearly in time.
    fn relative(&self, piece: &Piece, at: MonoNs) -> Relative {
        let known = self.relatives.get(piece.relatives.clone()).unwrap_or_default();
        let next = known.partition_point(|(moment, _)| *moment <= at);
        match (next.checked_sub(1).and_then(|before| known.get(before)), known.get(next)) {
            (Some((from, before)), Some((to, after))) => {
                let share = at.since(*from).as_secs_f64() / to.since(*from).as_secs_f64();
                before.weighted(1.0 - share, after, share)
            }
            (before, after) => before.or(after).map_or_else(Relative::default, |(_, relative)| *relative),
        }
    }
}

/// The pose interpolated by `share` from one to another, or extrapolated.
fn between(from: &Pose, to: &Pose, share: f64) -> Pose {
    let turn = rotation_vector(to.attitude * from.attitude.inverse());
    Pose {
        position: from.position + (to.position - from.position).scaled(share),
        attitude: rotation(turn.scaled(share)) * from.attitude,
    }
}

/// Navigation along a track, independent of the readings.
pub struct TrackNavigation {
    track: Track,
    consistency: [Option<Consistency>; MAX_SOURCES],
    clock: u32,
    received: MonoNs,
}

stateful!(TrackNavigation { state: clock, received; slots: consistency; fixed: track; });

impl TrackNavigation {
    /// Along a track made by a filter, with the innovation statistics of its sources.
    pub fn new(track: Track, consistency: [Option<Consistency>; MAX_SOURCES]) -> Self {
        Self { track, consistency, clock: 0, received: MonoNs(0) }
    }
}

impl Navigation for TrackNavigation {
    fn update(&mut self, _: usize, _: &SensorInfo, times: Times, _: &Reading) {
        // Counted as in the filter.
        if self.received.since(times.received) > CLOCK_JUMP {
            self.clock = self.clock.saturating_add(1);
            self.received = times.received;
        }
        self.received = self.received.max(times.received);
    }

    fn consistency(&self, source: usize) -> Option<Consistency> {
        self.consistency.get(source).copied().flatten()
    }

    fn fix(&self, at: MonoNs) -> Result<Fix, NoFix> {
        // The fix of the first ping after the clock was set back is requested before the reset is known.
        if self.received.since(at) > CLOCK_JUMP {
            return Err(NoFix::Heading);
        }
        self.track.fix(self.clock, at)
    }
}
