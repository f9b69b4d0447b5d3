//! The vehicle's smoothed trajectory, and navigation along it.

use core::ops::Range;

use super::step::Placed;
use crate::filter::pose_sd::PoseSd;
use crate::filter::sources::Consistency;
use crate::filter::state::{State, rotation, rotation_vector};
use crate::filter::{CARRIES, CLOCK_JUMP};
use crate::fix::{Fix, NoFix, Times};
use crate::navigation::Navigation;
use crate::relative::Relative;
use headrace_geometry::frames::{Body, Pose, Vec3};
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::device::SensorInfo;
use headrace_sensor::reading::{MAX_SOURCES, Reading};

/// State of the inertial unit at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Point {
    at: MonoNs,
    pose: Pose,
    speed_mps: f64,
    sd: PoseSd,
}

/// A part of the track without a missing estimate.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Piece {
    clock: u32,
    unit_at: Vec3<Body>,
    points: Range<usize>,
    relatives: Range<usize>,
}

/// The vehicle's smoothed trajectory.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Track {
    pieces: Vec<Piece>,
    points: Vec<Point>,
    relatives: Vec<(MonoNs, Relative)>,
    /// Length of the filter's epochs. Each piece of the track extends this far beyond its last point.
    epoch: DurNs,
}

impl Point {
    pub(super) fn of(at: MonoNs, state: &State, sd: &PoseSd) -> Self {
        let pose = Pose { position: state.position, attitude: state.attitude };
        Self { at, pose, speed_mps: state.velocity_mps.x(), sd: *sd }
    }
}

