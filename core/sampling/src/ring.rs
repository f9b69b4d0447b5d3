//! Points where a head's beams meet the wall, by ray casting for any profile and pose.
//!
//! The distance that the vehicle travels between two pings is neglected.

use serde::{Deserialize, Serialize};

use super::error::{SamplingError, positive};
use headrace_geometry::frames::{Mount, Point3, Pose, Rot, Sensor, Tunnel, Vec3, head_direction};
use headrace_geometry::math::{self, TAU};
use headrace_geometry::snapshot::stateful;
use headrace_geometry::tunnel::{Profile, WallHit};

/// A beam that meets no wall within this range counts as running along the tunnel, m.
const ALONG_M: f64 = 1000.0;

/// A head at rest in a straight tunnel; rays are cast from this head.
#[derive(Debug, Clone, Copy)]
pub struct Standing<'a> {
    profile: &'a Profile,
    head: Point3<Tunnel>,
    turn: Rot<Tunnel, Sensor>,
}

/// Point where a beam meets the wall.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sounding {
    /// Head angle, radians in the sensor's frame.
    pub angle_rad: f64,
    /// Vector from the head to the wall: chainage, left, up, m. The vector's length is the range.
    pub beam: Vec3<Tunnel>,
    /// Arc length of the point on the wall, m.
    pub arc_m: f64,
    /// Cosine of the angle of incidence: 1 at perpendicular incidence.
    pub squareness: f64,
}

/// Footprint of a beam on the wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Footprint {
    /// Extent of the footprint in the head's scan plane, along the unrolled wall, m.
    pub in_plane_m: f64,
    /// Extent of the footprint across the head's scan plane, m.
    pub across_m: f64,
}

impl<'a> Standing<'a> {
    /// Creates a head on a vehicle.
    ///
    /// Errors: a head outside the profile.
    pub fn new(profile: &'a Profile, pose: &Pose, mount: &Mount) -> Result<Self, SamplingError> {
        let head = pose.place(mount.position);
        let inside = head.is_finite() && profile.contains([head.y(), head.z()]);
        inside
            .then(|| Self { profile, head, turn: pose.attitude * mount.rotation })
            .ok_or(SamplingError::HeadOutside { y_m: head.y(), z_m: head.z() })
    }

    /// The profile's perimeter, m.
    pub fn perimeter_m(&self) -> f64 {
        self.profile.perimeter_m()
    }

    /// Returns the point where the beam at `angle_rad` (sensor frame) meets the wall.
    ///
    /// Errors: no wall within a kilometre along the beam.
    pub fn sounding(&self, angle_rad: f64) -> Result<Sounding, SamplingError> {
        self.sounding_along(angle_rad, head_direction(angle_rad))
    }

    /// Returns the same as [`Standing::sounding`], for a beam whose direction is already known.
    fn sounding_along(&self, angle_rad: f64, beam: Vec3<Sensor>) -> Result<Sounding, SamplingError> {
        let direction = self.turn * beam;
        let hit = self.hit(direction);
        let hit = hit.ok_or(SamplingError::BeamAlongTunnel { angle_deg: angle_rad.to_degrees() })?;
        let squareness = -(direction.y() * hit.normal[0] + direction.z() * hit.normal[1]);
        Ok(Sounding { angle_rad, beam: direction.scaled(hit.range_m), arc_m: hit.arc_m, squareness })
    }

    /// Footprint of a beam of full width `beam_rad` about `angle_rad`.
    ///
    /// In the scan plane, the footprint extends from one edge of the beam to the other along the unrolled wall. Across
    /// this plane, it extends between beams that are tilted ahead and astern by half the width.
    /// Errors: as for [`Standing::sounding`], for each edge of the beam; a width that isn't above zero.
    /// Source: Jorge et al. 2021, §9.2 and Fig. 15, for any wall.
    pub fn footprint(&self, angle_rad: f64, beam_rad: f64) -> Result<Footprint, SamplingError> {
        positive("the beam's width in radians", beam_rad)?;
        let half = beam_rad / 2.0;
        let (early, late) = (self.sounding(angle_rad - half)?, self.sounding(angle_rad + half)?);
        let (sine, cosine) = math::sin_cos(half);
        let tilted = |sign: f64| {
            let lean = Vec3::new(sign * sine, 0.0, 0.0) + head_direction(angle_rad).scaled(cosine);
            let direction = self.turn * lean;
            let hit = self.hit(direction);
            let hit = hit.ok_or(SamplingError::BeamAlongTunnel { angle_deg: angle_rad.to_degrees() })?;
            Ok(direction.scaled(hit.range_m))
        };
        let (ahead, behind) = (tilted(1.0)?, tilted(-1.0)?);
        Ok(Footprint {
            in_plane_m: early.step_m(&late, self.perimeter_m()),
            across_m: (ahead + -behind).norm(),
        })
    }

