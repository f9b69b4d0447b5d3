//! Only returns that are accepted as wall fill holes. The test compares these returns with the objects that the beams
//! truly met.
//!
//! The dives have stuck or noisy heads, murk, boulders or caves.

use headrace_coverage::Verdict;
use std::collections::BTreeMap;
use std::fmt::Write as _;

use headrace_monitor::alert_list::ListedAlertJson;
use headrace_oracle::wall::Wall;
use headrace_sensor::device::Sense;
use headrace_simulator::Simulation;
use headrace_tests::instrumented::{self, Dive, Sample};
use headrace_tests::scenes;

use crate::observed::observed;

const VITA: &str = include_str!("../../../deploy/vehicles/vita2-4.toml");
/// Scene of a very slow dive in a pipe of 1 m radius.
const CREEP: &str = "vehicle = \"vehicle.toml\"\n[trajectory]\nstart_m = 2\n[[trajectory.legs]]\ndistance_m = 6\n\
    speed_mps = 0.03\n[effects]\nmotion_within_turn = {}\nrange_noise = { sd_m = 0.005 }\n";
const DRIFT: &str = "pilot_drift = { across_m = 0.2, up_m = 0.1, yaw_deg = 6, period_s = 15 }\n";

/// A vehicle in a pipe of 1 m radius. The vehicle has `heads` heads, which alternately look forward and aft.
fn pipe(heads: usize) -> String {
    let mut text = "target_m = 0.25\n[tunnel]\nprofile = \"circle\"\nradius_m = 1\nlength_m = 30\n[water]\n\
        sound_speed_mps = 1447\n[navigation]\nslack_time_s = 10\n[heads]\nplanned_speed_mps = 0.03\n"
        .to_owned();
    for number in 0..heads {
        let x_m = if number % 2 == 0 { 0.3 } else { -0.3 };
        write!(
            text,
            "[[sensors]]\nid = \"sonar_{number}\"\nplugin = \"imagenex881\"\nbody_radius_m = 0.001\n\
             connect = \"tcp:192.168.0.{number}:4040\"\nposition_m = [{x_m}, 0, 0]\nmode = \"fastest\"\nrange_m = 2\n"
        )
        .unwrap();
    }
    let (_, others) = headrace_tests::VEHICLE.split_once("[[sensors]]\nid = \"ping_left\"").unwrap();
    text + "[[sensors]]\nid = \"ping_left\"" + others
}

fn dive(heads: usize, effects: &str) -> Dive {
    instrumented::dive(&pipe(heads), &format!("{CREEP}{effects}"))
}

/// Alerts that report an observation about the dive and name this head.
fn named<'a>(dive: &'a Dive, head: &str) -> Vec<&'a ListedAlertJson> {
    let mut alerts = observed(&dive.report);
    alerts.retain(|alert| alert.sensor.as_deref() == Some(head));
    alerts
}

/// Difference between the range of each ping and the true range of the object that its beam met, m. The list is in the
/// loop's order. An element is `None` if one of the two ranges is missing.
fn errors_m(vehicle: &str, scene: &str, dive: &Dive) -> Vec<Option<f64>> {
    let scene = scenes::scene_from(scene, &|_| Ok(vehicle.as_bytes().to_vec()));
    let mut simulation = Simulation::with_truth(&scene).unwrap();
    let mut heads: BTreeMap<u16, Vec<Option<f64>>> = BTreeMap::new();
    while simulation.advance() {
        for row in simulation.take_truth().into_iter().filter(|row| row.sense == Sense::Head) {
            let truth = row.sounding.unwrap();
            let met = truth.measured.range_m.zip(truth.wall);
            let error_m = met.map(|(range_m, (hit, _))| (range_m - hit.range_m).abs());
            heads.entry(row.source).or_default().push(error_m);
        }
    }
    let mut heads: Vec<_> = heads.into_values().map(Vec::into_iter).collect();
    dive.pings.iter().map(|ping| heads[ping.head].next().unwrap()).collect()
}

