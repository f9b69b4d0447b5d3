//! Collects samples into point clouds of half a second.

use headrace_geometry::time::{DurNs, MonoNs};

use super::messages::{Field, PointCloud, Pose, Turn, Xyz, base64, rounded};
use super::site::TUNNEL;

/// Maximum time span of a point cloud.
const SPAN: DurNs = DurNs(500_000_000);
/// Maximum number of points in a point cloud.
const MOST_POINTS: usize = 4096;
/// Length of a point, bytes: three floats.
///
/// Rounding makes the least significant byte of x zero, so that byte holds the head number. A viewer that reads this
/// byte as part of x shows x wrong by some micrometres. If the head number had a byte of its own, the stride would be
/// 13 bytes. Base64 encodes groups of three bytes, so points would no longer align with groups, and the compressed text
/// would be a seventh longer.
const STRIDE: usize = 12;
const FIELDS: [Field; 4] =
    [Field::float("x", 0), Field::float("y", 4), Field::float("z", 8), Field::byte("head", 0)];
/// Steps per metre to which coordinates are rounded. A step of 4 mm is finer than the samples' accuracy.
///
/// The lower half of each float is then zero and compresses well.
const PARTS_PER_M: f64 = 256.0;
/// Maximum distance of a point from the cloud's origin, m. Farther points are dropped, because they have fewer zero
/// bits.
const FARTHEST_M: f64 = 128.0;

/// Points of the current point cloud.
#[derive(Debug, Default)]
pub(super) struct Points {
    began: Option<MonoNs>,
    /// Chainage of the cloud's origin, m. Points are relative to the origin, because a 32-bit float is too coarse for
    /// chainages of several kilometres.
    origin_m: f64,
    data: Vec<u8>,
}

impl Points {
    /// Adds a sample of a head, received at `at`. If the current cloud is full, or too old for the sample, first
    /// returns that cloud and begins another.
    pub(super) fn add(&mut self, at: MonoNs, head: u8, [x_m, y_m, z_m]: [f64; 3]) -> Option<PointCloud> {
        let full = if self.data.len() >= MOST_POINTS * STRIDE { self.close() } else { self.close_before(at) };
        if self.began.is_none() {
            (self.began, self.origin_m) = (Some(at), rounded(x_m, 1.0));
        }
        let place = [x_m - self.origin_m, y_m, z_m];
        if place.iter().all(|of| of.abs() < FARTHEST_M) {
            let [x, y, z] = place.map(|of| float(rounded(of, PARTS_PER_M)).to_le_bytes());
            let [_, x1, x2, x3] = x;
            self.data.extend([head, x1, x2, x3].into_iter().chain(y).chain(z));
        }
        full
    }

    /// Returns the current cloud if it is too old at `at`, or if the clock was set back.
    pub(super) fn close_before(&mut self, at: MonoNs) -> Option<PointCloud> {
        let age = at.since(self.began?).0;
        if (0..SPAN.0).contains(&age) { None } else { self.close() }
    }

    /// Returns the current point cloud, and begins another.
    pub(super) fn close(&mut self) -> Option<PointCloud> {
        let began = self.began.take()?;
        let data = base64(&self.data);
        self.data.clear();
        Some(PointCloud {
            timestamp: began.into(),
            frame_id: TUNNEL,
            pose: Pose { position: Xyz::new([self.origin_m, 0.0, 0.0]), orientation: Turn::NONE },
            point_stride: STRIDE,
            fields: &FIELDS,
            data,
        })
    }
}

#[expect(clippy::cast_possible_truncation, reason = "places near the origin, in steps that a float has")]
fn float(value: f64) -> f32 {
    value as f32
}
