//! Distances from the wall to a surface.

use headrace_geometry::math;
use headrace_geometry::tunnel::Profile;

use super::{MeshIndex, Xyz};
use crate::Spread;

/// A stretch of wall, evaluated on a lattice of positions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Stretch {
    /// Chainage of the start of the stretch, m.
    pub from_m: f64,
    /// Chainage of the end of the stretch, m.
    pub to_m: f64,
    /// Lattice spacing along the tunnel and around it, m; above 0.
    ///
    /// The paper (Jorge et al. 2021) doesn't state its spacing. A spacing of 0.1 m is fine compared with a beam's step.
    /// A spacing of 0.2 m gives the same figures four times as fast.
    pub step_m: f64,
}

impl Stretch {
    /// Chainages and arc lengths of the lattice's positions, in the order of chainage.
    ///
    /// Chainages are whole steps from `from_m`. Around the wall, positions are evenly spaced by about one step.
    pub(crate) fn places(&self, perimeter_m: f64) -> impl Iterator<Item = (f64, f64)> + use<> {
        let Self { from_m, to_m, step_m } = *self;
        let along = math::floor_to_i64((to_m - from_m) / step_m + 1e-9).max(-1);
        let round = math::round_to_i64(perimeter_m / step_m).max(1);
        (0..=along).flat_map(move |i| {
            (0..round).map(move |k| (from_m + i as f64 * step_m, k as f64 / round as f64 * perimeter_m))
        })
    }
}

/// The position at a chainage and arc length on a displaced wall.
///
/// `deviation_m` is the displacement from the design along the ray from the reference point, outwards positive.
pub(crate) fn place(profile: &Profile, x_m: f64, arc_m: f64, deviation_m: f64) -> Xyz {
    let (centre, wall) = (profile.reference(), profile.point_at(arc_m));
    let out = [wall[0] - centre[0], wall[1] - centre[1]];
    let scale = 1.0 + deviation_m / math::hypot(out[0], out[1]);
    [x_m, centre[0] + scale * out[0], centre[1] + scale * out[1]]
}

/// Absolute distances from positions on the true wall to a surface. `reference` returns the true wall's deviation from
/// the design at (x, arc length), m.
pub(crate) fn from_wall(
    profile: &Profile,
    surface: &MeshIndex<'_>,
    stretch: &Stretch,
    reference: impl Fn(f64, f64) -> f64,
) -> Spread {
    let places = stretch.places(profile.perimeter_m());
    Spread::of(places.map(|(x, sigma)| surface.distance_m(place(profile, x, sigma, reference(x, sigma)))))
}

#[cfg(test)]
mod tests {
    use headrace_geometry::tunnel::shapes;

    use super::super::Mesh;
    use super::*;

    /// A tube with the design's cross-section, displaced outwards by `off_m` along rays from the reference point.
    fn tube(profile: &Profile, off_m: f64) -> Mesh {
        let (rings, round) = (41_u32, 720_u32);
        let at = |i: u32, k: u32| {
            let sigma = f64::from(k) / f64::from(round) * profile.perimeter_m();
            place(profile, f64::from(i) * 0.25, sigma, off_m)
        };
        let vertices = (0..rings).flat_map(|i| (0..round).map(move |k| at(i, k))).collect();
        let quad = |i: u32, k: u32| {
            let (a, b) = (i * round + k, i * round + (k + 1) % round);
            [[a, b, b + round], [a, b + round, a + round]]
        };
        let triangles = (0..rings - 1).flat_map(|i| (0..round).flat_map(move |k| quad(i, k))).collect();
        Mesh { vertices, triangles }
    }

    #[test]
    fn tube_5_cm_off_the_wall_has_a_mean_distance_of_5_cm() {
        let profile = shapes::circle(2.0).unwrap();
        let stretch = Stretch { from_m: 1.0, to_m: 9.0, step_m: 0.1 };
        let mesh = tube(&profile, 0.05);
        let index = MeshIndex::new(&mesh, 0.3).unwrap();
        let spread = from_wall(&profile, &index, &stretch, |_, _| 0.0);
        assert!((spread.mean_m - 0.05).abs() < 1e-4 && spread.sd_m < 1e-4, "{spread:?}");
        let right = from_wall(&profile, &index, &stretch, |_, _| 0.05);
        assert!(right.max_m < 1e-4, "{right:?}");
    }

    #[test]
    fn lattice_covers_exactly_the_stretch() {
        let stretch = Stretch { from_m: 10.0, to_m: 11.0, step_m: 0.1 };
        let places: Vec<_> = stretch.places(5.02).collect();
        assert_eq!(places.len(), 11 * 50);
        assert!(places.iter().all(|(x, s)| (10.0..11.0 + 1e-9).contains(x) && (0.0..5.02).contains(s)));
        let none = Stretch { from_m: 1.0, to_m: 0.0, step_m: 0.1 };
        assert_eq!(none.places(5.0).count(), 0);
    }
}
