//! Multipath: echoes that reach the sonar by way of two walls.

use bevy_ecs::prelude::{Component, Query, Res};
use headrace_config::{ConfigError, Section};
use headrace_sensor::device::Sense;
use headrace_sensor::measurement::Sounding;

use super::effect::{Effect, EffectKind};
use super::geometry::{mirrored, squareness};
use super::occlusion::Stopped;
use super::places::Places;
use super::runs::Runs;
use super::targets::PerSensor;
use crate::builder::Builder;
use crate::environment::Environment;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::random::Stream;
use crate::sensing::{Ray, Rays, Reach, Samples, Scenery};
use crate::stages::Stage;

/// Some echoes arrive by way of two walls. The first wall reflects the beam specularly, and the second one returns it
/// to the sonar.
///
/// The range is half the length of the path from the sonar over both walls back to the sonar. Such an echo replaces the
/// direct echo more often towards grazing incidence, since the strength of the direct echo is proportional to the
/// cosine of incidence.
///
/// Keys, with defaults in brackets:
/// - `from_m` and `to_m` of the stretch in which this happens.
/// - `square_share` (0) and `share` (0.1), the shares of returns that arrive by this path. The first is for a beam
///   perpendicular to the wall, the second for a beam along the wall. Both are from 0 to 1. In between, the share grows
///   with 1 minus the cosine of incidence.
/// - `mean_run`, the mean number of consecutive returns by this path once one has arrived, as in missing_returns.
///   Without this key, the path of each return is independent of the previous return.
///
/// The echo remains the direct one if the path meets no second wall within reach, or the sonar doesn't see the second
/// wall.
/// Source: geometry of mirrors; the law of the direct echo is Lambert's.
pub(super) struct MultipathKind;

/// Reflected rays begin at this distance from the wall, m, so that they don't hit it again at once.
const OFF_WALL_M: f64 = 1e-6;

#[derive(Debug, Clone, Copy)]
struct Parameters {
    share: f64,
    square_share: f64,
    mean_run: Option<f64>,
}

#[derive(Component)]
struct Multipath {
    places: Places<Parameters>,
    stream: Stream,
    /// Whether the previous return arrived by way of two walls.
    is_bounced: bool,
}

impl EffectKind for MultipathKind {
    fn name(&self) -> &'static str {
        "multipath"
    }

    fn summary(&self) -> &'static str {
        "some echoes are reflected by two walls"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        let senses = [Sense::Head, Sense::Echosounder];
        Ok(Box::new(PerSensor::read_by_place(tables, facts, &senses, |table| {
            let share = table.number("share", 0.0..=1.0)?.unwrap_or(0.1);
            let square_share = table.number("square_share", 0.0..=1.0)?.unwrap_or(0.0);
            if share == 0.0 && square_share == 0.0 {
                let problem = "at least one of share and square_share must be above zero";
                return Err(table.invalid("share", problem));
            }
            let mean_run = table.number("mean_run", 1.0..=100.0)?;
            Ok(Parameters { share, square_share, mean_run })
        })?))
    }
}

impl Effect for PerSensor<Places<Parameters>> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, places) in &self.0 {
            let stream = sim.stream(*source);
            sim.insert(*source, Multipath { places: places.clone(), stream, is_bounced: false });
        }
        sim.system(Stage::Hear, bounce);
        Ok(())
    }
}

/// Range m of an echo that reaches the sonar by way of two walls; `None` if there is no such path within `far_m`.
fn double_bounce_m(environment: &Environment, ray: &Ray, far_m: f64) -> Option<f64> {
    let first = ray.hit?;
    let from = first.point + first.normal.scaled(OFF_WALL_M);
    let onward = mirrored(ray.direction, first.normal);
    let second = environment.cast(from, onward, 2.0 * far_m)?;
    let seen_from = second.point + second.normal.scaled(OFF_WALL_M);
    if environment.first_obstruction(seen_from, ray.origin).is_some() {
        return None;
    }
    let range_m = (first.range_m + second.range_m + (second.point - ray.origin).norm()) / 2.0;
    (range_m <= far_m).then_some(range_m)
}

