//! `headrace setup` writes a vehicle file for emulated devices, and `headrace check --devices` tests them.

use headrace_config::Document;
use headrace_devices::KINDS;
use headrace_tests::Folder;
use headrace_tests::screen::Screen;
use headrace_vehicle::VehicleConfig;
use serde_json::Value;

use crate::rehearsal::{emulate, scene};
use crate::rehearsal_faults::Piped;

/// A depth sensor on a port that nobody uses.
const DEPTH: &str = "bar100=udp:127.0.0.1:9";
/// Answers to all questions about a vehicle without sonars.
const ANSWERS: [&str; 6] = ["--tunnel", "circle,radius_m=2", "--length", "100", "--target", "0.5"];

/// Arguments of `setup` for the devices of a vehicle file. The arguments name the devices that can't be probed.
fn arguments(vehicle: &VehicleConfig) -> Vec<String> {
    let mut arguments: Vec<String> =
        ["setup", "--tunnel", "ceran", "--length", "100", "--target", "0.7"].map(str::to_owned).into();
    let mut ids: Vec<String> = Vec::new();
    for config in &vehicle.sensor_configs {
        let (plugin, connect) = (config.plugin.as_str(), config.connect.as_str());
        let port = match plugin {
            "imu_can" => format!("{plugin}={connect},preset=xsens_mti600"),
            "tether_hid" => format!("{plugin}={connect},counts_per_metre=2000"),
            "bar100" => format!("{plugin}={connect}"),
            _ => connect.to_owned(),
        };
        arguments.extend(["--port".to_owned(), port]);
        let numbered =
            |stem: &str| format!("{stem}_{}", ids.iter().filter(|id| id.starts_with(stem)).count());
        let id = match plugin {
            "imagenex881" => numbered("sonar"),
            "ping1d" => numbered("ping"),
            _ => continue,
        };
        let [x, y, z] = [config.mount.position.x(), config.mount.position.y(), config.mount.position.z()];
        let direction = match config.id.as_str() {
            "sonar_0" | "sonar_1" => "ahead",
            "sonar_2" | "sonar_3" => "aft",
            ping => ping.trim_start_matches("ping_"),
        };
        arguments.extend(["--mount".to_owned(), format!("{id}={x},{y},{z},{direction}")]);
        ids.push(id);
    }
    arguments
}

#[test]
fn written_vehicle_file_passes_check_and_runs_with_every_device() {
    let folder = Folder::new();
    folder.write("scene.toml", scene(60.0));
    let (_emulate, _said, emulated) = emulate(&folder, &folder.path("scene.toml"));
    let text = std::fs::read_to_string(&emulated).unwrap();
    let parsed =
        VehicleConfig::parse(Document::new("vehicle.toml", &text), &KINDS, &|_| unreachable!()).unwrap();
    let arguments = arguments(&parsed);
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let answer = folder.headrace(&arguments);
    assert_eq!(answer.code, Some(0), "{}{}", answer.stdout, answer.stderr);
    assert!(answer.stdout.contains("\nno errors"), "{}", answer.stdout);
    let written = String::from_utf8(folder.read("vehicle.toml")).unwrap();
    let ports = parsed.sensor_configs.iter();
    let masked = ports
        .fold(written.clone(), |text, config| text.replace(&config.connect, &format!("<{}>", config.id)));
    insta::assert_snapshot!("vehicle_file_by_setup", masked);

    assert_eq!(folder.headrace(&["check", "vehicle.toml"]).code, Some(0));
    let has_all = |report: &Value| {
        let sources = report["sources"].as_array().unwrap();
        sources.len() == 11 && sources.iter().all(|source| source["readings"].as_u64() > Some(0))
    };
    let (_, report) = folder.dive_until(&["vehicle.toml", "--no-record"], has_all);
    assert!(has_all(&report), "{report}");

    let again = folder.headrace(&arguments);
    assert_eq!(again.code, Some(2), "{}", again.stdout);
    assert!(again.stderr.contains("it exists") && again.stderr.contains("--force"), "{}", again.stderr);
    assert_eq!(folder.read("vehicle.toml"), written.as_bytes());
}

#[test]
fn missing_answers_without_terminal_are_an_error_that_names_the_options() {
    let folder = Folder::new();
    let answer = folder.headrace(&["setup", "--port", DEPTH, "--port", "ping1d=udp:127.0.0.1:9"]);
    assert_eq!(answer.code, Some(2), "{}", answer.stdout);
    insta::assert_snapshot!(answer.stderr, @"headrace: setup: there is no terminal to ask on; give the answers as options: --tunnel circle,radius_m=2; --length METRES; --target METRES; --mount ping_0=X,Y,Z,DIRECTION");
    let answer = folder.headrace(&["setup", "--port", "imu_can=can:can0"]);
    assert!(answer.stderr.contains("--port imu_can=can:can0,preset=... (xsens_mti600,"), "{}", answer.stderr);
    assert!(!folder.path("vehicle.toml").exists());
}

