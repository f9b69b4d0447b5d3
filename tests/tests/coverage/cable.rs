//! A cable counter that gets stuck while the vehicle moves. The fault is reported at once. With one known exception,
//! the fault lets no section pass whose hole is far over the target.

use headrace_coverage::Verdict;
use headrace_geometry::time::MonoNs;
use headrace_monitor::App;
use headrace_monitor::messages::{PlacedItem, Placement};
use headrace_monitor::run::Loop;
use headrace_replay::SimulationFeed;
use headrace_replay::drive::{Pace, drive};
use headrace_simulator::{Scene, Simulation};
use headrace_tests::random_dives::Draw;
use headrace_tests::{scenes, truth};

use crate::observed::observed;

const DIVES: u64 = 24;
/// Largest speed by the paper's Eq. 16 for this vehicle and mode at a target of 0.5 m, m/s.
const EDGE_MPS: f64 = 0.118;
const LENGTH_M: f64 = 14.0;
const DOUBTED_WITHIN_S: f64 = 2.0;
/// Known number of sections that pass with a true hole over 1.1 times the target T. The goal is zero. Such a section
/// has samples from before and after the moment when the counter is first doubted. The reported standard deviation of
/// its hole is too small.
const KNOWN_FAR: usize = 1;

/// A simulated dive during which the cable counter is stuck.
struct Stuck {
    scene: Scene,
    from_s: f64,
}

/// Draws a random dive with a stuck cable counter. The expected holes vary from well below the target to well above it.
fn stuck(seed: u64, speeds_mps: [f64; 2]) -> Stuck {
    let mut draw = Draw::new(seed);
    let [least_mps, most_mps] = speeds_mps;
    let speed_mps = draw.between(least_mps, most_mps);
    let target_m = 0.5 * speed_mps / EDGE_MPS / draw.between(0.7, 1.3);
    let start_m = draw.one_of(&[16.0, 3000.0, 6900.0]);
    let for_s = draw.between(10.0, 15.0);
    let from_s = draw.between(0.3, 0.5) * LENGTH_M / speed_mps;
    let text = format!(
        "seed = {seed}\nvehicle = \"vita2-4.toml\"\n[trajectory]\nstart_m = {start_m}\n[[trajectory.legs]]\n\
         distance_m = {LENGTH_M}\nspeed_mps = {speed_mps:.4}\n[effects]\nmotion_within_turn = {{}}\nocclusion = {{}}\n\
         imu_noise = {{ gyro_degps_rthz = 0.007, accel_mps2_rthz = 0.001, attitude_deg = 0.3 }}\n\
         imu_bias = {{ gyro_degps = 0.003, accel_mps2 = 0.002, tau_s = 300 }}\ndepth_steps = {{}}\n\
         range_noise = {{ sd_m = 0.01 }}\n\
         [[effects.device_faults]]\nsensors = [\"tether\"]\nkind = \"stick\"\nfrom_s = {from_s:.3}\nfor_s = {for_s:.3}\n"
    );
    let load = |name: &str| {
        let file = String::from_utf8(scenes::vehicle_file(name)?).map_err(|error| error.to_string())?;
        let lines = file.lines().map(|line| match line.split(" =").next() {
            Some("target_m") => format!("target_m = {target_m:.3}"),
            Some("mode") => "mode = \"fast\"".to_owned(),
            _ => line.to_owned(),
        });
        Ok(lines.collect::<Vec<_>>().join("\n").into_bytes())
    };
    Stuck { scene: scenes::seeded(&text, &load, Some(seed)), from_s }
}

/// Time at which a filter update doubts the cable counter because the counter contradicts the inertial unit; `None` if
/// the item is anything else.
fn doubted_at(item: &PlacedItem) -> Option<MonoNs> {
    let Placement::Update(update) = &item.placement else { return None };
    update.doubts.cable.filter(|doubt| doubt.log.is_none()).map(|_| update.at)
}

/// Delay between the start of the fault and the first doubt about the counter, seconds.
fn doubted_after_s(stuck: &Stuck) -> Option<f64> {
    let vehicle = &stuck.scene.vehicle;
    let mut app = App::new(vehicle.mission());
    for sensor in &vehicle.sensors {
        app.add_device(sensor.as_ref()).unwrap();
    }
    let mut dive = app.arm(vehicle.navigation()).unwrap();
    let simulation = Simulation::new(&stuck.scene).unwrap();
    let mut doubted = None;
    let mut note = |dive: &Loop| {
        doubted = doubted.or_else(|| dive.view().placed().items.iter().find_map(doubted_at));
    };
    drive(&mut dive, &mut SimulationFeed::new(simulation), Pace::default(), &mut note).unwrap();
    let began = dive.view().clock().zero().unwrap();
    doubted.map(|at| at.since(began).as_secs_f64() - stuck.from_s)
}

fn in_two_threads<T: Send>(of: impl Fn(u64) -> T + Sync) -> Vec<T> {
    let half = |odd: u64| (odd..DIVES).step_by(2).map(&of).collect::<Vec<T>>();
    std::thread::scope(|scope| {
        let halves = [0, 1].map(|odd| scope.spawn(move || half(odd)));
        halves.into_iter().flat_map(|half| half.join().unwrap()).collect()
    })
}

