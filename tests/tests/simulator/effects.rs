//! The simulation of a scene has only the effects that the scene names. All other effects cost no time and change no
//! bit.

use std::collections::BTreeMap;

use headrace_tests::{Folder, SCENE, VEHICLE, raw_messages};
use serde_json::Value;

/// Messages that each source sends: time and bytes.
type Lines = BTreeMap<String, Vec<(u64, Vec<u8>)>>;

fn folder() -> Folder {
    let folder = Folder::new();
    folder.write("vehicle.toml", VEHICLE);
    folder
}

/// Messages that each source sends in the short dive with the simulator effects `effects`.
fn lines(folder: &Folder, effects: &str, further: &[&str]) -> Lines {
    folder.write("scene.toml", format!("{SCENE}\n[effects]\n{effects}\n"));
    let arguments = [&["simulate", "scene.toml", "-o", "dive.mcap"], further].concat();
    let answer = folder.headrace(&arguments);
    assert_eq!(answer.code, Some(0), "{effects}: {}", answer.stderr);
    let mut lines = Lines::new();
    for message in raw_messages(&folder.read("dive.mcap")) {
        let line = lines.entry(message.channel.topic.clone()).or_default();
        line.push((message.log_time, message.data.to_vec()));
    }
    lines
}

fn explained(folder: &Folder, effects: &str) -> Value {
    folder.write("scene.toml", format!("{SCENE}\n[effects]\n{effects}\n"));
    let answer = folder.headrace(&["simulate", "scene.toml", "--explain", "--json"]);
    assert_eq!(answer.code, Some(0), "{effects}: {}", answer.stderr);
    serde_json::from_str(&answer.stdout).unwrap()
}

#[test]
fn effect_changes_only_its_own_sensors() {
    let folder = folder();
    let plain = lines(&folder, "", &[]);
    assert_eq!(plain.len(), 9);
    for (effect, touches) in [
        ("range_noise = { sd_m = 0.05, sensors = [\"sonar_1\"] }", "/raw/sonar_1"),
        ("range_noise = { sd_m = 0.05, sensors = [\"ping_up\"] }", "/raw/ping_up"),
        ("depth_steps = { quantum_m = 0.7 }", "/raw/depth"),
        ("imu_noise = { gyro_degps_rthz = 0.1 }", "/raw/imu"),
        ("tether_quantum = { quantum_m = 0.01 }", "/raw/tether"),
        ("byte_errors = { flipped_per_million = 2000, sensors = [\"tether\"] }", "/raw/tether"),
    ] {
        let with = lines(&folder, effect, &[]);
        for (topic, line) in &plain {
            assert_eq!(with[topic] == *line, topic != touches, "{effect}: {topic}");
        }
    }
}

#[test]
fn random_draws_of_an_effect_do_not_depend_on_others() {
    let folder = folder();
    let noise = "range_noise = { sd_m = 0.05, sensors = [\"sonar_0\"] }";
    let alone = lines(&folder, noise, &[]);
    let others = "imu_noise = { gyro_degps_rthz = 0.1 }\ndepth_steps = {}\ntether_slack = {}\n\
                  missing_returns = { share = 0.3, sensors = [\"sonar_1\"] }";
    let together = lines(&folder, &format!("{others}\n{noise}"), &[]);
    assert_eq!(alone["/raw/sonar_0"], together["/raw/sonar_0"]);
    assert_ne!(alone["/raw/imu"], together["/raw/imu"]);
    // The order in which the scene names the effects doesn't matter either.
    assert_eq!(lines(&folder, &format!("{noise}\n{others}"), &[]), together);
}

