//! Wrong settings are reported within a hundred metres of driving, with their right value. Correct settings aren't
//! reported.

use headrace_monitor::alert_list::SettingJson;
use headrace_simulator::Scene;
use headrace_tests::field_table::{Cell, Condition, Driven, VEHICLES};
use headrace_tests::{scenes, truth};

fn doubted(scene: &Scene, believed: &Scene) -> Option<SettingJson> {
    let report = truth::dive_believing(scene, &believed.vehicle).report;
    report.alert_list.iter().find_map(|alert| alert.setting.clone())
}

/// A vehicle file with one line replaced in one sensor's table.
fn changed(file: &str, sensor: &str, key: &str, value: &str) -> String {
    let head = format!("id = {sensor:?}");
    let at = file.find(&head).unwrap();
    let end = file[at..].find("\n[").map_or(file.len(), |end| at + end);
    let table = &file[at..end];
    let kept: Vec<&str> = table.lines().filter(|line| !line.starts_with(key)).collect();
    format!("{}{}\n{key} = {value}\n{}", &file[..at], kept.join("\n"), &file[end..])
}

fn sensor_line(file: &str, sensor: &str, key: &str) -> String {
    let at = file.find(&format!("id = {sensor:?}")).unwrap();
    let line = file[at..].lines().find(|line| line.starts_with(key)).unwrap();
    line.split(" = ").nth(1).unwrap().split('#').next().unwrap().trim().to_owned()
}

fn file(name: &str) -> String {
    String::from_utf8(headrace_tests::scenes::vehicle_file(name).unwrap()).unwrap()
}

const EFFECTS: &str = "motion_within_turn = {}\nocclusion = {}\ndepth_steps = {}\nrange_noise = { sd_m = 0.01 }\n\
     imu_noise = { gyro_degps_rthz = 0.007, accel_mps2_rthz = 0.001, attitude_deg = 0.3 }\n\
     imu_bias = { gyro_degps = 0.003, accel_mps2 = 0.002, tau_s = 300 }\n";

/// Returns the setting that is reported as wrong in a dive of 90 m with a pilot who wanders slightly. `truly` is the
/// vehicle file of the simulated vehicle, and `declared` is the vehicle file that headrace reads.
fn wrong_setting(truly: &str, declared: &str, aside_m: f64, seed: u64) -> Option<SettingJson> {
    doubt_while_swinging(truly, declared, [aside_m, 3.0], seed)
}

/// As [`wrong_setting`], but the pilot also yaws back and forth by up to `yaw_deg`.
fn doubt_while_swinging(
    truly: &str,
    declared: &str,
    [aside_m, yaw_deg]: [f64; 2],
    seed: u64,
) -> Option<SettingJson> {
    let heads: Vec<&str> = ["sonar_0", "sonar_1", "sonar_2", "sonar_3"]
        .into_iter()
        .filter(|head| truly.contains(&format!("id = {head:?}")))
        .collect();
    let text = format!(
        "seed = {seed}\nvehicle = \"vehicle.toml\"\n[trajectory]\nkind = \"pilot\"\nstart_m = 100\nto_m = 190\n\
         speed_mps = 0.15\nwander_across_m = {aside_m}\nwander_up_m = {}\nwander_yaw_deg = {yaw_deg}\nwander_pitch_deg = 1\n\
         wander_roll_deg = 1\n[effects]\n{EFFECTS}beam_cone = {{ sensors = {heads:?} }}\n",
        aside_m / 2.0
    );
    let parse =
        |file: &str| headrace_tests::scenes::seeded(&text, &|_| Ok(file.as_bytes().to_vec()), Some(seed));
    doubted(&parse(truly), &parse(declared))
}

/// Vehicle files, each with the id of the head whose setting the tests make wrong.
const OF_VEHICLES: [(&str, &str); 2] = [("vita1.toml", "sonar_0"), ("vita2-4.toml", "sonar_1")];
const ASIDE_M: f64 = 0.5;

#[test]
fn head_turned_about_its_axis_is_reported_with_angle() {
    for ((name, head), by_deg) in OF_VEHICLES.into_iter().zip([3, -3]) {
        let right = file(name);
        let turned = changed(&right, head, "angles_deg", &format!("[{by_deg}, 0, 0]"));
        let doubt = wrong_setting(&turned, &right, ASIDE_M, 1).unwrap();
        println!("{name}: {doubt:?}");
        assert_eq!((doubt.what, doubt.source.as_deref()), ("head_turned", Some(head)), "{name}");
        let share = doubt.angle_deg.unwrap() / f64::from(by_deg);
        assert!((share - 1.0).abs() < 0.3, "{name}: {doubt:?}");
    }
}

