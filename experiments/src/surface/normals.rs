//! Normals of samples, for surfaces that need them.

use headrace_geometry::math;
use headrace_geometry::tunnel::Profile;

use super::{Sample, Xyz};

/// Towards the line along the tunnel through the profile's reference point: what is known without a design. On a flat
/// floor off the centre it is off by up to the angle at which the floor is seen.
pub fn towards_axis(profile: &Profile, places: &[Xyz]) -> Vec<Sample> {
    let [y, z] = profile.reference();
    let sample = |place: &Xyz| {
        let (dy, dz) = (y - place[1], z - place[2]);
        let length = math::hypot(dy, dz);
        let normal = if length > 0.0 { [0.0, dy / length, dz / length] } else { [0.0, 0.0, 1.0] };
        Sample { place: *place, normal }
    };
    places.iter().map(sample).collect()
}

/// The design's normal at the place of the wall seen from the reference point through the sample.
pub fn of_design(profile: &Profile, places: &[Xyz]) -> Vec<Sample> {
    let centre = profile.reference();
    let sample = |place: &Xyz| {
        let direction = [place[1] - centre[0], place[2] - centre[1]];
        let normal = profile.cast_from_inside(centre, direction).map_or([0.0, 1.0], |hit| hit.normal);
        Sample { place: *place, normal: [0.0, normal[0], normal[1]] }
    };
    places.iter().map(sample).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_geometry::tunnel::shapes;

    #[test]
    fn both_look_inwards_and_agree_on_an_arc_about_the_reference() {
        let profile = shapes::ceran_blueprint().unwrap();
        let places: Vec<Xyz> =
            (0..200).map(|k| profile.point_at(f64::from(k) * 0.17)).map(|[y, z]| [1.0, y, z]).collect();
        let (axis, design) = (towards_axis(&profile, &places), of_design(&profile, &places));
        for (a, d) in axis.iter().zip(&design) {
            let cosine = super::super::dot(a.normal, d.normal);
            assert!(cosine > 0.4, "{a:?} {d:?}");
            if a.place[2] > 0.1 {
                assert!(cosine > 1.0 - 1e-9, "{a:?} {d:?}");
            }
        }
    }
}