/// Returns and sections of a dive in murk, compared with the objects that the beams truly met.
#[derive(Debug, Default)]
struct Compared {
    /// Number of returns from the wall. `met_doubtful` counts those of them that the loop classified as doubtful.
    met: usize,
    met_doubtful: usize,
    /// Number of returns from objects other than the wall. `strays_wall` counts those of them that the loop accepted as
    /// wall.
    strays: usize,
    strays_wall: usize,
    /// Number of passed sections. `worst` is the largest ratio of true hole to target in these sections.
    passed: usize,
    worst: f64,
}

/// Compares a dive with the truth. A return comes from the wall if its range error is at most `near_m`.
fn compared(vehicle: &str, scene: &str, near_m: f64) -> Compared {
    let dive = instrumented::dive(vehicle, scene);
    let errors_m = errors_m(vehicle, scene, &dive);
    let mut is = Compared::default();
    let mut true_wall: Vec<Sample> = Vec::new();
    for (ping, error_m) in dive.pings.iter().zip(&errors_m) {
        let met = error_m.is_some_and(|error_m| error_m <= near_m);
        let (wall, doubtful) = (usize::from(ping.sample.is_some()), usize::from(ping.doubtful.is_some()));
        if met {
            (is.met, is.met_doubtful) = (is.met + wall + doubtful, is.met_doubtful + doubtful);
            true_wall.extend(ping.sample);
        } else {
            (is.strays, is.strays_wall) = (is.strays + wall + doubtful, is.strays_wall + wall);
        }
    }
    let wall = Wall::new(true_wall.iter().map(|sample| sample.place), dive.profile.perimeter_m()).unwrap();
    for section in dive.report.sections.iter().filter(|section| section.verdict == Verdict::Pass) {
        let true_m = 2.0 * wall.largest(section.start_m, section.end_m).unwrap().radius_m;
        is.passed += 1;
        is.worst = is.worst.max(true_m / dive.report.target_m);
    }
    is
}

#[test]
fn no_section_passes_with_a_head_stuck_at_one_range() {
    let sound = dive(1, "");
    assert!(sound.report.summary.pass_m > 5.0, "{:?}", sound.report.summary);
    let alone = dive(1, "stuck_range = { sensors = [\"sonar_0\"] }\n");
    assert!(alone.report.summary.pass_m <= 0.0, "{:?}", alone.report.summary);
    // In the centre of a round pipe, a constant range could be right if the pipe has another radius. Only the profile
    // is therefore doubted.
    let kinds: Vec<_> = observed(&alone.report).into_iter().map(|alert| alert.kind).collect();
    assert_eq!(kinds, ["profile_contradicted"]);
}

/// If two heads in the centre of a pipe are stuck at the same range, they seem to agree on a wall with another radius,
/// whatever their noise.
#[test]
fn no_section_passes_with_all_heads_stuck_at_one_range() {
    for range_m in [0.78, 1.22] {
        let effects =
            format!("stuck_range = {{ range_m = {range_m}, sensors = [\"sonar_0\", \"sonar_1\"] }}\n");
        let dive = dive(2, &effects);
        assert!(dive.report.summary.pass_m <= 0.0, "{range_m}: {:?}", dive.report.summary);
    }
}

#[test]
fn one_stuck_head_of_several_is_reported_and_the_others_are_used() {
    for (heads, stuck, least_m) in [(2, 0, 1.0), (2, 1, 2.5), (3, 0, 2.0), (3, 1, 3.0)] {
        let id = format!("sonar_{stuck}");
        let effects = format!("stuck_range = {{ sensors = [\"{id}\"] }}\n");
        let (vehicle, scene) = (pipe(heads), format!("{CREEP}{effects}"));
        let dive = instrumented::dive(&vehicle, &scene);
        let at = format!("{id} of {heads}: {:?} {:?}", dive.report.summary, dive.report.alert_list);
        let alerts = named(&dive, &id);
        assert!(matches!(alerts[..], [alert] if alert.kind == "head_outvoted"), "{at}");
        assert!((-0.5..-0.4).contains(&alerts[0].worst_m.unwrap()), "{at}");
        let all = observed(&dive.report);
        assert!(all.iter().all(|alert| alert.sensor.as_deref().is_none_or(|head| head == id)), "{at}");
        assert!(dive.report.summary.pass_m >= least_m, "{at}");
        // Without the stuck head's returns, the true hole of a passed section is still at most 1.1 times the target.
        let others = dive.samples_of(|head| head != stuck);
        let wall = Wall::new(others, dive.profile.perimeter_m()).unwrap();
        for section in dive.report.sections.iter().filter(|section| section.verdict == Verdict::Pass) {
            let true_m = 2.0 * wall.largest(section.start_m, section.end_m).unwrap().radius_m;
            assert!(true_m <= 1.1 * dive.report.target_m, "{at}: section {}: {true_m} m", section.start_m);
        }
    }
}

