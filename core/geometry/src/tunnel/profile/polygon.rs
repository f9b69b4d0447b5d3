//! A tunnel profile made from surveyed points.

use super::closed_curve::{Profile, ProfileError, SAME_POINT_M};
use super::element::Piece;
use super::plane::{Yz, cross, norm, sub};

impl Profile {
    /// Creates a polygon through `points`, in clockwise or counter-clockwise order.
    ///
    /// Arc length begins at the lowest crossing of y = 0. `reference` defaults to the polygon's centroid.
    ///
    /// Errors: see [`ProfileError`]. Its vertices are indices into `points`. Allocates: startup only.
    pub fn polygon(points: &[Yz], reference: Option<Yz>) -> Result<Self, ProfileError> {
        if let Some(vertex) = points.iter().position(|p| !p.iter().all(|c| c.abs() <= 1000.0)) {
            return Err(ProfileError::NotFinite { vertex });
        }
        let mut ring = distinct(points);
        if ring.len() < 3 {
            return Err(ProfileError::TooFewPoints { count: ring.len() });
        }
        let (area, centroid) = area_and_centroid(&ring);
        if area < 0.0 {
            ring.reverse();
        }
        let (edge, start) = floor_centre(&ring).ok_or(ProfileError::BesideMiddle)?;
        let count = ring.len();
        // The profile's curve starts on the edge that crosses y = 0.
        let vertex = |k: usize| ring.get((edge + k) % count);
        let pieces: Vec<Piece> = (1..=count).filter_map(vertex).map(|v| Piece::LineTo(v.point)).collect();
        Self::new(start, &pieces, reference.unwrap_or(centroid)).map_err(|error| match error {
            ProfileError::NotStarShaped { vertex: piece, reference } => {
                // A piece begins where the piece before it ends. The first one begins within the edge that crosses y =
                // 0, so it counts as that edge.
                let index = vertex(piece).map_or(0, |begin| begin.index);
                ProfileError::NotStarShaped { vertex: index, reference }
            }
            other => other,
        })
    }
}

/// A surveyed point with its index in the input.
#[derive(Debug, Clone, Copy)]
struct Vertex {
    index: usize,
    point: Yz,
}

/// Removes points that repeat their predecessor. The predecessor of the first point is the last point.
fn distinct(points: &[Yz]) -> Vec<Vertex> {
    let mut ring: Vec<Vertex> = Vec::with_capacity(points.len());
    for (index, point) in points.iter().copied().enumerate() {
        if ring.last().is_none_or(|last| norm(sub(point, last.point)) > SAME_POINT_M) {
            ring.push(Vertex { index, point });
        }
    }
    while let (Some(first), Some(last)) = (ring.first(), ring.last())
        && ring.len() > 1
        && norm(sub(first.point, last.point)) <= SAME_POINT_M
    {
        ring.pop();
    }
    ring
}

/// The edges of a closed polygon.
fn edges(ring: &[Vertex]) -> impl Iterator<Item = (Yz, Yz)> + '_ {
    ring.iter().zip(ring.iter().cycle().skip(1)).map(|(from, to)| (from.point, to.point))
}

/// Signed area and centroid of a polygon.
fn area_and_centroid(ring: &[Vertex]) -> (f64, Yz) {
    let origin = ring.first().map_or([0.0; 2], |first| first.point);
    let (mut area2, mut sum) = (0.0, [0.0, 0.0]);
    for (a, b) in edges(ring) {
        let (a, b) = (sub(a, origin), sub(b, origin));
        let w = cross(a, b);
        area2 += w;
        sum = [sum[0] + w * (a[0] + b[0]), sum[1] + w * (a[1] + b[1])];
    }
    let centroid = if area2 == 0.0 {
        origin
    } else {
        [origin[0] + sum[0] / (3.0 * area2), origin[1] + sum[1] / (3.0 * area2)]
    };
    (area2 / 2.0, centroid)
}

/// Finds the lowest crossing of y = 0.
///
/// Returns the crossing, and the index of the first point of the edge on which it lies.
fn floor_centre(ring: &[Vertex]) -> Option<(usize, Yz)> {
    let crossing = |(index, (a, b)): (usize, (Yz, Yz))| {
        if (a[0] <= 0.0) == (b[0] <= 0.0) {
            return None;
        }
        let share = -a[0] / (b[0] - a[0]);
        Some((index, [0.0, a[1] + share * (b[1] - a[1])]))
    };
    edges(ring).enumerate().filter_map(crossing).min_by(|a, b| a.1[1].total_cmp(&b.1[1]))
}
