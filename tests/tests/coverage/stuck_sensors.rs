//! Stuck devices: a head or inertial unit whose output never changes counts as silent.

use headrace_coverage::Cause;
use headrace_coverage::Verdict;
use headrace_simulator::Scene;
use headrace_tests::{scenes, truth};

const NOISE: &str = "motion_within_turn = {}\nocclusion = {}\nrange_noise = { sd_m = 0.005 }\ndepth_noise = { noise_pa = 50 }\n\
    imu_noise = { gyro_degps_rthz = 0.005, accel_mps2_rthz = 0.0006 }\n";
const SWAY: &str =
    "pilot_drift = { across_m = 0.3, up_m = 0.2, yaw_deg = 12, pitch_deg = 3, period_s = 25 }\n";

/// A scene of VITA 2 with four heads. The vehicle is stationary for a minute, and then drives the distance at the speed
/// that `way` gives (m, m/s).
fn scene(start_m: f64, way: (f64, f64), effects: &str) -> Scene {
    seeded(5, start_m, way, effects)
}

fn seeded(seed: u64, start_m: f64, (length_m, speed_mps): (f64, f64), effects: &str) -> Scene {
    let text = format!(
        "seed = {seed}\nvehicle = \"vita2-4.toml\"\n[trajectory]\nkind = \"waypoints\"\n[[trajectory.waypoints]]\n\
         chainage_m = {start_m}\nstay_s = 60\n[[trajectory.waypoints]]\nchainage_m = {}\nspeed_mps = {speed_mps}\n\
         [effects]\n{NOISE}{effects}",
        start_m + length_m
    );
    scenes::scene_from(&text, &scenes::vehicle_file)
}

fn hangs(sensor: &str, from_s: f64) -> String {
    format!("device_faults = {{ sensors = [{sensor:?}], kind = \"stick\", from_s = {from_s} }}\n")
}

/// Results of a dive: true holes, causes with their heads, alerts with their texts, and the speed advised at the end.
struct Reported {
    /// True holes of passed sections, m.
    passed_m: Vec<f64>,
    causes: Vec<(Cause, Vec<String>)>,
    alerts: Vec<(&'static str, String)>,
    v_max_mps: f64,
}

fn dive(scene: &Scene) -> Reported {
    let mut v_max_mps = 0.0;
    let judged = truth::dive_noting(scene, &scene.vehicle, &mut |dive| {
        if let Some(last) = dive.view().advised().entries.last() {
            v_max_mps = last.advice.v_max_mps;
        }
    });
    let passed = judged.sections.iter().filter(|section| section.report.verdict == Verdict::Pass);
    let report = &judged.report;
    Reported {
        passed_m: passed.map(|section| section.true_hole_m).collect(),
        causes: report.runs.iter().map(|run| (run.cause, run.silent_sources.clone())).collect(),
        alerts: report.alert_list.iter().map(|alert| (alert.kind, alert.text.clone())).collect(),
        v_max_mps,
    }
}

/// A stuck inertial unit can't be detected within a second. During this second, the position error stays smaller than
/// the margin by which a hole must be below the target.
#[test]
fn stuck_inertial_unit_is_reported_and_no_section_far_over_the_target_passes() {
    let (mut passed, mut over) = (0, 0);
    for (seed, start_m) in [(1, 2.0), (2, 3000.0), (3, 6900.0), (5, 6900.0)] {
        let [sound, hung] = ["", &hangs("imu", 100.0)]
            .map(|fault| dive(&seeded(seed, start_m, (15.0, 0.05), &format!("{SWAY}{fault}"))));
        let is_named = |reported: &Reported| {
            reported.alerts.iter().any(|(kind, text)| *kind == "sensor_hung" && text.contains("imu"))
        };
        assert!(!is_named(&sound) && is_named(&hung), "{start_m}: {:?}", hung.alerts);
        let worst_m = hung.passed_m.iter().copied().fold(0.0, f64::max);
        assert!(worst_m <= 1.1 * 0.5, "{seed}, {start_m}: {worst_m}");
        passed += hung.passed_m.len();
        over += hung.passed_m.iter().filter(|hole_m| **hole_m > 0.5).count();
        assert!(sound.passed_m.len() > 2 * hung.passed_m.len(), "{start_m}: {}", sound.passed_m.len());
    }
    println!("{over} of {passed} that passed are over the target");
    assert!(100 * over <= passed, "{over} of {passed}");
}

/// A stuck head repeats one angle and one range; a head without returns keeps turning. Both heads have the same
/// consequences. The advised speed is the speed for a silent head, the displayed cause is a silent or stalled head, and
/// an alert names the head.
#[test]
fn head_without_returns_is_reported_as_silent() {
    let deaf = "stuck_range = { range_m = 0.3, from_s = 90, sensors = [\"sonar_1\"] }\n";
    let silent = "device_faults = { sensors = [\"sonar_1\"], kind = \"die\", from_s = 90 }\n";
    let [deaf, silent, stuck] =
        [deaf, silent, &hangs("sonar_1", 90.0)].map(|fault| dive(&scene(6900.0, (12.0, 0.1), fault)));
    for (what, reported) in [("deaf", &deaf), ("silent", &silent), ("stuck", &stuck)] {
        let causes = &reported.causes;
        let is_its = |(cause, heads): &(Cause, Vec<String>)| {
            matches!(cause, Cause::HeadSilent | Cause::HeadStalled)
                && (heads == &["sonar_1"] || what == "stuck")
        };
        assert!(!causes.is_empty() && causes.iter().all(is_its), "{what}: {causes:?}");
        assert!((reported.v_max_mps / silent.v_max_mps - 1.0).abs() < 0.03, "{what}: {}", reported.v_max_mps);
        assert!(
            reported.alerts.iter().any(|(_, text)| text.contains("sonar_1")),
            "{what}: {:?}",
            reported.alerts
        );
    }
}
