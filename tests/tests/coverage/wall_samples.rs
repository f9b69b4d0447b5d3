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
    let ratio = |s: &headrace_monitor::report::SectionReport| s.deviation.and_then(|d| d.area_ratio).unwrap_or(1.0);
    let odd = r.sections.iter().filter(|s| !(0.6..=1.6).contains(&ratio(s))).count();
    let contra = r.sections.iter().filter(|s| s.deviation.is_some_and(|d| d.contradicts)).count();
    let by_hole = r.sections.iter().filter(|s| s.verdict == "cannot_say" && s.hole_m.unwrap() + 2.0 * s.hole_sd_m > r.target_m).count();
    let causes: Vec<_> = r.sections.iter().filter_map(|s| s.cause).map(|c| c.cause.as_str()).collect();
    println!("   odd {odd} contradict {contra} cannot by hole {by_hole} {causes:?}");
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
        ("frozen", 1, "stuck_range = { sensors = [\"sonar_0\"] }\n"),
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

/// Of each ping, in the loop's order: its range and that to what the beam's axis met, m.
fn truths(vehicle: &str, scene: &str, dive: &Dive) -> Vec<Option<[f64; 2]>> {
    let file = |_: &str| Ok(vehicle.as_bytes().to_vec());
    let scene = headrace_tests::scenes::scene_from(scene, &file);
    let mut simulation = headrace_simulator::Simulation::with_truth(&scene).unwrap();
    let mut by_head: std::collections::BTreeMap<u16, Vec<Option<[f64; 2]>>> = std::collections::BTreeMap::new();
    while simulation.advance() {
        for row in simulation.take_truth() {
            if row.sense == headrace_sensor::device::Sense::Head {
                let sounding = row.sounding.unwrap();
                let wall = sounding.wall.map(|(hit, _)| hit.range_m);
                by_head.entry(row.source).or_default().push(sounding.measured.range_m.zip(wall).map(|(a, b)| [a, b]));
            }
        }
    }
    let mut lines: Vec<_> = by_head.into_values().collect();
    println!("truth {:?} pings {:?}", lines.iter().map(Vec::len).collect::<Vec<_>>(), (0..lines.len()).map(|k| dive.pings.iter().filter(|p| p.head == k).count()).collect::<Vec<_>>());
    let mut next = vec![0; lines.len()];
    dive.pings.iter().map(|ping| { let k = next[ping.head]; next[ping.head] += 1; lines[ping.head].get_mut(k).and_then(Option::take) }).collect()
}

fn explore_truth(name: &str, vehicle: &str, scene: &str, met_m: f64) {
    let dive = instrumented::dive(vehicle, scene);
    stats(name, &dive);
    let truths = truths(vehicle, scene, &dive);
    let met = |t: &Option<[f64; 2]>| t.is_some_and(|[a, b]| (a - b).abs() <= met_m);
    let (mut false_wall, mut lost_wall, mut strays, mut walls) = (0, 0, 0, 0);
    for (ping, truth) in dive.pings.iter().zip(&truths) {
        let m = met(truth);
        if ping.sample.is_some() || ping.doubtful.is_some() { if m { walls += 1 } else { strays += 1 } }
        if ping.sample.is_some() && !m { false_wall += 1 }
        if ping.doubtful.is_some() && m { lost_wall += 1 }
    }
    println!("   {false_wall} of {strays} strays taken for wall; {lost_wall} of {walls} wall doubtful");
    let places = dive.pings.iter().zip(&truths).filter(|(p, t)| p.sample.is_some() && met(t)).filter_map(|(p, _)| p.sample).map(|s| s.place);
    let wall = headrace_tests::wall::Wall::new(places, dive.profile.perimeter_m());
    let (mut worst, mut n, mut over) = (0.0_f64, 0, 0);
    let mut bigger = 0;
    for s in &dive.report.sections {
        let d_true = 2.0 * wall.largest(s.start_m, s.end_m).unwrap().radius_m;
        if d_true > s.hole_m.unwrap() * 1.01 { bigger += 1 }
        if s.verdict == "pass" { n += 1; worst = worst.max(d_true / dive.report.target_m); over += u32::from(d_true > 1.1 * dive.report.target_m); }
    }
    println!("   passed {n}; worst D_true / T {worst:.3}, over 1.1: {over}; D_true larger in {bigger} of {}", dive.report.sections.len());
}

#[test]
fn explore_true_holes() {
    for (name, heads, effects) in [
        ("murk near", 3, "outliers = { share = 0.05, near_m = 0.1, far_m = 0.8, sensors = [\"sonar_0\", \"sonar_1\", \"sonar_2\"] }\nmultipath = {}\n"),
        ("murk all", 3, "outliers = { share = 0.08, near_m = 0.1, sensors = [\"sonar_0\", \"sonar_1\", \"sonar_2\"] }\nmultipath = { share = 0.3 }\npilot_drift = { across_m = 0.2, up_m = 0.1, yaw_deg = 6, period_s = 15 }\n"),
    ] {
        for target in ["0.25", "0.2", "0.15"] {
            let vehicle = pipe(heads).replace("target_m = 0.25", &format!("target_m = {target}"));
            explore_truth(&format!("{name} {target}"), &vehicle, &format!("{PIPE_WAY}{effects}"), 0.1);
        }
    }
    for (speed, target) in [(0.11, 0.5), (0.05, 0.5), (0.11, 0.7), (0.11, 1.0)] {
        let way = format!("vehicle = \"vehicle.toml\"\n[vehicle_changes]\ntarget_m = {target:?}\n[trajectory]\nstart_m = 5\n[[trajectory.legs]]\ndistance_m = 20\nspeed_mps = {speed}\n[effects]\nmotion_within_turn = {{}}\nrange_noise = {{ sd_m = 0.01 }}\noutliers = {{ share = 0.05 , sensors = [\"sonar_0\", \"sonar_1\", \"sonar_2\", \"sonar_3\"] }}\nmultipath = {{}}\n");
        explore_truth(&format!("vita {speed} {target}"), VITA, &way, 0.5);
    }
}
