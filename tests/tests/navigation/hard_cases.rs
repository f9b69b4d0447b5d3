//! The whole loop where few vehicles go: over the top, about the yaw of 180 degrees.

use std::fmt::Write as _;

use headrace_fusion::direct::DirectNavigation;
use headrace_geometry::math;
use headrace_hard_cases::found;
use headrace_tests::scenes;
use headrace_tests::tracking::{Silence, Track, dive, filter};

const SCENE: &str = "vehicle = \"vita2-2.toml\"\n[effects]\nmotion_within_turn = {}\n[trajectory]\nkind = \"recorded\"\n\
    file = \"way.csv\"\n";

/// Out of the horizontal and back, at 0.05 m/s: nose down and over to 135 degrees, up and over, beyond 180 to the left, and to the right.
fn way() -> String {
    let turns = [(40.0, 0.0, 0.0), (100.0, 135.0, 0.0), (160.0, 0.0, 0.0), (220.0, -135.0, 0.0), (280.0, 0.0, 0.0)];
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

/// Largest errors of fixes, m and radians, and how many there were with the nose over, turned round, and lacking.
fn errors(track: &Track) -> ([f64; 2], [u32; 3]) {
    let (mut worst, mut counts) = ([0.0_f64; 2], [0; 3]);
    for tracked in &track.fixes {
        let Ok(fix) = tracked.fix else {
            counts[2] += 1;
            continue;
        };
        let truth = tracked.truth;
        let off = truth.attitude * fix.pose.attitude.inverse();
        let turned_rad = 2.0 * math::asin(math::sqrt(off.wxyz()[1..].iter().map(|c| c * c).sum::<f64>()).min(1.0));
        worst[0] = worst[0].max((truth.position - fix.pose.position).norm());
        worst[1] = worst[1].max(turned_rad);
        let up = truth.attitude * headrace_geometry::frames::Vec3::new(0.0, 0.0, 1.0);
        let ahead = truth.attitude * headrace_geometry::frames::Vec3::new(1.0, 0.0, 0.0);
        counts[0] += u32::from(up.z() < -0.1);
        counts[1] += u32::from(up.z() > 0.9 && ahead.x() < -0.9);
    }
    (worst, counts)
}

#[test]
fn over_the_top_and_round_about_the_fix_stays_right() {
    let way = way();
    let scene = scenes::scene_from(SCENE, &|name| {
        if name == "way.csv" { Ok(way.clone().into_bytes()) } else { scenes::vehicle_file(name) }
    });
    let track = dive(&scene, filter(&scene), Silence::default());
    let ([place_m, turn_rad], counts) = errors(&track);
    println!("{place_m} {turn_rad} {counts:?} {}", track.fixes.len());
    let vehicle = &scene.vehicle;
    let direct = DirectNavigation::new(vehicle.tunnel.profile.clone(), vehicle.site);
    let track = dive(&scene, direct, Silence::default());
    println!("{:?} {}", errors(&track), track.fixes.len());
    found("loop.attitude_place", place_m, 0.1);
    found("loop.attitude_turn", turn_rad, 0.02);
}