#[test]
fn same_seed_repeats_the_dive_and_another_changes_it() {
    let folder = folder();
    let effects = "range_noise = { sd_m = 0.05 }\nmissing_returns = { share = 0.1 }";
    let first = lines(&folder, effects, &["--seed", "7"]);
    assert_eq!(lines(&folder, effects, &["--seed", "7"]), first);
    assert_ne!(lines(&folder, effects, &["--seed", "8"]), first);
    let written = format!("{SCENE}\n[effects]\n{effects}\n").replace("name =", "seed = 7\nname =");
    folder.write("scene.toml", written);
    folder.simulate("scene.toml", "dive.mcap");
    let log = folder.read("dive.mcap");
    let sonar = raw_messages(&log).into_iter().filter(|m| m.channel.topic == "/raw/sonar_0");
    let sonar: Vec<_> = sonar.map(|m| (m.log_time, m.data.to_vec())).collect();
    assert_eq!(sonar, first["/raw/sonar_0"]);
}

#[test]
fn truth_output_does_not_change_the_log() {
    let folder = folder();
    let effects = "motion_within_turn = {}\nrange_noise = { sd_m = 0.05 }\nline_delay = { jitter_ms = 3 }";
    let plain = lines(&folder, effects, &[]);
    assert_eq!(lines(&folder, effects, &["--truth", "truth.csv"]), plain);
    let truth = String::from_utf8(folder.read("truth.csv")).unwrap();
    let mut rows = truth.lines().skip_while(|line| line.starts_with('#'));
    let columns: Vec<&str> = rows.next().unwrap().split(',').collect();
    let column = |name: &str| columns.iter().position(|column| *column == name).unwrap();
    let rows: Vec<Vec<&str>> = rows.map(|row| row.split(',').collect()).collect();
    assert!(rows.iter().all(|row| row.len() == columns.len()));
    // Every ping in the log has a row in the table of the ground truth.
    let pings = rows.iter().filter(|row| row[column("source")] == "sonar_0").count();
    assert_eq!(pings, plain["/raw/sonar_0"].len());
    let number = |row: &Vec<&str>, name| row[column(name)].parse::<f64>().unwrap();
    for row in rows.iter().filter(|row| row[column("sense")] == "profiling_head") {
        // The tunnel is a circle with a radius of 3 m, so its centre is 3 m above the floor.
        let (y, z) = (number(row, "wall_y_m"), number(row, "wall_z_m"));
        assert!((headrace_geometry::math::hypot(y, z - 3.0) - 3.0).abs() < 1e-9, "{row:?}");
        let noise = number(row, "measured_range_m") - number(row, "true_range_m");
        assert!(noise.abs() < 0.05 * 6.0 && row[column("effects")].contains("range_noise range_m"));
    }
}

#[test]
fn only_named_effects_have_systems_components_and_streams() {
    let folder = folder();
    let none = explained(&folder, "");
    assert_eq!(none["effects"].as_array().unwrap().len(), 0);
    let base = none["base"].as_array().unwrap().len();
    let left_out = none["left_out"].as_array().unwrap().len();
    let noise = explained(&folder, "range_noise = { sd_m = 0.05, sensors = [\"sonar_1\"] }");
    assert_eq!(noise["base"].as_array().unwrap().len(), base);
    assert_eq!(noise["left_out"].as_array().unwrap().len(), left_out - 1);
    let [effect] = &noise["effects"].as_array().unwrap()[..] else { panic!("{noise}") };
    assert_eq!(effect["effect"], "range_noise");
    assert_eq!(effect["systems"].as_array().unwrap().len(), 1);
    assert_eq!(effect["components"][0]["sensors"], serde_json::json!(["sonar_1"]));
    assert_eq!(effect["streams"], serde_json::json!(["sonar_1"]));
    // Without the effect `motion_within_turn`, a base system aims a head from the pose at the start of each turn. The
    // effect replaces this system.
    let moving = explained(&folder, "motion_within_turn = {}");
    assert_eq!(moving["base"].as_array().unwrap().len(), base - 1);
    assert_eq!(moving["effects"][0]["replaces"], serde_json::json!(["aim_held"]));
}