    fn hit(&self, direction: Vec3<Tunnel>) -> Option<WallHit> {
        let hit =
            self.profile.cast_from_inside([self.head.y(), self.head.z()], [direction.y(), direction.z()])?;
        (hit.range_m <= ALONG_M).then_some(hit)
    }
}

impl Sounding {
    /// Range from the head to the wall, m.
    pub fn range_m(&self) -> f64 {
        self.beam.norm()
    }

    /// Distance to another sounding of the same head on the unrolled wall, m.
    ///
    /// The distance follows the shorter way around the perimeter, like the diameter of a hole.
    pub fn step_m(&self, other: &Self, perimeter_m: f64) -> f64 {
        let around_m = math::wrap_signed(other.arc_m - self.arc_m, perimeter_m);
        math::hypot(other.beam.x() - self.beam.x(), around_m)
    }

    /// Straight-line distance to another sounding of the same head, m: T_y of Jorge et al. 2021.
    pub fn chord_m(&self, other: &Self) -> f64 {
        (other.beam + -self.beam).norm()
    }
}

/// Ray-cast soundings of a head's whole turn at equal angles, with reusable buffers.
#[derive(Debug, Clone, Default)]
pub struct Ring {
    soundings: Vec<Sounding>,
    /// Signed arc lengths from the first sounding to each sounding, m. The last entry is the arc length of the whole
    /// turn.
    ///
    /// Values are negative if the head turns in the direction of falling arc length.
    way_m: Vec<f64>,
    perimeter_m: f64,
    /// Angles and beam directions of the soundings, cached for the next cast.
    beams: Vec<(f64, Vec3<Sensor>)>,
    /// Stride of the cached `steps_m`. Each entry is the distance from a sounding to the one `stride` places later.
    ///
    /// Zero if no distances are cached.
    stride: usize,
    steps_m: Vec<f64>,
}

stateful!(Ring { state: perimeter_m, stride; lists: soundings, way_m, beams, steps_m; });

impl Ring {
    /// Casts a ring of `count` rays around a turn, the first at the angle `start_rad`.
    ///
    /// Errors: as for [`Standing::sounding`]; a count of zero.
    pub fn cast(standing: &Standing<'_>, start_rad: f64, count: u32) -> Result<Self, SamplingError> {
        let mut ring = Self::default();
        ring.recast(standing, start_rad, count)?;
        Ok(ring)
    }

    /// Recasts the ring in place; after an error the ring has no soundings.
    ///
    /// Errors: as for [`Ring::cast`].
    /// Allocates: not if the ring has had as many soundings before.
    pub fn recast(
        &mut self,
        standing: &Standing<'_>,
        start_rad: f64,
        count: u32,
    ) -> Result<(), SamplingError> {
        positive("the number of soundings", f64::from(count))?;
        self.perimeter_m = standing.perimeter_m();
        self.soundings.clear();
        self.way_m.clear();
        self.stride = 0;
        self.aim(start_rad, count);
        for (angle_rad, beam) in &self.beams {
            match standing.sounding_along(*angle_rad, *beam) {
                Ok(sounding) => self.soundings.push(sounding),
                Err(why) => {
                    self.soundings.clear();
                    return Err(why);
                }
            }
        }
        let mut way_m = 0.0;
        for (a, b) in self.soundings.iter().zip(self.soundings.iter().cycle().skip(1)) {
            self.way_m.push(way_m);
            way_m += math::wrap_signed(b.arc_m - a.arc_m, self.perimeter_m);
        }
        self.way_m.push(way_m);
        debug_assert!(
            self.is_closed(),
            "a turn goes round whole perimeters of {} m: {way_m} m",
            self.perimeter_m
        );
        // Reserves capacity for `keep_steps`, which must not allocate.
        self.steps_m.clear();
        self.steps_m.reserve(self.soundings.len());
        Ok(())
    }

    /// Whether the signed arc length of the whole turn is a multiple of the perimeter.
    fn is_closed(&self) -> bool {
        let rounds = self.way_round_m() / self.perimeter_m;
        (rounds - math::round_to_i64(rounds) as f64).abs() <= 1e-6
    }

    /// Computes the beam directions of a turn, unless the previous cast used the same directions.
    fn aim(&mut self, start_rad: f64, count: u32) {
        let from_rad = self.beams.first().map(|(angle_rad, _)| angle_rad.to_bits());
        if self.beams.len() == count as usize && from_rad == Some((start_rad + 0.0).to_bits()) {
            return;
        }
        let angle_rad = |k: u32| start_rad + TAU * (f64::from(k) / f64::from(count));
        self.beams.clear();
        self.beams.extend((0..count).map(angle_rad).map(|angle_rad| (angle_rad, head_direction(angle_rad))));
    }

