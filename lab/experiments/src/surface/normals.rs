//! Estimates wall normals at samples.

use headrace_geometry::math;
use headrace_geometry::tunnel::Profile;

use super::{Sample, Xyz};

/// Normals towards the line along the tunnel through the profile's reference point.
///
/// The normals don't depend on the design. For a flat floor, the error at a sample is at most the sample's angle from
/// straight down, as seen from the line.
pub(crate) fn towards_axis(profile: &Profile, places: &[Xyz]) -> Vec<Sample> {
    let [y, z] = profile.reference();
    let sample = |place: &Xyz| {
        let (dy, dz) = (y - place[1], z - place[2]);
        let length = math::hypot(dy, dz);
        let normal = if length > 0.0 { [0.0, dy / length, dz / length] } else { [0.0, 0.0, 1.0] };
        Sample { place: *place, normal }
    };
    places.iter().map(sample).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_geometry::tunnel::shapes;

    #[test]
    fn normals_point_inwards_and_match_those_of_an_arc() {
        let profile = shapes::ceran_blueprint().unwrap();
        let places: Vec<Xyz> =
            (0..200).map(|k| profile.point_at(f64::from(k) * 0.17)).map(|[y, z]| [1.0, y, z]).collect();
        let centre = profile.reference();
        for sample in towards_axis(&profile, &places) {
            let direction = [sample.place[1] - centre[0], sample.place[2] - centre[1]];
            let [y, z] = profile.cast_from_inside(centre, direction).unwrap().normal;
            let cosine = super::super::dot(sample.normal, [0.0, y, z]);
            assert!(cosine > 0.4, "{sample:?} {cosine}");
            if sample.place[2] > 0.1 {
                assert!(cosine > 1.0 - 1e-9, "{sample:?} {cosine}");
            }
        }
    }
}
