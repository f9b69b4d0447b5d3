//! `headrace check` lists all errors of a file at once. It also reports sensors that can't share a port and walls that
//! are out of range. Its figures are the same as those of `plan`.

use std::fmt::Write as _;

use headrace_geometry::math;
use headrace_tests::{Folder, SCENE, VEHICLE, root};
use serde_json::Value;

/// Replaces several pieces of a text. Each piece must occur exactly once.
fn changed(text: &str, changes: &[(&str, &str)]) -> String {
    changes.iter().fold(text.to_owned(), |text, (from, to)| {
        assert_eq!(text.matches(from).count(), 1, "{from:?}");
        text.replace(from, to)
    })
}

#[test]
fn all_vehicle_file_errors_are_listed_at_once_with_line_and_nearest_key() {
    let folder = Folder::new();
    let wrong = changed(
        VEHICLE,
        &[
            ("target_m = 1.2", "target_cm = 120"),
            ("radius_m = 3\n", "raduis_m = 3\n"),
            ("sound_speed_mps = 1447", "sound_speed_mps = 14470\nsalt = 3"),
            ("0.5:4040\"\nmode = \"fastest\"", "0.5:4040\"\nmode = \"fastets\"\nfrequency_khz = 1"),
            ("id = \"ping_right\"", "id = \"ping_left\""),
            ("plugin = \"bar100\"", "plugn = \"bar100\""),
            ("angles_deg = [0, 0, 90]", "angles_deg = [0, 90]"),
            ("counts_per_metre = 2000", "colour = \"red\""),
        ],
    );
    folder.write("vehicle.toml", wrong);
    let answer = folder.headrace(&["check", "vehicle.toml"]);
    assert_eq!((answer.code, answer.stdout.as_str()), (Some(2), ""));
    insta::assert_snapshot!(answer.stderr, @r#"
    headrace: vehicle.toml:2: target_cm: is not a key here; did you mean target_m?
    headrace: vehicle.toml:6: tunnel.raduis_m: is not a key here; did you mean radius_m?
    headrace: vehicle.toml:10: water.sound_speed_mps = 14470: must be a number from 1300 to 1700
    headrace: vehicle.toml:11: water.salt: is not a key here; known are sound_speed_mps, density_kgpm3, gravity_mps2, surface_pressure_pa, surface_above_floor_m, sound_speed_from
    headrace: vehicle.toml:27: sensors[1].mode = "fastets": must be one of slow, medium, fast, faster, fastest; did you mean "fastest"?
    headrace: vehicle.toml:28: sensors[1].frequency_khz = 1: must be a whole number from 600 to 1000
    headrace: vehicle.toml:34: sensors[2].angles_deg = [0, 90]: must be three numbers [a, b, c], each from -360 to 360
    headrace: vehicle.toml:37: sensors[3].id = "ping_left": is the id of an earlier sensor; ids must differ
    headrace: vehicle.toml:53: sensors[6].plugn: is not a key here; did you mean plugin?
    headrace: vehicle.toml:60: sensors[8].counts_per_metre: is missing
    "#);
}

#[test]
fn all_errors_of_a_scene_and_its_vehicle_file_are_listed_at_once() {
    let folder = Folder::new();
    folder.write("vehicle.toml", VEHICLE);
    let more = "[[trajectory.legs]]\ndistance_m = 0\nspeed_mps = 0\n\n\
                [effects.range_noise]\nsd = 0.02\n[effects.outlier]\nshare = 0.1\n";
    let wrong = changed(SCENE, &[("start_m = 3", "start = 3"), ("distance_m = 4", "distance_m = -4")]);
    folder.write("scene.toml", format!("{wrong}\n{more}"));
    let answer = folder.headrace(&["check", "scene.toml"]);
    assert_eq!((answer.code, answer.stdout.as_str()), (Some(2), ""));
    insta::assert_snapshot!(answer.stderr, @"
    headrace: scene.toml:5: trajectory.start: is not a key here; did you mean start_m?
    headrace: scene.toml:8: trajectory.legs[0].distance_m = -4: must be a number from 0.01 to 1000000
    headrace: scene.toml:12: trajectory.legs[1].distance_m = 0: must be a number from 0.01 to 1000000
    headrace: scene.toml:13: trajectory.legs[1].speed_mps = 0: must be at least 0.001 either way, or the leg has no end
    headrace: scene.toml:16: effects.range_noise.sd: is not a key here; did you mean sd_m?
    headrace: scene.toml:17: effects.outlier: is not a key here; did you mean outliers?
    ");

    folder.write(
        "vehicle.toml",
        changed(VEHICLE, &[("target_m = 1.2\n", ""), ("radius_m = 3", "radius_m = 0")]),
    );
    folder.write("scene.toml", changed(SCENE, &[("[trajectory]", "[weather]\n[trajectory]")]));
    for command in [&["check", "scene.toml"][..], &["simulate", "scene.toml", "-o", "dive.mcap"]] {
        let answer = folder.headrace(command);
        assert_eq!((answer.code, answer.stdout.as_str()), (Some(2), ""));
        insta::allow_duplicates! { insta::assert_snapshot!(answer.stderr, @r#"
        headrace: scene.toml:2: vehicle = "vehicle.toml": has 2 errors
        headrace: scene.toml:4: weather: is not a key here; known are name, seed, vehicle, vehicle_changes, tunnel, trajectory, effects, water, cable, thrusters
        headrace: vehicle.toml:1: target_m: is missing
        headrace: vehicle.toml:5: tunnel.radius_m = 0: must be a number from 0.1 to 200
        "#); }
    }
    assert!(!folder.path("dive.mcap").exists());
}

/// Output and exit code of `check` for each changed vehicle file.
fn findings(cases: &[(&str, &[(&str, &str)])]) -> String {
    let folder = Folder::new();
    let mut said = String::new();
    for (what, changes) in cases {
        folder.write("vehicle.toml", changed(VEHICLE, changes));
        let answer = folder.headrace(&["check", "vehicle.toml"]);
        // If `check` finds errors, it prints no summary. If it finds only warnings, it prints the summary.
        assert_eq!(answer.stdout.is_empty(), answer.code == Some(2), "{what}");
        write!(said, "{what}: {}\n{}", answer.code.unwrap(), answer.stderr).unwrap();
    }
    said
}

#[test]
fn port_that_two_sensors_cannot_share_is_an_error() {
    let (left, right) = ("id = \"ping_left\"\n", "id = \"ping_right\"\n");
    let on = |table: &str, connect: &str| format!("{table}connect = \"{connect}\"\n");
    let serial = [on(left, "serial:/dev/ttyUSB0"), on(right, "serial:/dev/ttyUSB0")];
    let slower = on(right, "serial:/dev/ttyUSB0?baud=9600");
    let udp = [on(left, "udp:192.168.2.2:9090"), on(right, "udp:192.168.2.2:9090")];
    let other = on(right, "udp:192.168.2.2:9089");
    let can = ("plugin = \"imu_can\"\n", "plugin = \"imu_can\"\nconnect = \"can:can0\"\n");
    let unit = |id_base: &str| {
        format!(
            "preset = \"xsens_mti600\"\n\n[[sensors]]\nid = \"imu_2\"\nplugin = \"imu_can\"\n\
             preset = \"xsens_mti600\"\nconnect = \"can:can0\"\n{id_base}"
        )
    };
    let (same_unit, other_unit) = (unit(""), unit("id_base = 0x200\n"));
    let preset = "preset = \"xsens_mti600\"\n";
    let (first, second) = ("tcp:192.168.0.4:4040", "tcp:192.168.0.5:4040");
    let cases: [(&str, &[(&str, &str)]); 9] = [
        ("two Pings on one serial port", &[(left, &serial[0]), (right, &serial[1])]),
        ("one serial port at two rates", &[(left, &serial[0]), (right, &slower)]),
        ("two Pings on one UDP address", &[(left, &udp[0]), (right, &udp[1])]),
        ("two Pings on two", &[(left, &udp[0]), (right, &other)]),
        ("two heads on one TCP address", &[(second, first)]),
        ("two heads of two ids there", &[("0.5:4040\"", "0.4:4040\"\nhead_id = 17")]),
        ("two units of one id on CAN", &[can, (preset, &same_unit)]),
        ("two units of two ids there", &[can, (preset, &other_unit)]),
        ("no such way to connect", &[(second, "usb:1")]),
    ];
    insta::assert_snapshot!(findings(&cases), @r#"
    two Pings on one serial port: 2
    headrace: vehicle.toml:37: sensors[3].connect: is also the serial port of sensor "ping_left", and the bytes of two ping1d cannot be separated there; give each its own
    headrace: warning: vehicle.toml:15: sensors: have no connect, so `run` can't reach them: ping_up, ping_down, depth, imu, tether
    one serial port at two rates: 2
    headrace: vehicle.toml:37: sensors[3].connect: is also the serial port of sensor "ping_left", but with other settings; only one sensor can open it
    headrace: warning: vehicle.toml:15: sensors: have no connect, so `run` can't reach them: ping_up, ping_down, depth, imu, tether
    two Pings on one UDP address: 2
    headrace: vehicle.toml:37: sensors[3].connect: is also the UDP address of sensor "ping_left", and the bytes of two ping1d cannot be separated there; give each its own
    headrace: warning: vehicle.toml:15: sensors: have no connect, so `run` can't reach them: ping_up, ping_down, depth, imu, tether
    two Pings on two: 0
    headrace: warning: vehicle.toml:15: sensors: have no connect, so `run` can't reach them: ping_up, ping_down, depth, imu, tether
    two heads on one TCP address: 2
    headrace: vehicle.toml:25: sensors[1].connect: is also the TCP address of sensor "sonar_0", and the bytes of two imagenex881 cannot be separated there; give each its own
    headrace: warning: vehicle.toml:15: sensors: have no connect, so `run` can't reach them: ping_left, ping_right, ping_up, ping_down, depth, imu, tether
    two heads of two ids there: 0
    headrace: warning: vehicle.toml:15: sensors: have no connect, so `run` can't reach them: ping_left, ping_right, ping_up, ping_down, depth, imu, tether
    two units of one id on CAN: 2
    headrace: vehicle.toml:63: sensors[8].connect: is also the CAN interface of sensor "imu", and the bytes of two imu_can cannot be separated there; give each its own
    headrace: warning: vehicle.toml:15: sensors: have no connect, so `run` can't reach them: ping_left, ping_right, ping_up, ping_down, depth, tether
    two units of two ids there: 0
    headrace: warning: vehicle.toml:15: sensors: have no connect, so `run` can't reach them: ping_left, ping_right, ping_up, ping_down, depth, tether
    no such way to connect: 2
    headrace: vehicle.toml:25: sensors[1].connect: unknown carrier "usb"; allowed are serial:/dev/serial/by-id/NAME?baud=115200, serial:usb:VID:PID[:SERIAL]?baud=115200, tcp:HOST:PORT, udp:HOST:PORT, udp-listen:ADDRESS:PORT, can:INTERFACE, hid:VID:PID[:SERIAL], i2c:/dev/i2c-1:0x40
    headrace: warning: vehicle.toml:15: sensors: have no connect, so `run` can't reach them: ping_left, ping_right, ping_up, ping_down, depth, imu, tether
    "#);
}

/// The dive goes on in spite of errors in the vehicle file, because the crew may have no other file at hand.
#[test]
fn run_warns_of_errors_found_by_check() {
    let folder = Folder::new();
    folder.write("vehicle.toml", VEHICLE.replace("range_m = 5", "range_m = 3"));
    let answer = folder.headrace(&["run", "vehicle.toml", "--no-page", "--no-record", "--for", "0.5"]);
    let said = "WRONG in the vehicle file: sensors[1].range_m: reaches 0 % of the wall";
    let all = format!("{}{}", answer.stdout, answer.stderr);
    assert!(all.contains(said), "{all}");
    folder.write("vehicle.toml", VEHICLE);
    let answer = folder.headrace(&["run", "vehicle.toml", "--no-page", "--no-record", "--for", "0.5"]);
    assert!(!format!("{}{}", answer.stdout, answer.stderr).contains("WRONG"));
}

#[test]
fn walls_out_of_range_and_heads_out_of_phase_are_reported() {
    let first = "0.4:4040\"\nmode = \"fastest\"\nrange_m = 5";
    let second = "0.5:4040\"\nmode = \"fastest\"\nrange_m = 5";
    let both = |with: &str| [first.replace("range_m = 5", with), second.replace("range_m = 5", with)];
    let [short_one, short_other] = both("range_m = 3");
    let [least_one, least_other] = both("range_m = 2");
    let slower = second.replace("fastest", "slow");
    let cases: [(&str, &[(&str, &str)]); 7] = [
        ("as it is", &[]),
        ("a range of 3 m in a tunnel of 6 m", &[(first, &short_one), (second, &short_other)]),
        ("a range of 2 m there", &[(first, &least_one), (second, &least_other)]),
        ("a tunnel of 14 m", &[("radius_m = 3\n", "radius_m = 7\n")]),
        ("a small tunnel", &[("radius_m = 3\n", "radius_m = 0.4\n")]),
        ("heads in two modes", &[(second, &slower)]),
        ("negative counts", &[("counts_per_metre = 2000", "counts_per_metre = -2000")]),
    ];
    insta::assert_snapshot!(findings(&cases), @"
    as it is: 0
    headrace: warning: vehicle.toml:15: sensors: have no connect, so `run` can't reach them: ping_left, ping_right, ping_up, ping_down, depth, imu, tether
    a range of 3 m in a tunnel of 6 m: 2
    headrace: vehicle.toml:20: sensors[0].range_m: reaches 0 % of the wall around this head: the wall is 3.00 to 3.00 m away, and the setting covers 0.19 to 2.89 m; out of reach: all around
    headrace: vehicle.toml:27: sensors[1].range_m: reaches 0 % of the wall around this head: the wall is 3.00 to 3.00 m away, and the setting covers 0.19 to 2.89 m; out of reach: all around
    headrace: warning: vehicle.toml:15: sensors: have no connect, so `run` can't reach them: ping_left, ping_right, ping_up, ping_down, depth, imu, tether
    a range of 2 m there: 2
    headrace: vehicle.toml:20: sensors[0].range_m: reaches 0 % of the wall around this head: the wall is 3.00 to 3.00 m away, and the setting covers 0.19 to 1.93 m; out of reach: all around
    headrace: vehicle.toml:27: sensors[1].range_m: reaches 0 % of the wall around this head: the wall is 3.00 to 3.00 m away, and the setting covers 0.19 to 1.93 m; out of reach: all around
    headrace: warning: vehicle.toml:15: sensors: have no connect, so `run` can't reach them: ping_left, ping_right, ping_up, ping_down, depth, imu, tether
    a tunnel of 14 m: 2
    headrace: vehicle.toml:20: sensors[0].range_m: reaches 0 % of the wall around this head: the wall is 7.00 to 7.00 m away, and the setting covers 0.19 to 4.82 m; out of reach: all around
    headrace: vehicle.toml:27: sensors[1].range_m: reaches 0 % of the wall around this head: the wall is 7.00 to 7.00 m away, and the setting covers 0.19 to 4.82 m; out of reach: all around
    headrace: warning: vehicle.toml:15: sensors: have no connect, so `run` can't reach them: ping_left, ping_right, ping_up, ping_down, depth, imu, tether
    a small tunnel: 0
    headrace: warning: vehicle.toml:15: sensors: have no connect, so `run` can't reach them: ping_left, ping_right, ping_up, ping_down, depth, imu, tether
    heads in two modes: 0
    headrace: warning: vehicle.toml:12: heads: can't interleave: the heads' turns take 3.80 s, 13.60 s; give all heads the same mode and range_m
    headrace: warning: vehicle.toml:15: sensors: have no connect, so `run` can't reach them: ping_left, ping_right, ping_up, ping_down, depth, imu, tether
    negative counts: 0
    headrace: warning: vehicle.toml:15: sensors: have no connect, so `run` can't reach them: ping_left, ping_right, ping_up, ping_down, depth, imu, tether
    headrace: warning: vehicle.toml:61: sensors[8].counts_per_metre: is negative: the count falls as cable is paid out; make it positive if it rises
    ");
}

#[test]
fn check_and_plan_give_the_same_figures() {
    let folder = Folder::new();
    for name in ["vita1", "vita2-2", "vita2-3", "vita2-4", "pipe", "autopilot", "bluerov2"] {
        let file = root().join(format!("deploy/vehicles/{name}.toml"));
        let file = file.to_str().unwrap();
        let json = |arguments: &[&str]| -> Value {
            let answer = folder.headrace(arguments);
            assert_eq!(answer.code, Some(0), "{name}: {}", answer.stderr);
            serde_json::from_str(&answer.stdout).unwrap()
        };
        let checked = json(&["check", file, "--json"]);
        assert_eq!(checked["errors"], serde_json::json!([]), "{name}");
        let own = &checked["plan"]["own"];
        let planned = json(&["plan", "--vehicle", file, "--json"]);
        let modes = planned["modes"].as_array().unwrap();
        let same = modes.iter().find(|mode| mode["mode"] == own["mode"]).unwrap();
        assert!(own["v_max_mps"].as_f64().is_some_and(|v_max_mps| v_max_mps > 0.0), "{name}: {own}");
        assert_eq!((&own["v_max_mps"], &own["needed_h"]), (&same["v_max_mps"], &same["needed_h"]), "{name}");
        let hidden = |strips: &Value, width: &str| -> Vec<(String, f64)> {
            let strips = strips.as_array().unwrap().iter();
            strips
                .map(|one| (one["clock"].as_str().unwrap().to_owned(), one[width].as_f64().unwrap()))
                .collect()
        };
        let strips = hidden(&checked["plan"]["hidden"], "width_m");
        assert_eq!(strips, hidden(&planned["briefing"]["strips"], "width_m"), "{name}");
        let words = folder.headrace(&["check", file]).stdout;
        for (clock, _) in strips {
            assert!(words.contains(&clock), "{name}: {clock} is not in {words}");
        }
    }
}

#[test]
fn shipped_scenes_have_no_errors() {
    let folder = Folder::new();
    let scenes = root().join("deploy/scenes");
    let mut checked = 0;
    for entry in std::fs::read_dir(scenes).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "toml") {
            let answer = folder.headrace(&["check", path.to_str().unwrap()]);
            assert_eq!(answer.code, Some(0), "{}: {}", path.display(), answer.stderr);
            assert!(answer.stdout.contains("plan in "), "{}", answer.stdout);
            checked += 1;
        }
    }
    assert!(checked > 5);
}

#[test]
fn json_has_every_error_with_its_line() {
    let folder = Folder::new();
    folder.write(
        "vehicle.toml",
        changed(VEHICLE, &[("target_m = 1.2", "target_cm = 120"), ("id = \"imu\"", "id = \"an imu\"")]),
    );
    let answer = folder.headrace(&["check", "vehicle.toml", "--json"]);
    assert_eq!(answer.code, Some(2));
    let errors: Value = serde_json::from_str(&answer.stdout).unwrap();
    let errors = errors["errors"].as_array().unwrap();
    let line = |text: &str| VEHICLE.lines().position(|line| line.contains(text)).unwrap() + 1;
    assert_eq!(errors.len(), 2, "{errors:?}");
    assert_eq!((&errors[0]["line"], &errors[0]["key"]), (&line("target_m").into(), &"target_cm".into()));
    assert_eq!(errors[1]["line"], line("id = \"imu\""));
}

/// CSV text of a surveyed profile: a circle with a radius of 3 m and `points` points.
fn surveyed(points: u32) -> String {
    let mut text = "y_m,z_m\n".to_owned();
    for k in 0..points {
        let (sin, cos) = math::sin_cos(math::TAU * (f64::from(k) + 0.5) / f64::from(points));
        writeln!(text, "{:.6},{:.6}", 3.0 * sin, 3.0 - 3.0 * cos).unwrap();
    }
    text
}

#[test]
fn profile_finer_than_the_sonar_resolution_is_reported() {
    let folder = Folder::new();
    let tunnel = changed(
        VEHICLE,
        &[("profile = \"circle\"\nradius_m = 3\n", "profile = \"polyline\"\nfile = \"wall.csv\"\n")],
    );
    folder.write("vehicle.toml", tunnel);
    let mut said = String::new();
    for points in [600, 20_000] {
        folder.write("wall.csv", surveyed(points));
        let answer = folder.headrace(&["check", "vehicle.toml"]);
        assert_eq!(answer.code, Some(0));
        let mut lines = answer.stderr.lines().filter(|line| line.contains("tunnel.file"));
        writeln!(said, "{points} points: {}", lines.next_back().unwrap_or("nothing")).unwrap();
    }
    insta::assert_snapshot!(said, @"
    600 points: nothing
    20000 points: headrace: warning: vehicle.toml:6: tunnel.file: has 19999 of 20000 edges shorter than 2 mm, the finest range step of a sonar; the first is 0.943 mm long, at 0.000 m round the wall (6:00); the direction of such short edges is survey noise, and points every 10 mm are enough
    ");
}

#[test]
fn too_many_sensors_give_the_same_error_in_check_and_run() {
    let folder = Folder::with_dive();
    let with = |count: usize| {
        let mut text = VEHICLE.to_owned();
        for number in VEHICLE.matches("[[sensors]]").count()..count {
            write!(text, "\n[[sensors]]\nid = \"depth_{number}\"\nplugin = \"bar100\"\n").unwrap();
        }
        folder.write("many.toml", text);
    };
    let commands: [&[&str]; 3] = [
        &["check", "many.toml"],
        &["replay", "dive.mcap", "--vehicle", "many.toml"],
        &["run", "many.toml", "--source", "dive.mcap", "--speed", "max"],
    ];
    for (count, code) in [(64, 0), (65, 2)] {
        with(count);
        for command in commands {
            let answer = folder.headrace(command);
            assert_eq!(answer.code, Some(code), "{count}, {command:?}: {}", answer.stderr);
            assert_eq!(answer.stderr.contains("64"), code == 2, "{count}, {command:?}: {}", answer.stderr);
        }
    }
    let answer = folder.headrace(&["check", "many.toml"]);
    assert!(answer.stderr.contains("many.toml:284: sensors[64].id: 65 sensors"), "{}", answer.stderr);
}

/// At the start of a dive, the phases of the heads are set for the planned speed in the vehicle file. The speed limit
/// from `check` is the limit for heads with these phases. `run` gives the same limit.
#[test]
fn check_gives_the_speed_limit_for_head_phases_of_the_planned_speed() {
    let folder = Folder::new();
    let vita = std::fs::read_to_string(root().join("deploy/vehicles/vita2-4.toml")).unwrap();
    let planned = |mps: &str| {
        let text = changed(&vita, &[("planned_speed_mps = 0.10\n", &format!("planned_speed_mps = {mps}\n"))]);
        folder.write("vehicle.toml", text);
        folder.headrace(&["check", "vehicle.toml"])
    };
    let usual = planned("0.10");
    assert!(
        usual.stdout.contains("with heads started for the planned 0.1 m/s: at most 0.102 m/s"),
        "{}",
        usual.stdout
    );
    assert!(!usual.stderr.contains("planned_speed_mps"), "{}", usual.stderr);
    let most = planned("0.1129");
    assert!(most.stderr.contains("0.1129, which leaves no margin"), "{}", most.stderr);
    assert_eq!((usual.code, most.code), (Some(0), Some(0)));
}

#[test]
fn check_lists_cable_and_speed_limits_and_missing_keys() {
    let folder = Folder::new();
    let slack = "[navigation]\nslack_sd_m = 0.2\nslack_time_s = 5\n\n[[sensors]]\nid = \"sonar_0\"";
    let counts = "counts_per_metre = 2000";
    let cases: [(&str, Vec<(&str, &str)>); 4] = [
        ("nothing said", vec![]),
        ("slack said", vec![("[[sensors]]\nid = \"sonar_0\"", slack)]),
        ("a wheel with magnets", vec![(counts, "preset = \"magnet_wheel\"")]),
        ("steps of 5 cm", vec![(counts, "counts_per_metre = 2000\nstep_m = 0.05")]),
    ];
    let mut said = String::new();
    for (what, changes) in cases {
        folder.write("vehicle.toml", changed(VEHICLE, &changes));
        let answer = folder.headrace(&["check", "vehicle.toml"]);
        let line = answer.stdout.lines().find(|line| line.starts_with("cable: ")).unwrap();
        writeln!(said, "{what}: {line}").unwrap();
    }
    insta::assert_snapshot!(said, @"
    nothing said: cable: steps of 0.5 mm, slack of 0.06 m (sd) in 2.5 s; at 0.200 m/s a hole is measured to 0.097 m (sd), so holes up to 1.01 m pass; missing from the file: navigation.slack_sd_m, navigation.slack_time_s, sensors[8].step_m
    slack said: cable: steps of 0.5 mm, slack of 0.2 m (sd) in 5 s; at 0.200 m/s a hole is measured to 0.194 m (sd), so holes up to 0.81 m pass; missing from the file: sensors[8].step_m
    a wheel with magnets: cable: steps of 10 mm, slack of 0.06 m (sd) in 2.5 s; at 0.200 m/s a hole is measured to 0.102 m (sd), so holes up to 1.00 m pass; missing from the file: navigation.slack_sd_m, navigation.slack_time_s
    steps of 5 cm: cable: steps of 50 mm, slack of 0.06 m (sd) in 2.5 s; at 0.200 m/s a hole is measured to 0.119 m (sd), so holes up to 0.96 m pass; missing from the file: navigation.slack_sd_m, navigation.slack_time_s
    ");
}
