//! The whole loop in unusual attitudes: pitch beyond 90 degrees, and yaw around 180 degrees.

use std::fmt::Write as _;

use headrace_geometry::frames::{Tunnel, Vec3};
use headrace_geometry::math;
use headrace_support::hard_cases::found;
use headrace_tests::scenes;
use headrace_tests::tracking::{Silence, Track, dive, filter};

const SCENE: &str = "vehicle = \"vita2-2.toml\"\n[effects]\nmotion_within_turn = {}\n[trajectory]\nkind = \"recorded\"\n\
    file = \"way.csv\"\n";

/// Trajectory at 0.05 m/s that begins and ends with a horizontal vehicle.
///
/// The vehicle pitches nose down to 135 degrees, then nose up and over, and yaws beyond 180 degrees to the left and
/// right.
fn way() -> String {
    let turns =
        [(40.0, 0.0, 0.0), (100.0, 135.0, 0.0), (160.0, 0.0, 0.0), (220.0, -135.0, 0.0), (280.0, 0.0, 0.0)];
    let rounds = [(400.0, 0.0, 200.0), (640.0, 0.0, -190.0), (660.0, 0.0, -190.0)];
    let (mut text, mut from) = (String::new(), (0.0, 0.0, 0.0));
    let smooth = |share: f64| share * share * (3.0 - 2.0 * share);
    for to in turns.into_iter().chain(rounds) {
        let count = math::round_to_i64(to.0 - from.0);
        for k in 0..count {
            let share = k as f64 / count as f64;
            let at_s = from.0 + k as f64;
            let between = |from: f64, to: f64| from + (to - from) * smooth(share);
            let (pitch_deg, yaw_deg) = (between(from.1, to.1), between(from.2, to.2));
            writeln!(text, "{at_s},{},0.3,3.5,0,{pitch_deg},{yaw_deg}", 10.0 + 0.05 * at_s).unwrap();
        }
        from = to;
    }
    text
}

/// Largest errors of the position fixes, and numbers of fixes in unusual attitudes.
#[derive(Debug, Default)]
struct Errors {
    turn_rad: f64,
    /// Largest position error while the hull is within 30 degrees of the tunnel's axis, in either direction, m.
    /// `anywhere_m` is the largest position error whatever the angle of the hull.
    along_axis_m: f64,
    anywhere_m: f64,
    upside_down: u32,
    turned_round: u32,
    without_fix: usize,
}

fn errors(track: &Track) -> Errors {
    let mut found = Errors::default();
    for tracked in &track.fixes {
        let Ok(fix) = tracked.fix else {
            found.without_fix += 1;
            continue;
        };
        let truth = tracked.truth;
        let [_, x, y, z] = (truth.attitude * fix.pose.attitude.inverse()).wxyz();
        found.turn_rad = found.turn_rad.max(2.0 * math::asin(Vec3::<Tunnel>::new(x, y, z).norm().min(1.0)));
        let off_m = (truth.position - fix.pose.position).norm();
        let (ahead, up) =
            (truth.attitude * Vec3::new(1.0, 0.0, 0.0), truth.attitude * Vec3::new(0.0, 0.0, 1.0));
        found.anywhere_m = found.anywhere_m.max(off_m);
        if ahead.x().abs() > math::cos(f64::to_radians(30.0)) {
            found.along_axis_m = found.along_axis_m.max(off_m);
        }
        found.upside_down += u32::from(up.z() < -0.1);
        found.turned_round += u32::from(up.z() > 0.9 && ahead.x() < -0.9);
    }
    found
}

/// In some attitudes, the beams look along the tunnel and only graze the wall. Few returns then measure the position,
/// so a larger position error is allowed.
#[test]
fn fix_is_accurate_beyond_90_degrees_of_pitch_and_at_180_degrees_of_yaw() {
    let way = way();
    let scene = scenes::scene_from(SCENE, &|name| {
        if name == "way.csv" { Ok(way.clone().into_bytes()) } else { scenes::vehicle_file(name) }
    });
    let track = dive(&scene, filter(&scene), Silence::default());
    let errors = errors(&track);
    println!("{errors:?} of {}", track.fixes.len());
    assert!(errors.upside_down > 5000 && errors.turned_round > 5000, "{errors:?}");
    assert!(errors.without_fix * 100 < track.fixes.len(), "{errors:?}");
    found("loop.attitude_turn", errors.turn_rad, 0.02);
    found("loop.attitude_place", errors.along_axis_m, 0.1);
    found("loop.attitude_grazing", errors.anywhere_m, 0.3);
}
