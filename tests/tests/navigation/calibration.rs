//! `headrace calibrate` on logs with wrong mounts in the vehicle file and with late messages.

use std::fmt::Write as _;

use headrace_tests::Folder;
use serde_json::Value;

/// The vehicle file of a vehicle with two heads and all sensors for the position. Its beam widths are small, because
/// these scenes simulate beams as rays.
fn vehicle(front: &str, aft: &str, zero_at_m: f64) -> String {
    let pings = [("left", "0, 90"), ("right", "0, -90"), ("up", "-90, 0"), ("down", "90, 0")];
    let pings = pings.map(|(id, angles)| {
        format!("[[sensors]]\nid = \"ping_{id}\"\nplugin = \"ping1d\"\nangles_deg = [0, {angles}]\n")
    });
    format!(
        r#"name = "test vehicle"
target_m = 1.2
[tunnel]
profile = "ceran"
length_m = 100
[water]
surface_above_floor_m = 3
[navigation]
return_beam_deg = 0.01
echo_beam_deg = 0.01
[[sensors]]
id = "front"
plugin = "imagenex881"
mode = "fastest"
range_m = 10
{front}
[[sensors]]
id = "aft"
plugin = "imagenex881"
mode = "fastest"
range_m = 10
{aft}
{}
[[sensors]]
id = "depth"
plugin = "bar100"
[[sensors]]
id = "imu"
plugin = "imu_can"
preset = "xsens_mti600"
[[sensors]]
id = "tether"
plugin = "tether_hid"
counts_per_metre = 2000
zero_at_m = {zero_at_m}
"#,
        pings.concat()
    )
}

/// The vehicle file that headrace reads. The simulated vehicle may have mounts that differ from this file.
fn filed() -> String {
    vehicle("position_m = [0.1, 0, 0]", "position_m = [-0.1, 0, 0]\nangles_deg = [0, 0, 180]", 0.0)
}

/// A dive with thirty seconds of motion with yaw, roll and pitch. If `stand` is set, the vehicle first stands still for
/// twelve seconds.
fn scene(stand: bool, effects: &str) -> String {
    let mut scene =
        "name = \"calibration\"\nvehicle = \"true.toml\"\n[trajectory]\nkind = \"waypoints\"\n".to_owned();
    let mut go = |chainage: f64, place: [f64; 2], angles: [f64; 3], stay: f64| {
        let [roll, pitch, yaw] = angles;
        write!(
            scene,
            "[[trajectory.waypoints]]\nchainage_m = {chainage}\nplace_m = {place:?}\nroll_deg = {roll}\n\
             pitch_deg = {pitch}\nyaw_deg = {yaw}\nspeed_mps = 0.35\nstay_s = {stay}\n"
        )
        .unwrap();
    };
    go(10.0, [0.6, 2.3], [1.0, 0.0, 2.0], if stand { 12.0 } else { 0.0 });
    for k in 1..=9 {
        let side = if k % 2 == 0 { 1.0 } else { -1.0 };
        let tilt = [5.0, 3.0, -4.0, -2.0][k % 4];
        go(10.0 + k as f64, [0.4 * side, 2.3 + 0.1 * tilt], [1.5 * tilt, tilt, 12.0 * side], 0.0);
    }
    scene + "[effects]\nmotion_within_turn = {}\nrange_noise = { sd_m = 0.01 }\n" + effects
}

fn folder(stand: bool, truth: &str, effects: &str) -> Folder {
    let folder = Folder::new();
    folder.write("true.toml", truth);
    folder.write("filed.toml", filed());
    folder.write("scene.toml", scene(stand, effects));
    folder.simulate("scene.toml", "dive.mcap");
    folder
}

fn found<'a>(report: &'a Value, of: &str, what: &str) -> &'a Value {
    let rows = report["found"].as_array().unwrap();
    rows.iter()
        .find(|row| row["of"] == of && row["what"] == what)
        .unwrap_or_else(|| panic!("{of} {what}: {report:#}"))
}

