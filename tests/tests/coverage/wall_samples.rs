//! Samples that are wall: what fills holes, and what doesn't.

use headrace_tests::instrumented::{self, Dive};

const VITA: &str = include_str!("../../../deploy/vehicles/vita2-4.toml");

fn shipped(name: &str) -> Dive {
    let path = headrace_tests::root().join("deploy/scenes").join(name);
    instrumented::dive(VITA, &std::fs::read_to_string(path).unwrap())
}

fn stats(name: &str, dive: &Dive) {
    let wall = dive.pings.iter().filter(|ping| ping.sample.is_some()).count();
    let doubtful = dive.pings.iter().filter(|ping| ping.doubtful.is_some()).count();
    let r = &dive.report;
    println!("{name}: wall {wall} doubtful {doubtful} = {:.3} %; pass {} fail {} cannot {} open {}; alerts {:?}",
        100.0 * doubtful as f64 / (wall + doubtful) as f64, r.summary.pass_m, r.summary.fail_m, r.summary.cannot_say_m, r.summary.open_m, r.alerts);
    let suspect = r.sections.iter().filter(|s| s.suspect).count();
    let most = r.sections.iter().map(|s| (s.doubtful_returns, s.samples, (100.0 * s.start_m) as u32)).max();
    println!("   suspect {suspect} most {most:?}");
}

#[test]
fn explore_scenes() {
    for name in ["collapse.toml", "boulders.toml"] {
        stats(name, &shipped(name));
    }
}

const PIPE_WAY: &str = "vehicle = \"vehicle.toml\"\n[trajectory]\nstart_m = 2\n[[trajectory.legs]]\ndistance_m = 6\nspeed_mps = 0.03\n[effects]\nmotion_within_turn = {}\nrange_noise = { sd_m = 0.005 }\n";

fn pipe(heads: usize) -> String {
    let mut text = "name = \"pipe\"\ntarget_m = 0.25\n[tunnel]\nprofile = \"circle\"\nradius_m = 1\nlength_m = 30\n[water]\nsound_speed_mps = 1447\n[heads]\nplanned_speed_mps = 0.03\n".to_owned();
    for k in 0..heads {
        text += &format!("[[sensors]]\nid = \"sonar_{k}\"\nplugin = \"imagenex881\"\nbody_radius_m = 0.001\nconnect = \"tcp:192.168.0.{}:4040\"\nposition_m = [{}, 0, 0]\nmode = \"fastest\"\nrange_m = 2\n", 4 + k, if k % 2 == 0 { 0.3 } else { -0.3 });
    }
    let rest = headrace_tests::VEHICLE.split("[[sensors]]\nid = \"ping_left\"").nth(1).unwrap();
    text + "[[sensors]]\nid = \"ping_left\"" + rest
}

#[test]
fn explore_pipe() {
    for (name, heads, effects) in [
        ("sound", 1, ""), ("sound", 2, ""), ("sound", 3, ""),
        ("frozen", 1, "stuck_range = {}\n"),
        ("frozen 0 of 2", 2, "stuck_range = { sensors = [\"sonar_0\"] }\n"),
        ("frozen 1 of 2", 2, "stuck_range = { sensors = [\"sonar_1\"] }\n"),
        ("frozen 1 of 3 for a while", 3, "stuck_range = { sensors = [\"sonar_1\"], from_s = 60, to_s = 120 }\n"),
        ("frozen 0.9 1 of 2", 2, "stuck_range = { range_m = 0.9, sensors = [\"sonar_1\"] }\npilot_drift = { across_m = 0.2, up_m = 0.1, period_s = 30 }\n"),
        ("noise", 1, "outliers = { share = 1, near_m = 0.1, sensors = [\"sonar_0\"] }\n"),
        ("noise 1 of 2", 2, "outliers = { share = 1, near_m = 0.1, sensors = [\"sonar_1\"] }\n"),
        ("murk", 3, "outliers = { share = 0.05, near_m = 0.1, far_m = 0.8, sensors = [\"sonar_0\", \"sonar_1\", \"sonar_2\"] }\nmultipath = {}\n"),
        ("drift", 1, "pilot_drift = { across_m = 0.2, up_m = 0.1, yaw_deg = 6, period_s = 15 }\n"),
    ] {
        let dive = instrumented::dive(&pipe(heads), &format!("{PIPE_WAY}{effects}"));
        stats(&format!("{name} {heads}"), &dive);
    }
}
