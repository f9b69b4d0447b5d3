//! The spacing of samples that the paper's equations predict.

use crate::frames::{Mount, Pose, Vec3, head_direction};
use crate::math::{self, TAU};
use crate::tunnel::Profile;

/// T_max, m: the longer diagonal of the parallelogram that four neighbouring samples make.
///
/// `t_x_m` is the distance between passes, `advance_m` (d) the way gone between two pings, `t_y_m` the largest distance
/// between neighbours within a turn.
/// Source: Jorge et al. 2021, Eq. 16.
pub fn t_max_m(t_x_m: f64, advance_m: f64, t_y_m: f64) -> f64 {
    math::hypot(t_x_m + advance_m, t_y_m)
}

/// The speed at which T_max equals the target, m/s; `None` where `t_y_m` alone is as large as the target, or the
/// times aren't positive.
///
/// `pass_gap_s` is the time between passes (T_rev / s for s evenly interleaved heads), `ping_period_s` that between
/// pings (T_s).
/// Source: Eq. 16 solved for v (metrics.md, "Speed advice").
pub fn speed_for_target_mps(target_m: f64, t_y_m: f64, pass_gap_s: f64, ping_period_s: f64) -> Option<f64> {
    let time_s = pass_gap_s + ping_period_s;
    // (T - t)(T + t) keeps its digits as the two meet.
    let square = (target_m - t_y_m) * (target_m + t_y_m);
    (t_y_m < target_m && time_s > 0.0).then(|| math::sqrt(square) / time_s)
}

/// The range of angles through which a head turns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sweep {
    /// An angle at which it pings, radians in the sensor's frame.
    pub at_rad: f64,
    /// Angle between pings, radians, positive.
    pub step_rad: f64,
    /// Angle turned through before the same place is met again: a whole turn, or a sector.
    pub span_rad: f64,
}

/// T_y2 in general, m: the largest distance on the unrolled wall between neighbouring pings of one sweep of a head that
/// stands still, by ray casting; any profile, place and attitude.
///
/// `None` when the head is outside the profile, or a beam runs along the tunnel.
/// Source: Eq. 6 where the paper's assumptions hold.
pub fn largest_step_m(profile: &Profile, pose: &Pose, mount: &Mount, sweep: &Sweep) -> Option<f64> {
    let origin = pose.place(mount.position);
    let from = [origin.y(), origin.z()];
    if !profile.contains(from) {
        return None;
    }
    let turn = pose.attitude * mount.rotation;
    let pings = math::floor_to_i64(sweep.span_rad.min(TAU) / sweep.step_rad).clamp(1, 20_000);
    let at = |ping: i64| {
        let direction: Vec3<_> = turn * head_direction(sweep.at_rad + ping as f64 * sweep.step_rad);
        let hit = profile.cast_from_inside(from, [direction.y(), direction.z()])?;
        Some((direction.x() * hit.range_m, hit.sigma_m))
    };
    let mut before = at(0)?;
    let mut largest_m = 0.0_f64;
    for ping in 1..=pings {
        let here = at(ping)?;
        let around = math::wrap_signed(here.1 - before.1, profile.perimeter_m());
        largest_m = largest_m.max(math::hypot(here.0 - before.0, around));
        before = here;
    }
    Some(largest_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::{Point3, Rot};
    use crate::tunnel::named;

    fn centred(profile: &Profile) -> Pose {
        let [y, z] = profile.reference();
        Pose { position: Point3::new(3.0, y, z), attitude: Rot::identity() }
    }

    const AT_ORIGIN: fn() -> Mount =
        || Mount { position: Vec3::new(0.0, 0.0, 0.0), rotation: Rot::identity() };

    /// metrics.md's table: T_max of Eq. 16 for `ceran` at 0.197 m/s.
    #[test]
    fn val_t_max_of_the_reference_table() {
        let profile = named::ceran().unwrap();
        let modes = [
            (0.3, 21.6, 0.018, [4.259, 2.132, 1.069]),
            (0.6, 10.8, 0.018, [2.134, 1.074, 0.548]),
            (0.9, 8.0, 0.020, [1.589, 0.811, 0.434]),
            (1.2, 6.6, 0.022, [1.325, 0.695, 0.404]),
            (2.4, 4.8, 0.032, [1.042, 0.639, 0.513]),
        ];
        for (step_deg, turn_s, ping_s, expected) in modes {
            for (heads, expected) in [1.0, 2.0, 4.0].into_iter().zip(expected) {
                // A quarter turn is 37.5 steps of 2.4 degrees: every other head meets the corner half a step off.
                let t_y = (0..4)
                    .map(|head| TAU * (f64::from(head) / heads))
                    .map(|at_rad| Sweep { at_rad, step_rad: f64::to_radians(step_deg), span_rad: TAU })
                    .map(|sweep| largest_step_m(&profile, &centred(&profile), &AT_ORIGIN(), &sweep).unwrap())
                    .fold(0.0, f64::max);
                let t = t_max_m(0.197 * turn_s / heads, 0.197 * ping_s, t_y);
                assert!((t / expected - 1.0).abs() < 2e-3, "{step_deg} deg x {heads}: {t} and {expected}");
            }
        }
    }

    /// Eq. 6 on a flat floor, from a place where its corner falls on a ping.
    #[test]
    fn verif_the_closed_form_on_a_square() {
        let profile = named::rectangle(4.0, 4.0).unwrap();
        let step = f64::to_radians(0.9);
        let sweep = Sweep { at_rad: 0.0, step_rad: step, span_rad: TAU };
        let t_y = largest_step_m(&profile, &centred(&profile), &AT_ORIGIN(), &sweep).unwrap();
        let closed = 4.0 * (math::tan(50.0 * step) - math::tan(49.0 * step)) / 2.0;
        assert!((t_y / closed - 1.0).abs() < 1e-12, "{t_y} and {closed}");
    }

    #[test]
    fn speed_and_target_are_each_other_s_inverse() {
        let v = speed_for_target_mps(0.5, 0.12, 2.0, 0.02).unwrap();
        assert!((t_max_m(v * 2.0, v * 0.02, 0.12) - 0.5).abs() < 1e-12);
        assert_eq!(speed_for_target_mps(0.5, 0.5, 2.0, 0.02), None);
        assert_eq!(speed_for_target_mps(0.5, 0.1, 0.0, 0.0), None);
        assert_eq!(speed_for_target_mps(f64::NAN, 0.1, 2.0, 0.02).filter(|v| v.is_finite()), None);
    }
}
