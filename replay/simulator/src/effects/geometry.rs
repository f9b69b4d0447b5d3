//! Directions relative to a beam, and reflection at a wall.

use headrace_geometry::frames::{Tunnel, Vec3};
use headrace_geometry::math;

/// A beam counts as parallel to the tunnel if the component of its direction along the tunnel is larger than this
/// value.
const ALONG: f64 = 0.9;

/// Scalar product of two vectors.
pub(super) fn dot(a: Vec3<Tunnel>, b: Vec3<Tunnel>) -> f64 {
    a.0.dot(&b.0)
}

/// Two unit vectors perpendicular to a beam's direction and to each other.
///
/// The first vector is as nearly along the tunnel as possible. The second vector is across the tunnel. It lies in the
/// plane in which a head turns whose axis is along the tunnel. For a beam along the tunnel, the first vector is as
/// nearly upwards as possible.
pub(super) fn square_to(direction: Vec3<Tunnel>) -> [Vec3<Tunnel>; 2] {
    let along = direction.x().abs() > ALONG;
    let towards = if along { Vec3::new(0.0, 0.0, 1.0) } else { Vec3::new(1.0, 0.0, 0.0) };
    let rest = towards + direction.scaled(-dot(towards, direction));
    let first = rest.scaled(1.0 / rest.norm());
    let second = direction.0.cross(&first.0);
    [first, Vec3::new(second.x, second.y, second.z)]
}

/// Cosine of the incidence of a beam on a wall: 0 along the wall, 1 perpendicular to the wall.
///
/// `normal` is a unit vector towards the water.
pub(super) fn squareness(direction: Vec3<Tunnel>, normal: Vec3<Tunnel>) -> f64 {
    (-dot(direction, normal)).clamp(0.0, 1.0)
}

/// Direction of a beam after specular reflection.
pub(super) fn mirrored(direction: Vec3<Tunnel>, normal: Vec3<Tunnel>) -> Vec3<Tunnel> {
    direction + normal.scaled(-2.0 * dot(direction, normal))
}

/// Angle between two non-zero vectors of any length, radians, in [0, pi].
pub(super) fn between_rad(a: Vec3<Tunnel>, b: Vec3<Tunnel>) -> f64 {
    math::atan2(a.0.cross(&b.0).norm(), dot(a, b))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn perpendicular_vectors_include_one_in_the_plane_of_turning() {
        for k in 0..50 {
            let (a, b) = (f64::from(k) * 0.7, f64::from(k) * 0.31);
            let ((sa, ca), (sb, cb)) = (math::sin_cos(a), math::sin_cos(b));
            let direction = Vec3::new(sb, ca * cb, sa * cb);
            let [u, v] = square_to(direction);
            for (p, q, product) in
                [(u, u, 1.0), (v, v, 1.0), (u, v, 0.0), (u, direction, 0.0), (v, direction, 0.0)]
            {
                assert!((dot(p, q) - product).abs() < 1e-14, "{direction:?}");
            }
        }
        let [u, v] = square_to(Vec3::new(0.0, 1.0, 0.0));
        assert_eq!((u, v), (Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 0.0, -1.0)));
    }

    #[test]
    fn mirrored_beam_keeps_its_length_and_incidence() {
        let (direction, normal) = (Vec3::new(0.0, 0.6, -0.8), Vec3::new(0.0, 0.0, 1.0));
        assert_eq!(mirrored(direction, normal), Vec3::new(0.0, 0.6, 0.8));
        assert!((squareness(direction, normal) - 0.8).abs() < 1e-15);
        assert!(
            (between_rad(direction, mirrored(direction, normal)) - 2.0 * math::atan2(0.8, 0.6)).abs() < 1e-15
        );
    }
}
