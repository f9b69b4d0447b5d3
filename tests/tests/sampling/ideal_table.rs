//! The table of ideal scenes. The tests cover all steps from scene to bytes, log and report.
//!
//! The table has the modes SLOW to FASTEST with 1, 2 and 4 phase-shifted heads at 0.197 m/s. All heads are at the
//! centre of the circle in the `ceran` profile. The mean distance between passes must be v T / s within 0.5 %, where v
//! T is the distance per turn and s the number of heads. The largest hole over nine metres must be within 0.1 % of its
//! value in the table. Those values were computed independently from Delaunay circumcircles.

use std::fmt::Write as _;
use std::path::Path;

use serde_json::Value;

const SPEED_MPS: f64 = 0.197;

/// Mode, turn time in seconds, and largest hole in metres with 1, 2 and 4 heads.
const TABLE: [(&str, f64, [f64; 3]); 5] = [
    ("slow", 21.6, [4.248, 2.125, 1.064]),
    ("medium", 10.8, [2.128, 1.067, 0.542]),
    ("fast", 8.0, [1.582, 0.803, 0.427]),
    ("faster", 6.6, [1.317, 0.687, 0.397]),
    ("fastest", 4.8, [1.030, 0.630, 0.452]),
];

fn vehicle(mode: &str, heads: usize) -> String {
    let mut text = "name = \"ideal\"\ntarget_m = 0.5\n[tunnel]\nprofile = \"ceran\"\nlength_m = 60\n\
                    [navigation]\nway = \"direct\"\n[heads]\nlayout = \"phase_shift\"\nplanned_speed_mps = 0.197\n"
        .to_owned();
    let mut sensor = |id: &str, plugin: &str, keys: &str| {
        writeln!(text, "[[sensors]]\nid = \"{id}\"\nplugin = \"{plugin}\"\n{keys}").unwrap();
    };
    for (id, angles) in
        [("left", "[0, 0, 90]"), ("right", "[0, 0, -90]"), ("up", "[0, -90, 0]"), ("down", "[0, 90, 0]")]
    {
        sensor(id, "ping1d", &format!("angles_deg = {angles}"));
    }
    sensor("depth", "bar100", "");
    sensor("imu", "imu_can", "preset = \"xsens_mti600\"");
    sensor("tether", "tether_hid", "counts_per_metre = 2000");
    for head in 0..heads {
        sensor(&format!("sonar_{head}"), "imagenex881", &format!("mode = \"{mode}\"\nrange_m = 10"));
    }
    text
}

const SCENE: &str =
    "vehicle = \"vehicle.toml\"\n[trajectory]\n[[trajectory.legs]]\ndistance_m = 21\nspeed_mps = 0.197\n";

fn headrace(arguments: &[&Path]) {
    let output = headrace_tests::program().args(arguments).output().unwrap();
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
}

fn report(mode: &str, heads: usize) -> Value {
    let folder = std::env::temp_dir().join(format!("headrace-ideal-{}-{mode}-{heads}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let [scene, log, report] = ["scene.toml", "dive.mcap", "report.json"].map(|name| folder.join(name));
    std::fs::write(folder.join("vehicle.toml"), vehicle(mode, heads)).unwrap();
    std::fs::write(&scene, SCENE).unwrap();
    headrace(&["simulate".as_ref(), &scene, "-o".as_ref(), &log]);
    headrace(&["replay".as_ref(), &log, "--report".as_ref(), &report]);
    let value = serde_json::from_str(&std::fs::read_to_string(&report).unwrap()).unwrap();
    std::fs::remove_dir_all(&folder).unwrap();
    value
}

#[test]
fn ideal_scenes_match_the_table() {
    let mut misses = String::new();
    for (mode, turn_s, holes) in TABLE {
        for (heads, expected_m) in [1, 2, 4].into_iter().zip(holes) {
            let report = report(mode, heads);
            let sections = report["sections"].as_array().unwrap();
            let inner: Vec<&Value> = sections
                .iter()
                .filter(|section| (6.0..15.0).contains(&section["start_m"].as_f64().unwrap()))
                .collect();
            assert_eq!(inner.len(), 36);
            let hole_m = inner.iter().map(|section| section["hole_m"].as_f64().unwrap()).fold(0.0, f64::max);
            let (mut sum, mut count) = (0.0, 0.0);
            for section in &inner {
                let n = section["t_x"]["count"].as_f64().unwrap();
                sum += section["t_x"]["mean_m"].as_f64().unwrap() * n;
                count += n;
            }
            let (t_x_m, expected_t_x_m) = (sum / count, SPEED_MPS * turn_s / heads as f64);
            let (hole_off, t_x_off) = (hole_m / expected_m - 1.0, t_x_m / expected_t_x_m - 1.0);
            println!(
                "{mode:>8} x {heads}: hole {hole_m:.4} m ({:+.2} %), T_x {t_x_m:.4} m ({:+.3} %)",
                100.0 * hole_off,
                100.0 * t_x_off
            );
            // The holes in the table have three decimals.
            if (hole_m - expected_m).abs() > 0.001 * expected_m + 0.0005 || t_x_off.abs() > 0.005 {
                writeln!(misses, "{mode} x {heads}: hole {hole_m} m, T_x {t_x_m} m").unwrap();
            }
        }
    }
    assert!(misses.is_empty(), "{misses}");
}