/// Checks that the latency found by `calibrate` differs from the truth by at most three of its reported standard
/// deviations, and by less than `most_ms`.
#[track_caller]
fn assert_latency(report: &Value, of: &str, truth_ms: f64, most_ms: f64) {
    let row = found(report, of, "latency");
    let (value, sd) = (row["found"].as_f64().unwrap(), row["sd"].as_f64().unwrap());
    assert!((value - truth_ms).abs() <= 3.0 * sd && (value - truth_ms).abs() < most_ms, "{of}: {row}");
}

const LATE_UNIT: &str =
    "line_delay = { sensors = [\"imu\"], latency_ms = 80 }\noutliers = { share = 0.08 }\n";
const LATE_HEAD: &str = "line_delay = { sensors = [\"front\"], latency_ms = 50 }\n";

/// The wrong settings are a rotated head, a reversed head, a wrong zero of the cable counter, and the latency of the
/// inertial unit.
#[test]
fn calibrate_finds_wrong_settings_and_proposes_corrections() {
    let front = "position_m = [0.1, 0, 0.04]\nangles_deg = [4, 0, 0]";
    let truth = vehicle(front, "position_m = [-0.1, 0, 0]\nangles_deg = [0, 0, 0]", 1.5);
    let folder = folder(true, &truth, LATE_UNIT);
    let answer = folder.headrace(&[
        "calibrate",
        "dive.mcap",
        "--vehicle",
        "filed.toml",
        "--chainage",
        "10",
        "--at-surface",
        "0..5",
    ]);
    assert_eq!((answer.code, answer.stderr.as_str()), (Some(0), ""));
    insta::assert_snapshot!(answer.stdout, @r#"
    dive.mcap: 0.0 to 47.7 s, test vehicle
    stationary from 0.0 to 12.0 s, 0.599 m left of the centre and 2.312 m above the floor (sd 0.027, 0.027)
    half of the returns are within 0.008 m of the profile; ranges are too long by +0.00 % (sd 0.02)
      front: 327 returns used, 48 rejected, rms 1.0 cm, 360 degrees of wall
      aft: 332 returns used, 43 rejected, rms 0.9 cm, 360 degrees of wall

    found                                           file      found       sd
    water        pressure at the surface          101325     108240       88 Pa  differs
    water        surface above the floor here      3.000      2.312    0.035 m  differs
    front        faces                           forward    forward
    front        angle about its axis               0.00       3.98     0.20 deg  differs
    front        left                              0.000      0.001    0.002 m
    front        up                                0.000      0.020    0.001 m  differs
    aft          faces                               aft    forward            differs
    aft          angle about its axis               0.00       0.00     0.20 deg
    aft          left                              0.000     -0.001    0.002 m
    aft          up                                0.000     -0.020    0.001 m  differs
    tether       chainage at zero                  0.000      1.500    0.060 m  differs
    front        latency                             0.0        4.9      8.4 ms
    aft          latency                             0.0       -7.3      7.3 ms
    ping_left    latency                             0.0       -0.4      7.9 ms
    ping_right   latency                             0.0       -0.3      8.5 ms
    ping_up      latency                             0.0       14.0     14.6 ms
    ping_down    latency                             0.0        6.7     13.2 ms
    depth        latency                             0.0       -4.4     23.8 ms
    imu          latency                             0.0       73.4      6.6 ms  differs

    not determined by this log
      tether, latency: the vehicle hardly turned or moved: the latency would have a standard deviation of 38 ms

    for the vehicle file
    [water]
    surface_pressure_pa = 108240
    surface_above_floor_m = 2.312
    [[sensors]]  # id = "front"
    angles_deg = [3.98, 0, 0]
    position_m = [0.1, 0, 0.02]
    [[sensors]]  # id = "aft"
    angles_deg = [0, 0, 0]
    position_m = [-0.1, 0, -0.02]
    [[sensors]]  # id = "tether"
    zero_at_m = 1.5
    [[sensors]]  # id = "imu"
    latency_ms = 73.4
    "#);
}

#[test]
fn calibrate_finds_only_the_late_head() {
    let folder = folder(true, &filed(), LATE_HEAD);
    let answer = folder.headrace(&["calibrate", "dive.mcap", "--json"]);
    assert_eq!(answer.code, Some(0), "{}", answer.stderr);
    let report: Value = serde_json::from_str(&answer.stdout).unwrap();
    // A head answers before its next ping, so the vehicle file may not state a latency of 32 ms or more. The latency
    // found here is longer, so `calibrate` proposes no line.
    let untold = report["untold"].as_array().unwrap();
    let why = untold.iter().find(|row| row["of"] == "front" && row["what"] == "latency").unwrap()["why"]
        .as_str()
        .unwrap();
    let found_ms: f64 = why.split(' ').next().unwrap().parse().unwrap();
    assert!((found_ms - 50.0).abs() < 30.0 && why.contains(" ms, so its latency is shorter"), "{why}");
    for of in ["aft", "imu", "ping_left", "ping_right", "ping_up", "ping_down"] {
        assert_latency(&report, of, 0.0, 30.0);
    }
    let lines = report["vehicle_file"].as_object().unwrap();
    assert!(!lines.values().any(|lines| lines.to_string().contains("latency_ms")), "{lines:?}");
    assert_eq!(found(&report, "front", "faces")["found"], "forward");
    assert_eq!(report["untold"][0]["of"], "water");
}

/// All walls seem too near or too far. No mount or other setting may be changed to explain this. The speed of sound
/// that explains the ranges is reported, because either this setting or the wall's design is wrong.
#[test]
fn wrong_speed_of_sound_is_reported_without_a_settings_line() {
    for (share, says) in
        [(0.04, "ranges differ from this profile by -"), (-0.04, "ranges differ from this profile by +")]
    {
        let folder = folder(true, &filed(), &format!("sound_speed_error = {{ share = {share} }}\n"));
        let answer = folder.headrace(&["calibrate", "dive.mcap"]);
        assert!(answer.stdout.contains("a fault was found, see above"), "{}", answer.stdout);
        assert!(!answer.stdout.contains("for the vehicle file"), "{}", answer.stdout);
        let line = answer.stdout.lines().find(|line| line.contains("water, speed of sound: ")).unwrap();
        assert!(line.contains(says), "{line}");
        let fits: f64 =
            line.split("sound_speed_mps = ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
        assert!((fits / (1447.0 * (1.0 + share)) - 1.0).abs() < 0.01, "{line}");
    }
}

/// If the log has no stationary phase, `calibrate` finds no mount and no zero of the cable counter. In a very short
/// log, it finds nothing.
#[test]
fn calibrate_without_a_stationary_phase_says_so() {
    let folder = folder(false, &filed(), "");
    let answer =
        folder.headrace(&["calibrate", "dive.mcap", "--from", "8", "--to", "8.9", "--chainage", "10"]);
    assert_eq!(answer.code, Some(1), "{}", answer.stdout);
    let moved = folder.headrace(&[
        "calibrate",
        "dive.mcap",
        "--from",
        "5",
        "--to",
        "12",
        "--chainage",
        "10",
        "--json",
    ]);
    let report: Value = serde_json::from_str(&moved.stdout).unwrap();
    let why = |of: &str| {
        let rows = report["untold"].as_array().unwrap();
        rows.iter().find(|row| row["of"] == of).unwrap()["why"].as_str().unwrap().to_owned()
    };
    assert!(why("heads").starts_with("the vehicle moved: "), "{report:#}");
    assert_eq!(why("heads"), why("cable counters"));
    assert_eq!(report["still"], Value::Null);
}

#[test]
fn invalid_options_are_refused() {
    let folder = folder(false, &filed(), "");
    for (options, words) in [
        (["--from", "9", "--to", "9"], "--to 9 must be after --from 9"),
        (["--from", "0", "--to", "2000"], "at most 1200 s are allowed"),
        (["--at-surface", "9..3", "--from", "0"], "expected FROM..TO in seconds, FROM less than TO"),
    ] {
        let answer = folder.headrace(&[&["calibrate", "dive.mcap"], &options[..]].concat());
        assert_eq!(answer.code, Some(2), "{}", answer.stdout);
        assert!(answer.stderr.contains(words), "{}", answer.stderr);
    }
}