#[test]
fn stuck_cable_is_flagged_within_2_s() {
    let late = in_two_threads(|seed| {
        let stuck = stuck(seed, [0.2, 0.45]);
        (seed, doubted_after_s(&stuck))
    });
    println!("{late:?}");
    let is_late = |after_s: Option<f64>| after_s.is_none_or(|s| !(0.0..=DOUBTED_WITHIN_S).contains(&s));
    let late: Vec<_> = late.into_iter().filter(|(_, after_s)| is_late(*after_s)).collect();
    assert!(late.is_empty(), "{late:?}");
}

#[test]
fn no_section_far_over_the_target_passes_with_a_stuck_cable() {
    let counts = in_two_threads(|seed| {
        let stuck = stuck(seed, [0.28, 0.45]);
        let dive = truth::dive(&stuck.scene);
        let alert = dive.report.alert_list.iter().find(|alert| alert.kind == "cable_doubted").cloned();
        let target_m = dive.report.target_m;
        let way_m = dive.truth.way_m;
        let inner = dive.sections.iter().filter(|section| {
            section.report.start_m > way_m[0] + 1.5 && section.report.end_m < way_m[1] - 1.5
        });
        let over: Vec<_> = inner.filter(|section| section.true_hole_m > target_m).collect();
        let passed: Vec<(f64, f64)> = over
            .iter()
            .filter(|section| section.report.verdict == Verdict::Pass)
            .map(|section| (section.report.start_m, section.true_hole_m / target_m))
            .collect();
        let far = passed.iter().filter(|(_, ratio)| *ratio > 1.1).count();
        println!("seed {seed}: T {target_m:.2} m, {} over, passed {passed:.2?}, {alert:?}", over.len());
        (over.len(), passed.len(), far, alert)
    });
    let over: usize = counts.iter().map(|(over, ..)| over).sum();
    let passed: usize = counts.iter().map(|(_, passed, ..)| passed).sum();
    let far: usize = counts.iter().map(|(_, _, far, _)| far).sum();
    println!("{passed} of {over} over the target passed, {far} far over it");
    assert!(over > 100, "{over}");
    for (_, _, _, alert) in counts {
        let alert = alert.unwrap();
        let (occurrences, worst_m) = alert.occurrences.zip(alert.worst_m).unwrap();
        assert!((1..=3).contains(&occurrences) && (0.5..12.0).contains(&worst_m), "{alert:?}");
    }
    assert!(far <= KNOWN_FAR, "{far}");
}

/// A misaligned velocity log measures three quarters of the speed. The cable counter is right, but no third sensor
/// shows whether the counter or the log is wrong.
#[test]
fn velocity_log_that_contradicts_the_counter_is_reported_and_causes_no_false_pass() {
    let log = "\n[[sensors]]\nid = \"dvl\"\nplugin = \"a50\"\nposition_m = [-0.2, 0, -0.1]\n";
    let load = |name: &str| {
        let mut file = scenes::vehicle_file(name)?;
        file.extend_from_slice(log.as_bytes());
        Ok(file)
    };
    let text = |turned_deg: u32| {
        format!(
            "vehicle = \"vita2-4.toml\"\n[trajectory]\nstart_m = 3000\n[[trajectory.legs]]\ndistance_m = 20\n\
             speed_mps = 0.2\n[effects]\nmotion_within_turn = {{}}\n\
             imu_noise = {{ gyro_degps_rthz = 0.007, accel_mps2_rthz = 0.001, attitude_deg = 0.3 }}\n\
             mount_error = {{ sensors = [\"dvl\"], angles_deg = [0, 0, {turned_deg}] }}\n"
        )
    };
    let of = |turned_deg: u32| truth::dive(&scenes::seeded(&text(turned_deg), &load, Some(7)));
    let sound = of(0);
    assert!(observed(&sound.report).is_empty(), "{:?}", sound.report.alert_list);
    let wrong = of(41);
    let [alert] = observed(&wrong.report)[..] else { panic!("{:?}", wrong.report.alert_list) };
    assert_eq!((alert.kind, alert.sensor.as_deref()), ("cable_doubted", Some("dvl")));
    // The velocity log measures a quarter too little. In a minute, the vehicle moves by 12 m and the log misses at most
    // 3 m of these.
    assert!((0.5..3.5).contains(&alert.worst_m.unwrap()), "{alert:?}");
    let target_m = wrong.report.target_m;
    let is_wrong = |section: &&truth::JudgedSection| {
        section.report.verdict == Verdict::Pass && section.true_hole_m > target_m
    };
    assert_eq!(wrong.sections.iter().filter(is_wrong).count(), 0);
    let cannot_say =
        wrong.sections.iter().filter(|section| section.report.verdict == Verdict::CannotSay).count();
    assert!(cannot_say > 20, "from the alert on: {cannot_say}");
}