#[test]
fn recovered_head_is_used_again() {
    let dive = dive(3, "stuck_range = { sensors = [\"sonar_1\"], from_s = 60, to_s = 120 }\n");
    assert_eq!(named(&dive, "sonar_1").len(), 1);
    let doubtful: Vec<f64> = dive
        .pings
        .iter()
        .filter(|ping| ping.doubtful.is_some())
        .map(|ping| ping.received.since(dive.pings[0].received).as_secs_f64())
        .collect();
    assert!(doubtful.len() > 2000 && doubtful[0] > 58.0, "{} from {}", doubtful.len(), doubtful[0]);
    // After some turns over new wall, the loop accepts the head's returns again.
    assert!(doubtful.last().unwrap() < &145.0, "{:?}", doubtful.last());
}

#[test]
fn constant_range_near_the_wall_is_reported_if_the_vehicle_sways() {
    let dive = dive(2, &format!("stuck_range = {{ range_m = 0.95, sensors = [\"sonar_1\"] }}\n{DRIFT}"));
    let alerts = named(&dive, "sonar_1");
    let constant = alerts.iter().find(|alert| alert.kind == "head_constant").unwrap();
    assert!((0.9..1.0).contains(&constant.worst_m.unwrap()), "{alerts:?}");
    assert!(named(&dive, "sonar_0").is_empty(), "{:?}", dive.report.alert_list);
}

#[test]
fn head_with_random_ranges_passes_no_section_and_is_reported() {
    let effects = |head: &str| format!("outliers = {{ share = 1, near_m = 0.1, sensors = [\"{head}\"] }}\n");
    let alone = dive(1, &effects("sonar_0"));
    assert!(alone.report.summary.pass_m <= 0.0, "{:?}", alone.report.summary);
    assert_eq!(named(&alone, "sonar_0")[0].kind, "head_scattered");
    let causes = alone.report.sections.iter().filter_map(|section| section.cause);
    let causes: Vec<&str> = causes.map(|evidence| evidence.cause.as_str()).collect();
    // A head counts as silent if all of its returns are rejected, so the cause is `head_silent`.
    let silent = causes.iter().filter(|cause| **cause == "head_silent").count();
    assert!(causes.len() > 10 && 10 * silent >= 9 * causes.len(), "{causes:?}");
    let one_of_two = dive(2, &effects("sonar_1"));
    assert_eq!(named(&one_of_two, "sonar_1")[0].kind, "head_scattered");
    assert!(named(&one_of_two, "sonar_0").is_empty() && one_of_two.report.summary.pass_m > 3.0);
}

#[test]
fn heads_without_faults_are_accepted_in_a_pipe_wider_than_the_design() {
    let wider = "[tunnel.as_built]\nprofile = \"circle\"\nradius_m = 1.06\n";
    for scene in [format!("{CREEP}{DRIFT}"), format!("{CREEP}{wider}")] {
        let dive = instrumented::dive(&pipe(2), &scene);
        assert!(observed(&dive.report).is_empty(), "{:?}", dive.report.alert_list);
        assert_eq!(dive.report.dive.samples_rejected.doubtful_returns, 0);
        assert!(
            dive.report.sections.iter().all(|section| section.deviation.is_none_or(|of| !of.contradicts))
        );
    }
}