impl Parameters {
    /// Whether a return arrives by way of two walls. `square` is the cosine of the beam's incidence. `before` tells
    /// whether the previous return did so.
    fn is_bounced(&self, before: bool, square: f64, chance: f64) -> bool {
        let share = self.share + (self.square_share - self.share) * square;
        let Some(mean) = self.mean_run.filter(|_| share > 0.0 && share < 1.0) else { return chance < share };
        Runs::new(share, mean.max(share / (1.0 - share))).next(Some(before), chance)
    }
}

type Bouncing<'a> = (&'a mut Samples<Sounding>, &'a Rays, &'a Reach, &'a mut Multipath, Option<&'a Stopped>);

fn bounce(scenery: Res<'_, Scenery>, mut sonars: Query<'_, '_, Bouncing<'_>>) {
    for (mut samples, rays, Reach(far_m), mut multipath, stopped) in &mut sonars {
        for (number, ((step, sounding), ray)) in samples.steps().zip(&rays.0).enumerate() {
            let Some(hit) = ray.hit.filter(|_| !Stopped::has(stopped, number)) else { continue };
            let Some(parameters) = multipath.places.here(&scenery, ray).copied() else { continue };
            let [chance, _] = multipath.stream.at(step).uniform();
            let square = squareness(ray.direction, hit.normal);
            multipath.is_bounced = parameters.is_bounced(multipath.is_bounced, square, chance);
            if multipath.is_bounced {
                let bounced_m = double_bounce_m(&scenery.environment, ray, *far_m);
                sounding.range_m = bounced_m.or(sounding.range_m);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use headrace_geometry::frames::{Point3, Vec3};
    use headrace_geometry::math;
    use headrace_geometry::tunnel::shapes;

    use super::*;
    use crate::testing::{Dive, assert_share};

    fn cast(environment: &Environment, [y, z]: [f64; 2], angle_rad: f64) -> Ray {
        let (sine, cosine) = math::sin_cos(angle_rad);
        let (origin, direction) = (Point3::new(5.0, y, z), Vec3::new(0.0, sine, -cosine));
        Ray { origin, direction, hit: environment.cast(origin, direction, 100.0) }
    }

    /// The expected range follows from mirroring: if the rectangular tunnel is mirrored at each wall that the beam
    /// meets, the reflected beam becomes a straight line through the mirrored copies of the tunnel.
    #[test]
    fn multipath_range_in_a_rectangular_tunnel_matches_a_straight_beam_through_mirrored_tunnels() {
        let (half_width_m, height_m, [y, z]) = (3.0, 5.0, [0.7, 2.1]);
        let room = Environment::straight(shapes::rectangle(2.0 * half_width_m, height_m).unwrap());
        for k in 0..720 {
            let angle_rad = (f64::from(k) + 0.37) * math::TAU / 720.0;
            let ray = cast(&room, [y, z], angle_rad);
            let [dy, dz] = [ray.direction.y(), ray.direction.z()];
            // Distances along the straightened beam to the first walls: `to_side` to the side wall, and the other
            // distance to floor or ceiling.
            let to_side = if dy > 0.0 { (half_width_m - y) / dy } else { (-half_width_m - y) / dy };
            let to_flat = if dz > 0.0 { (height_m - z) / dz } else { -z / dz };
            let mut crossings =
                [to_side, to_side + 2.0 * half_width_m / dy.abs(), to_flat, to_flat + height_m / dz.abs()];
            crossings.sort_by(f64::total_cmp);
            let along_m = crossings[1];
            // `fold` mirrors the straightened beam's second point on a wall back into the rectangular tunnel.
            let fold = |at: f64, period: f64| {
                let at = math::wrap(at, 2.0 * period);
                if at > period { 2.0 * period - at } else { at }
            };
            let back_y = fold(y + along_m * dy + half_width_m, 2.0 * half_width_m) - half_width_m;
            let back_z = fold(z + along_m * dz, height_m);
            let expected_m = f64::midpoint(along_m, math::hypot(back_y - y, back_z - z));
            let found_m = double_bounce_m(&room, &ray, 100.0).unwrap();
            assert!((found_m - expected_m).abs() < 1e-5, "{k}: {found_m} {expected_m}");
        }
    }

    #[test]
    fn multipath_range_in_a_circular_tunnel_matches_trigonometry() {
        let (radius_m, out_m) = (4.0, 1.5);
        let pipe = Environment::straight(shapes::circle(radius_m).unwrap());
        // The circle rests on the floor, so its centre is a radius above the floor.
        for k in 0..720 {
            let angle_rad = (f64::from(k) + 0.37) * math::TAU / 720.0;
            let ray = cast(&pipe, [out_m, radius_m], angle_rad);
            // The sine of incidence follows from the law of sines. The ends of a chord are pi - 2 i apart as seen from
            // the circle's centre, where i is the incidence.
            let incidence_rad = math::asin(out_m * ray.direction.z().abs() / radius_m);
            let chord_m = 2.0 * radius_m * math::cos(incidence_rad);
            let first_m = radius_m * math::cos(incidence_rad) - out_m * ray.direction.y();
            // The path from the second point back to the sonar follows from the law of cosines. The angle between beam
            // and chord is twice the incidence.
            let cosine = math::cos(2.0 * incidence_rad);
            let back_m = math::sqrt(first_m * first_m + chord_m * chord_m - 2.0 * first_m * chord_m * cosine);
            let found_m = double_bounce_m(&pipe, &ray, 100.0).unwrap();
            assert!((found_m - (first_m + chord_m + back_m) / 2.0).abs() < 1e-5, "{k}");
        }
        let ray = cast(&pipe, [0.0, radius_m], 0.3);
        assert!((double_bounce_m(&pipe, &ray, 100.0).unwrap() - 2.0 * radius_m).abs() < 1e-5);
        assert!(double_bounce_m(&pipe, &ray, 7.9).is_none());
    }

    #[test]
    fn share_of_multipath_returns_grows_with_incidence_angle() {
        let dive = Dive {
            seconds: 500.0,
            tunnel: "profile = \"rectangle\"\nwidth_m = 4\nheight_m = 3",
            ..Dive::with_head()
        };
        let effects = "[effects.multipath]\nshare = 0.5\nsquare_share = 0.1";
        let (mut near, mut oblique) = ((0, 0, 0.0), (0, 0, 0.0));
        for row in &dive.dive(effects).rows {
            let angle_rad = row.sounding.unwrap().measured.angle_rad;
            let flat = row.wall().unwrap().0.normal.z().abs() > 0.5;
            let square = if flat { math::cos(angle_rad).abs() } else { math::sin(angle_rad).abs() };
            let band = if square > 0.9 { &mut near } else { &mut oblique };
            *band = (band.0 + usize::from(!row.causes.is_empty()), band.1 + 1, band.2 + 0.5 - 0.4 * square);
        }
        for (bounced, of, expected) in [near, oblique] {
            assert_share(bounced, of, expected / of as f64);
        }
    }

    #[test]
    fn multipath_returns_have_the_given_share_and_mean_run_length() {
        let dive = Dive {
            seconds: 1000.0,
            tunnel: "profile = \"rectangle\"\nwidth_m = 4\nheight_m = 3",
            ..Dive::with_head()
        };
        let runs = |keys: &str| {
            let effects = format!("[effects.multipath]\nshare = 0.2\nsquare_share = 0.2\n{keys}");
            let bounced: Vec<bool> =
                dive.dive(&effects).rows.iter().map(|row| !row.causes.is_empty()).collect();
            let all = bounced.iter().filter(|is| **is).count();
            let begun = bounced.windows(2).filter(|two| !two[0] && two[1]).count();
            assert_share(all, bounced.len(), 0.2);
            all as f64 / begun as f64
        };
        let (single, in_runs) = (runs(""), runs("mean_run = 8"));
        assert!((single - 1.25).abs() < 0.1, "{single}");
        assert!((in_runs - 8.0).abs() < 1.0, "{in_runs}");
    }

    #[test]
    fn time_slice_length_does_not_change_results() {
        Dive::with_head().assert_slices_dont_matter("[effects.multipath]\nshare = 0.5\nmean_run = 4");
    }

    #[test]
    fn missing_and_excessive_shares_are_refused() {
        let refusal = |keys: &str| Dive::with_head().refusal(&format!("[effects.multipath]\n{keys}"));
        assert!(refusal("share = 0").contains("must be above zero"));
        assert!(refusal("share = 2").contains("from 0 to 1"));
        assert!(refusal("mean_run = 0.5").contains("from 1 to 100"));
        assert!(refusal("bounces = 2").contains("is not a key here"));
    }
}