/// Effects that a scene's descriptions imply are listed with their reasons. They are simulated only if the scene
/// requests them.
#[test]
fn implied_effects_are_listed_with_reasons_and_simulated_only_on_request() {
    let folder = folder();
    let names = |list: &Value| -> Vec<String> {
        let of = |entry: &Value| entry["effect"].as_str().unwrap().to_owned();
        list.as_array().unwrap().iter().map(of).collect()
    };
    let only = explained(&folder, "");
    let called = names(&only["called"]);
    assert!(
        called.contains(&"occlusion".to_owned()) && called.contains(&"imu_bias".to_owned()),
        "{called:?}"
    );
    assert!(only["called"].as_array().unwrap().iter().all(|call| call["fate"] == "not taken"));
    let taken =
        explained(&folder, "take = \"called\"\nleave = [\"beam_cone\"]\nimu_bias = { gyro_degps = 0.1 }");
    let simulated = names(&taken["effects"]);
    let expected: Vec<String> = called.into_iter().filter(|name| name != "beam_cone").collect();
    assert_eq!(simulated, expected);
    let fate = |name: &str| {
        let list = taken["called"].as_array().unwrap();
        list.iter().find(|call| call["effect"] == name).unwrap()["fate"].clone()
    };
    assert_eq!(
        (fate("beam_cone"), fate("imu_bias"), fate("occlusion")),
        ("left".into(), "as named".into(), "taken".into())
    );
    // If no effect uses the descriptions of water and cable, they change no byte.
    let plain = lines(&folder, "", &[]);
    let described = "\n[water]\ntemperature_degc = 4\n[[water.murk]]\nfrom_m = 1\nto_m = 9\nsilt_gpl = 3\n[cable]\nslack_m = 1\n";
    assert_eq!(lines(&folder, described, &[]), plain);
}

/// The report must show that one effect has no influence and another has a large influence. It must also show the CPU
/// time of each effect.
#[test]
fn explain_worth_option_reports_which_effects_change_the_result() {
    let folder = folder();
    let effects = "motion_within_turn = {}\nimu_noise = { gyro_degps_rthz = 1e-7 }\nmissing_returns = { share = 0.5, mean_run = 9 }";
    folder.write("scene.toml", format!("{SCENE}\n[effects]\n{effects}\n"));
    let answer = folder.headrace(&["simulate", "scene.toml", "--explain=worth", "--seeds", "3", "--json"]);
    assert_eq!(answer.code, Some(0), "{}", answer.stderr);
    let explained: Value = serde_json::from_str(&answer.stdout).unwrap();
    let worth = &explained["worth"];
    assert_eq!(worth["seeds"], 3);
    let of = |name: &str| {
        let each = worth["each"].as_array().unwrap();
        each.iter().find(|out| out["effects"] == serde_json::json!([name])).unwrap().clone()
    };
    assert_eq!(of("imu_noise")["is_free"], true, "{worth}");
    let lost = of("missing_returns");
    assert!(lost["is_free"] == false && lost["hole_m"]["mean"].as_f64().unwrap() < -0.02, "{lost}");
    let spared = worth["spared"]["effects"].as_array().unwrap();
    assert!(spared.contains(&"imu_noise".into()) && !spared.contains(&"missing_returns".into()), "{worth}");
    // With a single seed, the report can't state a confidence interval.
    let one = folder.headrace(&["simulate", "scene.toml", "--explain=worth", "--seeds", "1"]);
    assert!(one.code == Some(2) && one.stderr.contains("seeds"), "{}", one.stderr);
}

/// Checks that the simulation of a scene exits with code 2 and prints the words `words`.
#[track_caller]
fn refused(scene: &str, words: &[&str]) {
    let folder = folder();
    folder.write("scene.toml", scene);
    folder.refuses_scene(words);
}