#[test]
fn no_section_far_over_the_target_passes_in_murky_water() {
    let heads = "sensors = [\"sonar_0\", \"sonar_1\", \"sonar_2\"]";
    let near =
        format!("outliers = {{ share = 0.05, near_m = 0.1, far_m = 0.8, {heads} }}\nmultipath = {{}}\n");
    let all = format!(
        "outliers = {{ share = 0.08, near_m = 0.1, {heads} }}\nmultipath = {{ share = 0.3 }}\n{DRIFT}"
    );
    for effects in [near, all] {
        for target_m in ["0.25", "0.2"] {
            let vehicle = pipe(3).replace("target_m = 0.25", &format!("target_m = {target_m}"));
            let is = compared(&vehicle, &format!("{CREEP}{effects}"), 0.1);
            assert!(is.passed > 10 && is.worst <= 1.1, "{is:?}");
            assert!(is.strays > 1000 && 4 * is.strays_wall < is.strays, "{is:?}");
            assert!(1000 * is.met_doubtful <= is.met, "{is:?}");
        }
    }
    for target_m in [0.5, 0.7] {
        let scene = format!(
            "vehicle = \"vehicle.toml\"\n[vehicle_changes]\ntarget_m = {target_m:?}\n[trajectory]\nstart_m = 5\n\
             [[trajectory.legs]]\ndistance_m = 20\nspeed_mps = 0.11\n[effects]\nmotion_within_turn = {{}}\n\
             range_noise = {{ sd_m = 0.01 }}\nmultipath = {{}}\n\
             outliers = {{ share = 0.05, sensors = [\"sonar_0\", \"sonar_1\", \"sonar_2\", \"sonar_3\"] }}\n"
        );
        let is = compared(VITA, &scene, 0.5);
        assert!(is.passed > 50 && is.worst <= 1.1, "{is:?}");
        assert!(is.strays > 1000 && 4 * is.strays_wall < is.strays, "{is:?}");
        assert!(1000 * is.met_doubtful <= is.met, "{is:?}");
    }
}

#[test]
fn caves_heaps_boulders_traps_and_side_tunnels_count_as_wall() {
    for name in ["collapse.toml", "boulders.toml"] {
        let path = headrace_tests::root().join("deploy/scenes").join(name);
        let dive = instrumented::dive(VITA, &std::fs::read_to_string(path).unwrap());
        let doubtful = dive.pings.iter().filter(|ping| ping.doubtful.is_some()).count();
        let wall = dive.samples().count();
        assert!(wall > 50_000 && 200 * doubtful <= wall, "{name}: {doubtful} of {wall}");
        let all = observed(&dive.report);
        assert!(all.iter().all(|alert| alert.sensor.is_none()), "{all:?}");
        let reported = dive.report.dive.samples_rejected.doubtful_returns;
        assert_eq!(usize::try_from(reported).unwrap(), doubtful);
        // No section fails only because its doubtful returns don't count.
        let all =
            dive.pings.iter().filter_map(|ping| ping.sample.or(ping.doubtful)).map(|sample| sample.place);
        let wall = Wall::new(all, dive.profile.perimeter_m()).unwrap();
        for section in &dive.report.sections {
            if section.doubtful_returns > 0 && section.verdict == Verdict::Fail {
                let hole_m = 2.0 * wall.largest(section.start_m, section.end_m).unwrap().radius_m;
                assert!(hole_m > dive.report.target_m, "{name}, section {}: {hole_m} m", section.start_m);
            }
        }
    }
}

#[test]
fn wall_classification_does_not_depend_on_the_target() {
    let outliers = "outliers = { share = 0.08, near_m = 0.1, sensors = [\"sonar_0\", \"sonar_1\"] }\n";
    let samples = |target_m: &str| {
        let vehicle = pipe(2).replace("target_m = 0.25", &format!("target_m = {target_m}"));
        let dive = instrumented::dive(&vehicle, &format!("{CREEP}{outliers}"));
        assert!(dive.report.dive.samples_rejected.doubtful_returns > 500);
        dive.samples().copied().collect::<Vec<_>>()
    };
    assert_eq!(samples("0.25"), samples("0.8"));
}