impl Piece {
    /// Begins a piece of a track that is built in reverse order. `points` and `relatives` count what the track has so
    /// far.
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
    /// Builds the track from pieces, points and relative covariances, all in reverse order.
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
        let track = Self { pieces, points, relatives, epoch };
        debug_assert!(track.is_divided(), "pieces divide {} points: {:?}", track.points.len(), track.pieces);
        track
    }

    /// Whether each point belongs to exactly one piece, and the pieces are in order.
    fn is_divided(&self) -> bool {
        let begins = self.pieces.iter().map(|piece| piece.points.start).chain([self.points.len()]);
        let ends = [0].into_iter().chain(self.pieces.iter().map(|piece| piece.points.end));
        begins.eq(ends)
    }

    /// Number of pieces, which is one more than the number of breaks.
    pub fn pieces(&self) -> usize {
        self.pieces.len()
    }

    /// Number of points on the track.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether the track has no points.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Returns the fix at time `at`. `clock` is the number of times that the clock has been set back before `at`.
    ///
    /// Errors: the part of the fix that is too uncertain or missing at time `at`.
    pub fn fix(&self, clock: u32, at: MonoNs) -> Result<Fix, NoFix> {
        let begun = |piece: &&Piece| {
            piece.clock == clock && self.points_of(piece).first().is_some_and(|first| first.at <= at)
        };
        let piece = self.pieces.iter().rev().find(begun).ok_or(NoFix::Heading)?;
        let points = self.points_of(piece);
        // After the last point, the pose is extrapolated from the last two points.
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
        let points = self.points.get(piece.points.clone());
        debug_assert!(points.is_some(), "{piece:?} has some of {} points", self.points.len());
        points.unwrap_or_default()
    }

    /// Covariance relative to the previous pass of the heads, interpolated linearly in time.
    fn relative(&self, piece: &Piece, at: MonoNs) -> Relative {
        let known = self.relatives.get(piece.relatives.clone());
        debug_assert!(known.is_some(), "{piece:?} has some of {} covariances", self.relatives.len());
        let known = known.unwrap_or_default();
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

/// Interpolates between two poses by `share`, or extrapolates if `share` is above 1.
fn between(from: &Pose, to: &Pose, share: f64) -> Pose {
    let turn = rotation_vector(to.attitude * from.attitude.inverse());
    Pose {
        position: from.position + (to.position - from.position).scaled(share),
        attitude: rotation(turn.scaled(share)) * from.attitude,
    }
}

/// Navigation that takes its fixes from a smoothed track instead of from readings.
pub struct TrackNavigation {
    track: Track,
    consistency: [Option<Consistency>; MAX_SOURCES],
    clock: u32,
    received: MonoNs,
}

stateful!(TrackNavigation { state: clock, received; slots: consistency; fixed: track; });

impl TrackNavigation {
    /// Creates navigation along a track. `consistency` holds the innovation statistics of the filter's sources.
    pub fn new(track: Track, consistency: [Option<Consistency>; MAX_SOURCES]) -> Self {
        Self { track, consistency, clock: 0, received: MonoNs(0) }
    }
}

impl Navigation for TrackNavigation {
    fn update(&mut self, _: usize, _: &SensorInfo, times: Times, _: &Reading) {
        // Clock resets are counted by the same rule as in the filter, so that the counts agree.
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
        // After a clock reset, a ping may need a fix before a reading with the new time has arrived. It gets none.
        if self.received.since(at) > CLOCK_JUMP {
            return Err(NoFix::Heading);
        }
        self.track.fix(self.clock, at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_geometry::frames::{Point3, Rot, Tunnel};
    use headrace_geometry::math;

    /// Position of the inertial unit, ahead of the vehicle's origin.
    fn unit_at() -> Vec3<Body> {
        Vec3::new(0.3, 0.0, 0.0)
    }

    fn at(t: f64) -> MonoNs {
        MonoNs(50_000_000_000) + DurNs::from_secs_f64(t)
    }

    fn turned(yaw_rad: f64) -> Rot<Tunnel, Body> {
        let turn: Rot<Tunnel, Tunnel> = rotation(Vec3::new(0.0, 0.0, yaw_rad));
        turn * Rot::identity()
    }

    /// Point on a piece of the track, `t` seconds after the piece begins. The vehicle moves along the tunnel at 0.5
    /// m/s, and turns left at 0.2 rad/s.
    ///
    /// The speed stored in the point grows by 0.1 m/s per second instead, to test its interpolation.
    fn point(t: f64, from_x_m: f64) -> Point {
        let mut state = State::at_rest(Point3::new(from_x_m + 0.5 * t, 1.0, 2.0), turned(0.2 * t));
        state.velocity_mps = Vec3::new(0.4 + 0.1 * t, 0.0, 0.0);
        Point::of(at(t), &state, &PoseSd { along_m: 0.1, place_m: 0.05, tilt_rad: 0.01, yaw_rad: 0.02 })
    }

    /// Track of three pieces. Two are on the first clock, from 0 s and from 10 s on. The third is on the clock after a
    /// reset, from 1 s on.
    ///
    /// For the first piece, the relative covariance is given at 0 s and at 2 s.
    fn track() -> Track {
        let drives =
            [(0, 0.0, vec![0.0, 1.0, 2.0]), (0, 100.0, vec![10.0, 11.0, 14.0]), (1, 200.0, vec![1.0, 2.0])];
        let (mut pieces, mut points, mut relatives) = (Vec::new(), Vec::new(), Vec::new());
        for (clock, from_x_m, times) in drives.iter().rev() {
            let begun = (points.len(), relatives.len());
            points.extend(times.iter().rev().map(|t| point(*t, *from_x_m)));
            if *from_x_m < 50.0 {
                relatives.extend([(at(2.0), Relative::along(0.2)), (at(0.0), Relative::along(0.1))]);
            }
            pieces.push(Piece {
                clock: *clock,
                unit_at: unit_at(),
                points: begun.0..points.len(),
                relatives: begun.1..relatives.len(),
            });
        }
        Track::of_reversed(pieces, points, relatives, DurNs(100_000_000))
    }

    #[test]
    fn track_interpolates_between_points_and_extends_by_one_epoch() {
        let track = track();
        for t in [0.0, 0.25, 0.5, 1.0, 1.7, 2.0, 2.09] {
            let fix = track.fix(0, at(t)).unwrap();
            assert!((fix.speed_mps - (0.4 + 0.1 * t)).abs() < 1e-9, "{t}: {}", fix.speed_mps);
            // The inertial unit is ahead of the vehicle's origin, in the direction of its heading.
            let (ahead_m, aside_m) = (0.3 * math::cos(0.2 * t), 0.3 * math::sin(0.2 * t));
            let place = fix.pose.position;
            let off_m = [place.x() - (0.5 * t - ahead_m), place.y() - (1.0 - aside_m), place.z() - 2.0];
            assert!(off_m.iter().all(|off_m| off_m.abs() < 1e-9), "{t}: {place:?}");
            assert!(rotation_vector(fix.pose.attitude * turned(0.2 * t).inverse()).norm() < 1e-9, "{t}");
            // In the first piece, the relative variance grows from 0.01 to 0.04 m^2.
            let variance_m2 = 0.01 + 0.015 * t.min(2.0);
            assert!((fix.relative.sd_m(Vec3::zero()) - math::sqrt(variance_m2)).abs() < 1e-9, "{t}");
            // At the inertial unit, the errors of the two visits are independent and equally large.
            let revisit_m = fix.revisit.sd_m(fix.pose.attitude * unit_at());
            assert!((revisit_m - 0.1 * math::sqrt(2.0)).abs() < 1e-9, "{t}: {revisit_m}");
        }
    }

    #[test]
    fn time_outside_every_piece_of_the_track_has_no_fix() {
        let track = track();
        let no_fix_at = |clock: u32, t: f64| track.fix(clock, at(t)).err();
        for (clock, t) in
            [(0, -0.01), (0, 2.11), (0, 9.99), (0, 12.0), (0, 14.11), (1, 0.5), (1, 10.5), (2, 1.0)]
        {
            assert_eq!(no_fix_at(clock, t), Some(NoFix::Heading), "{clock} {t}");
        }
        let at_x_m = |clock: u32, t: f64| {
            let fix = track.fix(clock, at(t)).unwrap();
            (fix.tie, (fix.pose.position + fix.pose.attitude * unit_at()).x())
        };
        for (clock, t, tie, x_m) in [(0, 1.5, 0, 0.75), (0, 10.5, 3, 105.25), (1, 1.5, 6, 200.75)] {
            let (of, is_m) = at_x_m(clock, t);
            assert!(of == tie && (is_m - x_m).abs() < 1e-9, "{clock} {t}: {of} {is_m}");
        }
        assert_eq!((track.pieces(), track.len(), track.is_empty()), (3, 8, false));
        let none = Track::default();
        assert_eq!((none.pieces(), none.len(), none.is_empty()), (0, 0, true));
    }

    /// A reading over 10 s older than the newest one means that the clock was set back. Then fixes come from the piece
    /// of the track on the new clock.
    #[test]
    fn track_navigation_uses_the_new_piece_after_a_clock_reset() {
        let mut navigation = TrackNavigation::new(track(), [None; MAX_SOURCES]);
        let mut hear = |t: f64| {
            let times = Times { received: at(t), valid: at(t) };
            navigation.update(0, &SensorInfo::other(), times, &Reading::AngularRate(Vec3::zero()));
            [1.5, 10.5].map(|t| navigation.fix(at(t)).map_or(-1.0, |fix| fix.pose.position.x() - 0.5 * t))
        };
        let is = |found: [f64; 2], drives: [f64; 2]| {
            // The vehicle's origin is at most 0.3 m behind the inertial unit.
            found.iter().zip(drives).all(|(found, drive)| (found - drive).abs() <= 0.3 + 1e-9)
        };
        let none = -1.0;
        assert!(is(hear(1.5), [0.0, 100.0]));
        assert!(is(hear(10.6), [0.0, 100.0]));
        assert!(is(hear(2.0), [0.0, 100.0]), "a reading less than 10 s late belongs to the same clock");
        assert!(is(hear(11.4), [0.0, 100.0]));
        assert!(is(hear(11.6), [none, 100.0]), "a ping 10 s in the past is from another clock");
        assert!(is(hear(1.4), [200.0, none]), "the clock was set back");
    }
}