#[test]
fn contradictory_scene_is_refused_with_the_place() {
    let scene = |rest: &str| format!("{SCENE}\n{rest}\n");
    refused(&scene("[effects]\nfog = {}"), &["scene.toml:12: effects.fog: is not a key here", "range_noise"]);
    let missing = "[effects.range_noise]\nsd_m = 0.1\nsensors = [\"sonar_9\"]";
    refused(&scene(missing), &["scene.toml:13: effects.range_noise.sensors", "sonar_9", "sonar_0, sonar_1"]);
    let twice =
        "[[effects.range_noise]]\nsd_m = 0.1\n[[effects.range_noise]]\nsd_m = 0.2\nsensors = [\"sonar_0\"]";
    refused(&scene(twice), &["sonar_0", "an earlier table"]);
    refused(&scene("[effects.range_noise]\nsd_m = -1"), &["scene.toml:12", "must be a number from 0 to 1"]);
    let waypoints = "name = \"x\"\nvehicle = \"vehicle.toml\"\n[trajectory]\nkind = \"waypoints\"\n\
                     [[trajectory.waypoints]]\nchainage_m = 1\n[[trajectory.waypoints]]\nchainage_m = 9\nspeed_mps = 0.2\n";
    refused(&format!("{waypoints}place_m = [4, 3]\n"), &["trajectory.waypoints[1].place_m", "inside"]);
    let current = format!("{waypoints}[effects]\ncurrent = {{ speed_mps = 0.1 }}\n");
    refused(&current, &["current", "over ground"]);
    let boulder = "[[tunnel.features]]\nkind = \"boulder\"\nchainage_m = 5\nsize_m = 5.9\nsunk = 0";
    refused(&scene(boulder), &["leads through boulder", "chainage"]);
    let changes = "[vehicle_changes]\nheads.layuot = \"sector_offset\"";
    refused(&scene(changes), &["vehicle_changes.heads.layuot", "is not in the vehicle file"]);
}

#[test]
fn effect_without_its_sensor_is_refused() {
    let folder = folder();
    let (without, _) = VEHICLE.split_once("[[sensors]]\nid = \"imu\"").unwrap();
    folder.write("vehicle.toml", without);
    folder.write("scene.toml", format!("{SCENE}\n[effects]\nimu_noise = {{ gyro_degps_rthz = 0.1 }}\n"));
    let answer = folder.headrace(&["simulate", "scene.toml", "-o", "dive.mcap"]);
    assert_eq!(answer.code, Some(2));
    assert!(answer.stderr.contains("scene.toml:12: effects.imu_noise"), "{}", answer.stderr);
    assert!(answer.stderr.contains("the vehicle has no inertial unit"), "{}", answer.stderr);
}

#[test]
#[cfg(not(feature = "mesh"))]
fn build_without_meshes_refuses_mesh_scenes() {
    let mesh = "[[tunnel.features]]\nkind = \"mesh\"\nfile = \"rock.ply\"";
    refused(
        &format!("{SCENE}\n{mesh}\n"),
        &["scene.toml:12: tunnel.features[0].kind = \"mesh\"", "cargo build --features mesh"],
    );
}

#[test]
fn report_finds_the_simulated_clock_drifts() {
    let folder = Folder::new();
    folder
        .write("vehicle.toml", VEHICLE.replace("counts_per_metre", "clock_ms_offset = 7\ncounts_per_metre"));
    let jitter = "line_delay = { jitter_ms = 2 }";
    for (ppm, of_one) in [(250.0, 400.0), (-400.0, -250.0)] {
        let drift = format!(
            "[[effects.clock_drift]]\nppm = {ppm:?}\nsensors = [\"imu\"]\n\
             [[effects.clock_drift]]\nppm = {of_one:?}\nsensors = [\"tether\"]"
        );
        lines(&folder, &format!("{jitter}\n{drift}"), &[]);
        let (_, report) = folder.replay("dive.mcap", &[]);
        for (id, ppm) in [("imu", ppm), ("tether", of_one)] {
            let sources = report["sources"].as_array().unwrap();
            let clock = &sources.iter().find(|source| source["id"] == id).unwrap()["device_clock"];
            let number = |key: &str| clock[key].as_f64().unwrap();
            assert_eq!((&clock["restarts"], &clock["jumps"]), (&0.into(), &0.into()), "{id}");
            // The effect makes a device's seconds too long, so the device's clock is slow and the drift has the
            // opposite sign.
            let (error, sd) = (number("drift_ppm") + ppm, number("drift_sd_ppm"));
            assert!(error.abs() < 5.0 * sd && sd < 30.0, "{id}: {clock}");
        }
        let depth = report["sources"].as_array().unwrap().iter().find(|source| source["id"] == "depth");
        assert!(depth.unwrap()["device_clock"].is_null());
    }
}