/// If a head is yawed or pitched on its mount, its ranges change while the vehicle yaws back and forth. If the vehicle
/// has only one head, this looks like a heading error.
#[test]
fn head_yawed_or_pitched_on_its_mount_is_reported_with_angle() {
    let right = file("vita2-4.toml");
    // The head `sonar_1` looks forward, and `sonar_3` looks aft.
    for (head, what, angles, by_deg) in [
        ("sonar_1", "head_yawed", "[0, 0, 3]", 3.0),
        ("sonar_3", "head_yawed", "[0, 0, 177]", -3.0),
        ("sonar_3", "head_pitched", "[0, 3, 180]", 3.0),
    ] {
        let turned = changed(&right, head, "angles_deg", angles);
        let doubt = doubt_while_swinging(&turned, &right, [ASIDE_M, 5.0], 1).unwrap();
        println!("{head} {what} by {by_deg}: {doubt:?}");
        assert_eq!((doubt.what, doubt.source.as_deref()), (what, Some(head)), "{doubt:?}");
        assert!((doubt.angle_deg.unwrap() / by_deg - 1.0).abs() < 0.3, "{doubt:?}");
    }
}

#[test]
fn reversed_head_is_reported_when_the_vehicle_is_off_centre() {
    for (name, head) in OF_VEHICLES {
        let right = file(name);
        let doubt =
            wrong_setting(&changed(&right, head, "angles_deg", "[0, 0, 180]"), &right, ASIDE_M, 1).unwrap();
        assert_eq!(
            (doubt.what, doubt.source.as_deref()),
            ("wrong_way_round", Some(head)),
            "{name}: {doubt:?}"
        );
    }
}

#[test]
fn swapped_heads_are_reported() {
    let right = file("vita2-4.toml");
    let mut swapped = right.clone();
    for key in ["position_m", "angles_deg"] {
        let [one, other] = ["sonar_1", "sonar_3"].map(|head| sensor_line(&right, head, key));
        swapped = changed(&changed(&swapped, "sonar_1", key, &other), "sonar_3", key, &one);
    }
    let doubt = wrong_setting(&swapped, &right, ASIDE_M, 1).unwrap();
    let SettingJson { what, source, other, .. } = &doubt;
    let named = (*what, source.as_deref(), other.as_deref());
    assert_eq!(named, ("swapped", Some("sonar_1"), Some("sonar_3")), "{doubt:?}");
}

fn cell(vehicle: &str, condition: Condition) -> Cell {
    let vehicle = VEHICLES.into_iter().find(|known| known.name == vehicle).unwrap();
    Cell { vehicle, condition, start_m: 100.0, let_in_m: None, driven: Driven::Planned }
}

/// If sound is faster than configured, measured ranges are too short. If the tunnel is wider than designed, they are
/// too long.
#[test]
fn wrong_range_scale_is_reported_with_its_value() {
    let wrong = [(Condition::WrongSound, 1.0 / 1.04 - 1.0), (Condition::WrongWall, 0.06)];
    for (vehicle, wrong) in [("vita1", &wrong[..1]), ("vita2-4", &wrong)] {
        for (condition, share) in wrong.iter().copied() {
            let dive = cell(vehicle, condition).dive(1, 50.0);
            let doubt = doubted(&dive.scene, &dive.believed).unwrap();
            println!("{vehicle} {condition:?}: {doubt:?}");
            assert_eq!(doubt.what, "range_scale", "{vehicle}: {doubt:?}");
            assert!(
                ((doubt.range_ratio.unwrap() - 1.0) / share - 1.0).abs() < 0.05,
                "{vehicle} {condition:?}: {doubt:?}"
            );
        }
    }
}

#[test]
fn correct_settings_are_not_reported() {
    for (name, _) in OF_VEHICLES {
        let right = file(name);
        assert_eq!(wrong_setting(&right, &right, ASIDE_M, 1), None, "{name}");
    }
    let conditions =
        [Condition::Clean, Condition::DataSheet, Condition::Poor, Condition::Murk, Condition::Lively];
    for (k, condition) in conditions.into_iter().enumerate() {
        // Each condition is tried with the vehicle with four heads, and with one of the vehicles with fewer heads.
        for vehicle in [["vita1", "vita2-2"][k % 2], "vita2-4"] {
            let dive = cell(vehicle, condition).dive(3, 45.0);
            assert_eq!(doubted(&dive.scene, &dive.believed), None, "{vehicle} {condition:?}");
        }
    }
}

/// If a head sees only a round vault about its own axis, its rotation can't be observed. Without noise, the head's
/// range errors of some millimetres are constant. These errors must not be mistaken for a wrong setting.
#[test]
fn millimetre_range_errors_under_a_round_vault_are_not_reported_as_rotation() {
    for layout in ["sector_offset", "phase_shift"] {
        let scene = scenes::scene(&format!(
            "vehicle = \"vita2-4.toml\"\n[vehicle_changes]\nheads.layout = {layout:?}\n[trajectory]\nstart_m = 5\n\
             [[trajectory.legs]]\ndistance_m = 45\nspeed_mps = 0.1\n[effects]\nmotion_within_turn = {{}}\n"
        ));
        assert_eq!(doubted(&scene, &scene), None, "{layout}");
    }
}

#[test]
fn local_wall_deviations_are_not_reported_as_wrong_settings() {
    for name in ["collapse", "boulders", "steel", "vita1-field"] {
        let path = headrace_tests::root().join(format!("deploy/scenes/{name}.toml"));
        let text = std::fs::read_to_string(path).unwrap().replace("../vehicles/", "");
        let scene = scenes::scene(&text);
        let doubt = doubted(&scene, &scene);
        println!("{name}: {doubt:?}");
        assert_eq!(doubt, None, "{name}");
    }
}