    /// Caches the distances between soundings `stride` apart until the next cast.
    ///
    /// Allocates: not if the ring has had as many soundings before.
    pub fn keep_steps(&mut self, stride: usize) {
        if self.stride != stride {
            let mut steps_m = core::mem::take(&mut self.steps_m);
            steps_m.clear();
            steps_m.extend(self.steps_m(stride));
            (self.stride, self.steps_m) = (stride, steps_m);
        }
    }

    /// The distances cached by [`Ring::keep_steps`]; `None` if they were cached for another stride.
    pub fn kept_steps_m(&self, stride: usize) -> Option<&[f64]> {
        let is_kept = self.stride == stride;
        debug_assert!(
            !is_kept || self.steps_m.len() == self.soundings.len(),
            "there is a distance for each of {} soundings: {}",
            self.soundings.len(),
            self.steps_m.len()
        );
        is_kept.then_some(self.steps_m.as_slice())
    }

    /// Number of soundings per angular step of a head for `count` soundings per turn, rounded up; at least one.
    pub fn stride(step_rad: f64, count: u32) -> usize {
        let soundings = -math::floor_to_i64(-(step_rad * f64::from(count) / TAU - 1e-6));
        usize::try_from(soundings.clamp(1, i64::from(count.max(1)))).unwrap_or(1)
    }

    /// The profile's perimeter, m.
    pub fn perimeter_m(&self) -> f64 {
        self.perimeter_m
    }

    /// Signed arc length of a whole turn, m; negative if the head turns in the direction of falling arc length.
    pub fn way_round_m(&self) -> f64 {
        self.way_m.last().copied().unwrap_or(0.0)
    }

    /// The soundings of the ring, in order of angle.
    pub fn soundings(&self) -> &[Sounding] {
        &self.soundings
    }

    /// Pairs of soundings `stride` apart, including the pairs that close the turn.
    ///
    /// If a head pings only at every `stride`-th sounding, these pairs are its neighbouring pings.
    pub fn pairs(&self, stride: usize) -> impl Iterator<Item = (&Sounding, &Sounding)> {
        let count = self.soundings.len().max(1);
        self.soundings.iter().zip(self.soundings.iter().cycle().skip(stride % count))
    }

    /// T_y2 in general, m: the largest distance on the unrolled wall between soundings `stride` apart.
    ///
    /// The largest value for any angle of the first ping is used. Zero without soundings.
    ///
    /// Source: Jorge et al. 2021, Eq. 6, where its assumptions hold.
    pub fn largest_step_m(&self, stride: usize) -> f64 {
        self.steps_m(stride).fold(0.0, f64::max)
    }

    /// Distances on the unrolled wall from each sounding to the sounding `stride` places later, m.
    ///
    /// The distances follow the direction of rotation. With one ping per turn, the distance is the whole perimeter.
    pub fn steps_m(&self, stride: usize) -> impl Iterator<Item = f64> {
        let count = self.soundings.len().max(1);
        let whole_m = self.way_round_m();
        let way_m = |k: usize| self.way_m.get(k).copied().unwrap_or(0.0);
        let (turns, rest) = (stride / count, stride % count);
        self.pairs(stride).enumerate().map(move |(k, (a, b))| {
            let (to, turns) =
                if k + rest < count { (k + rest, turns) } else { (k + rest - count, turns + 1) };
            // The difference of two arc lengths has a smaller rounding error than the difference of two cumulative
            // lengths. The cumulative lengths only give the number of whole perimeters to add, which is mostly zero.
            let short_m = math::wrap_signed(b.arc_m - a.arc_m, self.perimeter_m);
            let round_m = way_m(to) + whole_m * turns as f64 - way_m(k) - short_m;
            let rounds = if round_m.abs() < 0.4 * self.perimeter_m {
                0
            } else {
                math::round_to_i64(round_m / self.perimeter_m)
            };
            math::hypot(b.beam.x() - a.beam.x(), short_m + rounds as f64 * self.perimeter_m)
        })
    }

    /// Smallest, mean and largest straight-line distance between soundings `stride` places apart, m; zeros without
    /// soundings.
    pub fn chords_m(&self, stride: usize) -> [f64; 3] {
        let chords = || self.pairs(stride).map(|(a, b)| a.chord_m(b));
        let count = self.soundings.len();
        if count == 0 {
            return [0.0; 3];
        }
        [
            chords().fold(f64::INFINITY, f64::min),
            chords().sum::<f64>() / count as f64,
            chords().fold(0.0, f64::max),
        ]
    }

    /// The longest range to the wall in the turn, m; zero without soundings.
    pub fn longest_range_m(&self) -> f64 {
        self.soundings.iter().map(Sounding::range_m).fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests;