#[test]
fn wrong_answers_are_errors_with_value_and_allowed_range() {
    let folder = Folder::new();
    let mut shown = String::new();
    for wrong in [
        ["--target", "0"],
        ["--length", "0"],
        ["--tunnel", "oval"],
        ["--tunnel", "circle,radius_m=0"],
        ["--tunnel", "circle"],
        ["--port", "tcp:10.0.0.1"],
        ["--mount", "depth=0,0,50,ahead"],
        ["--mount", "sonar_7=0,0,0,ahead"],
    ] {
        // clap accepts each of these options only once, so the wrong value replaces the good one.
        let good = ANSWERS.chunks(2).filter(|answer| answer[0] != wrong[0]).flatten();
        let arguments: Vec<&str> =
            ["setup", "--port", DEPTH].iter().chain(good).chain(&wrong).copied().collect();
        let answer = folder.headrace(&arguments);
        assert_eq!(answer.code, Some(2), "{wrong:?}: {}", answer.stdout);
        shown += answer.stderr.lines().next().unwrap();
        shown += "\n";
    }
    assert!(!folder.path("vehicle.toml").exists());
    insta::assert_snapshot!(shown, @r#"
    error: invalid value '0' for '--target <METRES>': expected a number from 0.01 to 20 metres
    error: invalid value '0' for '--length <METRES>': expected a number from 0.1 to 100000 metres
    headrace: --tunnel:1: profile = "oval": must be one of ceran, ceran-blueprint, rectangle, circle, arch, trimmed_circle, polyline
    headrace: --tunnel:2: radius_m = 0: must be a number from 0.1 to 200
    headrace: --tunnel:1: radius_m: is missing
    error: invalid value 'tcp:10.0.0.1' for '--port <[PLUGIN=]CONNECT[,KEY=VALUE]..>': connect = "tcp:10.0.0.1": there is no port; allowed is tcp:192.168.0.5:4040
    error: invalid value 'depth=0,0,50,ahead' for '--mount <ID=X,Y,Z,DIRECTION>': "50" isn't a number from -20 to 20 metres
    headrace: --mount sonar_7: no such device; expected one of depth
    "#);
}

#[test]
fn questions_on_a_terminal_are_repeated_until_the_answer_is_allowed() {
    let folder = Folder::new();
    let mut screen = Screen::run(&folder, &["setup", "--port", DEPTH], 120, &[]);
    for (question, answer) in [
        ("Another device", &b"\n"[..]),
        ("Tunnel", b"oval\n"),
        ("must be one of ceran", b"circle,radius_m=2\n"),
        ("Length of the tunnel", b"100\n"),
        ("Target", b"0\n"),
        ("expected a number from 0.01 to 20 metres", b"0.5\n"),
    ] {
        screen.until(question);
        screen.press(answer);
    }
    screen.until("next: headrace check vehicle.toml --devices");
    let (code, shown) = screen.end();
    assert_eq!(code, Some(0), "{shown}");
    let written = String::from_utf8(folder.read("vehicle.toml")).unwrap();
    assert!(written.contains("target_m = 0.5") && written.contains("radius_m = 2"), "{written}");
}

#[test]
fn unplugged_head_fails_the_self_test() {
    let folder = Folder::new();
    let mut emulator = Piped::emulator(&folder);
    emulator.until("vehicle", "rehearsal");
    let mut check =
        Piped::start(&folder, &["check", "rehearsal/vehicle.toml", "--devices", "--for", "40", "--json"]);
    emulator.until("all sensors are connected", "");
    emulator.order("unplug sonar_1", "sonar_1", "unplugged");
    let (code, shown) = check.end();
    assert_eq!(code, Some(1), "{shown}");
    let json: Value = serde_json::from_str(&shown).unwrap();
    let devices = &json["devices"];
    assert_eq!(devices["ready"], false);
    let faults = devices["faults"].as_array().unwrap();
    let fault = faults.iter().find(|fault| fault["part"] == "sonar_1").unwrap();
    assert!(["LOST", "NO DATA"].contains(&fault["fault"].as_str().unwrap()), "{fault}");
    for sensor in devices["sensors"].as_array().unwrap() {
        let (measured, expected) = (&sensor["rate_hz"], sensor["expected_hz"].as_f64().unwrap());
        assert!(sensor["id"] == "sonar_1" || measured.as_f64() > Some(0.3 * expected), "{sensor}");
        assert!(expected > 5.0, "{sensor}");
    }
    let noisy = devices["sensors"][0]["noise"][0]["source"].as_str();
    assert_eq!(noisy, Some("default"), "{devices}");
    assert!(
        !std::fs::read_dir(folder.path(""))
            .unwrap()
            .any(|file| { file.unwrap().file_name().to_string_lossy().starts_with("headrace-check") })
    );
}
