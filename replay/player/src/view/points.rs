//! Samples as clouds of points, half a second of them in one.

use headrace_geometry::time::{DurNs, MonoNs};

use super::messages::{Field, PointCloud, Pose, Turn, Xyz, base64, rounded};
use super::site::TUNNEL;

/// A cloud holds samples of so long a time.
const SPAN: DurNs = DurNs(500_000_000);
/// And no more than these.
const MOST_POINTS: usize = 4096;
/// A point: three floats. The head's number is in the first byte of x, whose least bits these are; they were zeros, and a
/// viewer that takes them for part of x is off by some micrometres. A stride that is no multiple of three would
/// compress a seventh worse in base64.
const STRIDE: usize = 12;
const FIELDS: [Field; 4] =
    [Field::float("x", 0), Field::float("y", 4), Field::float("z", 8), Field::byte("head", 0)];
/// Places are rounded to this part of a metre, 4 mm: finer than samples are known. The lower half of a float's bits are then
/// zeros, which take little room in the log.
const PARTS_PER_M: f64 = 256.0;
/// Farther from the origin of its cloud than this, m, a point has fewer zeros, and isn't shown.
const FARTHEST_M: f64 = 128.0;

/// Points that are gathered.
#[derive(Debug, Default)]
pub(super) struct Points {
    began: Option<MonoNs>,
    /// Chainage that points are told from, m: floats of seven kilometres would be coarse.
    origin_m: f64,
    data: Vec<u8>,
}

impl Points {
    /// Takes a sample of a head in, received at a moment. Gives the cloud that was full, or too old for it.
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

    /// Gives the cloud when it is too old for a moment, or the clock was set back.
    pub(super) fn close_before(&mut self, at: MonoNs) -> Option<PointCloud> {
        let age = at.since(self.began?).0;
        if (0..SPAN.0).contains(&age) { None } else { self.close() }
    }

    /// Gives what has been gathered.
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
