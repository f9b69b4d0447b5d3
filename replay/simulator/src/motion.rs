//! Ideal inertial measurements, computed from the true pose.

use headrace_geometry::frames::{Mount, Point3, Rot, Sensor, Tunnel, Vec3};
use headrace_geometry::math;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::measurement::Inertia;
use headrace_sensor::reading::Level;

use crate::sensing::Scenery;

/// The sample at time `at` of an inertial unit that samples every `period`.
///
/// Rate and acceleration are means over the period, as in a unit that integrates between samples. The sum of the
/// samples is therefore the whole change of attitude and velocity, even if the acceleration jumps between two samples.
/// At constant attitude and velocity, rate and acceleration are zero except for rounding errors.
pub(crate) fn motion(truth: &Scenery, mount: &Mount, at: MonoNs, period: DurNs) -> Inertia {
    let level = Rot::<Level, Tunnel>::from_roll_pitch_yaw(0.0, 0.0, truth.site.axis_yaw_rad);
    let attitude = |at| level * truth.pose(at).attitude * mount.rotation;
    let half = DurNs(period.0 / 2);
    let (early, late) = (at - half, at + half);
    let rate_radps = rate(attitude(early), attitude(late), late.since(early));
    let place = |at| truth.pose(at).place(mount.position);
    let times = [at - period, at, at + period];
    let acceleration = level * acceleration(times.map(place), times);
    let gravity = Vec3::new(0.0, 0.0, truth.site.gravity_mps2);
    let now = attitude(at);
    let force_mps2 = now.inverse() * (acceleration + gravity);
    Inertia { at, period, attitude: now, rate_radps, force_mps2 }
}

/// Half of the time over which a velocity log averages its measurement.
const HALF_PING: DurNs = DurNs::from_millis(5);

/// Velocity of the sensor's mounting point at time `at`, m/s.
pub(crate) fn velocity(truth: &Scenery, mount: &Mount, at: MonoNs) -> Vec3<Sensor> {
    let (early, late) = (at - HALF_PING, at + HALF_PING);
    let place = |at| truth.pose(at).place(mount.position);
    let elapsed_s = late.since(early).as_secs_f64();
    let attitude = truth.pose(at).attitude * mount.rotation;
    attitude.inverse() * (place(late) - place(early)).scaled(1.0 / elapsed_s)
}

/// Mean turn rate from attitude `before` to attitude `after` over `elapsed`.
fn rate(before: Rot<Level, Sensor>, after: Rot<Level, Sensor>, elapsed: DurNs) -> Vec3<Sensor> {
    let [w, x, y, z] = (before.inverse() * after).wxyz();
    let axis = Vec3::new(x, y, z).scaled(if w < 0.0 { -1.0 } else { 1.0 });
    let (sine, elapsed_s) = (axis.norm(), elapsed.as_secs_f64());
    if elapsed_s <= 0.0 {
        return Vec3::zero();
    }
    // `sine` is the sine of half the angle. For small angles, the ratio of angle to sine tends to two.
    let angle_per_sine = if sine > 1e-9 { 2.0 * math::atan2(sine, w.abs()) / sine } else { 2.0 };
    axis.scaled(angle_per_sine / elapsed_s)
}

/// Acceleration over two intervals: the change from the mean velocity of the first to that of the second, divided by
/// the mean of their lengths.
fn acceleration(places: [Point3<Tunnel>; 3], times: [MonoNs; 3]) -> Vec3<Tunnel> {
    let [before, at, after] = times;
    let [p0, p1, p2] = places;
    let (first_s, second_s) = (at.since(before).as_secs_f64(), after.since(at).as_secs_f64());
    if first_s <= 0.0 || second_s <= 0.0 {
        return Vec3::zero();
    }
    let change = (p2 - p1).scaled(1.0 / second_s) + -(p1 - p0).scaled(1.0 / first_s);
    change.scaled(2.0 / (first_s + second_s))
}