/// If the speed of sound in the vehicle file is wrong by 3.7 %, the wall shifts by 11 cm. The temperature that the
/// depth sensor measures corrects the speed, and the wall is then right.
#[test]
fn water_temperature_corrects_a_wrong_speed_of_sound() {
    let folder = folder();
    // The emulated depth sensor is in water of 10 degrees. Sound travels there at 1447.3 m/s, and slightly faster at
    // greater depth.
    let effects = "motion_within_turn = {}\nsound_speed_error = { true_mps = 1448.1 }\n";
    let mean_m = |water: &str| {
        folder.write("vehicle.toml", VEHICLE.replace("sound_speed_mps = 1447", water));
        folder.write("scene.toml", format!("{SCENE}\n[effects]\n{effects}\n"));
        for arguments in [
            &["simulate", "scene.toml", "-o", "dive.mcap"][..],
            &["replay", "dive.mcap", "--report", "report.json"],
        ] {
            let answer = folder.headrace(arguments);
            assert_eq!(answer.code, Some(0), "{water}: {}", answer.stderr);
        }
        let report: Value = serde_json::from_slice(&folder.read("report.json")).unwrap();
        std::fs::remove_file(folder.path("dive.mcap")).unwrap();
        let sections = report["sections"].as_array().unwrap().iter();
        let off: Vec<f64> = sections.filter_map(|section| section["deviation"]["mean_m"].as_f64()).collect();
        let speeds = ["least", "most"]
            .map(|which| report["dive"][format!("sound_speed_{which}_mps")].as_f64().unwrap());
        (off.iter().sum::<f64>() / off.len() as f64, speeds)
    };
    let (wrong_m, [least_mps, most_mps]) = mean_m("sound_speed_mps = 1500");
    assert!(wrong_m.abs() > 0.05 && (least_mps, most_mps) == (1500.0, 1500.0), "{wrong_m}");
    let (right_m, [least_mps, most_mps]) = mean_m("sound_speed_mps = 1500\nsound_speed_from = \"depth\"");
    assert!(right_m.abs() < 0.01, "{right_m}");
    assert!((1447.0..1449.0).contains(&least_mps) && most_mps < 1449.0, "{least_mps} to {most_mps}");
}

/// Tells for each ping of a head whether the effect `effect` alone removes or displaces the ping's return.
fn touched(effect: &str) -> Vec<bool> {
    let ranges = |effects: &str| -> Vec<Option<f64>> {
        let scene = format!("{SCENE}\n[effects]\n{effects}\n");
        let scene = headrace_tests::scenes::scene_from(&scene, &|_| Ok(VEHICLE.into()));
        let mut simulation = headrace_simulator::Simulation::with_truth(&scene).unwrap();
        let mut ranges = Vec::new();
        while simulation.advance() {
            let rows = simulation.take_truth().into_iter().filter(|row| row.source == 0);
            ranges.extend(rows.filter_map(|row| Some(row.sounding?.measured.range_m)));
        }
        ranges
    };
    ranges("").iter().zip(ranges(effect)).map(|(was, is)| *was != is).collect()
}

#[test]
fn random_draws_of_two_effects_are_independent() {
    let share = |is: &[bool]| is.iter().filter(|is| **is).count() as f64 / is.len() as f64;
    let lost = touched("missing_returns = { share = 0.3, sensors = [\"sonar_0\"] }");
    let stray = touched("outliers = { share = 0.3, sensors = [\"sonar_0\"] }");
    assert!(lost.len() > 500 && (share(&lost) - 0.3).abs() < 0.1 && (share(&stray) - 0.3).abs() < 0.1);
    let both: Vec<bool> = lost.iter().zip(&stray).map(|(a, b)| *a && *b).collect();
    // If the two effects used the same random stream, both would change the same pings. With separate streams, both
    // change a share of 0.09, to within five standard deviations.
    let sd = (0.09_f64 * 0.91 / both.len() as f64).sqrt();
    assert!((share(&both) - 0.09).abs() < 5.0 * sd + 0.01, "{}", share(&both));
}
