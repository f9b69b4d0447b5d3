//! The smoother compared with the truth of simulated dives and with the filter, and `replay --smooth`.

use headrace_fusion::filter::state::State;
use headrace_fusion::smooth::backward::Backward;
use headrace_fusion::smooth::journal::Journal;
use headrace_fusion::smooth::step::Placed;
use headrace_fusion::smooth::track::TrackNavigation;
use headrace_fusion::smooth::two_filters::smoothable;
use headrace_geometry::frames::Pose;
use headrace_geometry::math;
use headrace_geometry::time::MonoNs;
use headrace_sensor::reading::MAX_SOURCES;
use headrace_simulator::{START, Scene, Simulation};
use headrace_tests::Folder;
use headrace_tests::field::{Figures, POSE, SETTINGS, field, field_with, figures, nees, rms, share};
use headrace_tests::tracking::{self, Epoch, Silence, Track, dive, filter};
use headrace_vehicle::NavigationConfig;

const SEEDS: u64 = 3;
/// Capacity of the journal of filter steps. It is enough for a dive of ten minutes.
const STEPS: usize = 1 << 13;

struct Smoothed {
    /// Track of a dive with the filter's positions.
    filter: Track,
    /// Track of a dive with the smoothed positions.
    dive: Track,
    /// Smoothed estimates in time order.
    epochs: Vec<Epoch>,
}

fn smoothed(scene: &Scene, silence: &Silence) -> Smoothed {
    let NavigationConfig::Filter(settings) = scene.vehicle.navigation else { panic!("no filter") };
    let (journal, steps) = Journal::new(STEPS);
    let by_filter = dive(scene, filter(scene), silence.clone());
    let vehicle = &scene.vehicle;
    let recorded = smoothable(vehicle.tunnel.profile.clone(), vehicle.site, settings, journal);
    dive(scene, recorded, silence.clone());
    assert_eq!(steps.dropped(), 0);
    let records: Vec<_> = std::iter::from_fn(|| steps.next()).collect();
    let truth = Simulation::new(scene).unwrap();
    let mut backward = Backward::new(settings);
    let mut epochs = Vec::new();
    for words in records.iter().rev() {
        backward.take(&Placed::of_words(words).unwrap());
        let now = backward.now().unwrap();
        let Pose { position, attitude } = truth.pose(now.at).unwrap();
        let errors = now.state.errors_to(&State { position, attitude, ..now.state });
        epochs.push(Epoch { at: now.at, factors: Box::new(now.factors), errors });
    }
    epochs.reverse();
    let along = TrackNavigation::new(backward.finish(), [None; MAX_SOURCES]);
    Smoothed { filter: by_filter, dive: dive(scene, along, Silence::default()), epochs }
}

type Pick = fn(&Figures) -> f64;

/// Allowed ratio of the smoother's error along the tunnel to the filter's error. Both errors are due to cable slack,
/// which no other sensor observes.
///
/// In the scene, slack follows a spline without components faster than its period. The filter's model of slack is
/// different, so smoothing need not reduce the error.
const SLACK: f64 = 1.25;

struct Dives {
    smoothed: Smoothed,
    /// For each section, the error of its hole and the reported standard deviation, m. The first list is for filtered
    /// positions, the second one for smoothed positions.
    holes: [Vec<(f64, f64)>; 2],
}

/// Dives with a configured slack time of 8 s. The model then assumes that a quarter of the slack remains after a turn.
///
/// A smoother depends more on its model than a filter does. The filter also works with a configured slack time of 15 s,
/// although the model then assumes that more than half of the slack remains. With the smoother, however, the hole
/// diameter D is then within two standard deviations in only 88.9 % of the sections.
fn dives(seed: u64) -> Dives {
    let scene = field_with(seed, 65.0, &SETTINGS.replace("slack_time_s = 15", "slack_time_s = 8"), "");
    let smoothed = smoothed(&scene, &Silence::default());
    let truth = tracking::true_dive(&scene);
    let holes = [&smoothed.filter, &smoothed.dive].map(|track| {
        let pairs = track.report.sections.iter().filter_map(|ours| {
            let same = |other: &f64| (other - ours.start_m).abs() < 1e-6;
            let true_one = truth.report.sections.iter().find(|other| same(&other.start_m))?;
            Some((ours.hole_m? - true_one.hole_m?, ours.hole_sd_m))
        });
        pairs.collect()
    });
    Dives { smoothed, holes }
}

/// The smoother's errors must be consistent with their reported standard deviations, and no larger than the filter's
/// errors.
///
/// The NEES of a pose must be near 6, and the hole diameter D must be within two standard deviations of the truth in 90
/// to 99 % of the sections.
#[test]
fn smoothing_reduces_errors_and_stays_consistent() {
    let all: Vec<Dives> = std::thread::scope(|scope| {
        let half =
            |odd: u64| move || (1..=SEEDS).filter(|seed| seed % 2 == odd).map(dives).collect::<Vec<_>>();
        let [odd, even] = [1, 0].map(|odd| scope.spawn(half(odd)));
        odd.join().unwrap().into_iter().chain(even.join().unwrap()).collect()
    });
    let by_filter: Vec<Figures> = all.iter().map(|dives| figures(&dives.smoothed.filter)).collect();
    let smoothed: Vec<Figures> = all.iter().map(|dives| figures(&dives.smoothed.dive)).collect();
    println!("| rms over {SEEDS} dives | filter | smoothed |\n|---|---|---|");
    // The number in each row is the largest allowed ratio of the smoother's error to the filter's error.
    let rows: [(&str, Pick, f64); 8] = [
        ("across, m", |f| f.across_m, 0.5),
        ("up, m", |f| f.up_m, 0.5),
        ("along, m", |f| f.along_m, SLACK),
        ("displacement over a turn, m", |f| f.turn_m, SLACK),
        ("its reported sigma, m", |f| f.turn_arc_m, 1.0),
        ("yaw, deg", |f| f.yaw_deg, 0.6),
        ("roll and pitch, deg", |f| f.tilt_deg, 0.6),
        ("share of pings with a fix", |f| f.fixed, 1.001),
    ];
    for (name, pick, most) in rows {
        let [was, is] = [&by_filter, &smoothed].map(|all| rms(all.iter().map(pick)));
        println!("| {name} | {was:.4} | {is:.4} |");
        assert!(is <= most * was, "{name}: {is}, was {was}");
    }
    let means: Vec<f64> = all
        .iter()
        .map(|dives| {
            let epochs = &dives.smoothed.epochs;
            epochs.iter().map(nees).sum::<f64>() / epochs.len() as f64
        })
        .collect();
    println!("NEES of 6, smoothed: {means:.2?}");
    let mean = means.iter().sum::<f64>() / means.len() as f64;
    assert!((3.5..8.0).contains(&mean), "{means:?}");
    for (name, number) in [("filter", 0), ("smoothed", 1)] {
        let holes: Vec<(f64, f64)> =
            all.iter().flat_map(|dives| dives.holes[number].iter().copied()).collect();
        let within = share(holes.iter().map(|(error, sigma)| error.abs() <= 2.0 * sigma));
        let [error_m, arc_m] = [rms(holes.iter().map(|h| h.0)), rms(holes.iter().map(|h| h.1))];
        println!(
            "D of {} sections, {name}: error {error_m:.4} m, sigma {arc_m:.4} m, within two: {within:.3}",
            holes.len()
        );
        // The configured slack time is shorter than the true one, so reported standard deviations are too large.
        assert!((0.9..=0.998).contains(&within), "{name}: {within}");
    }
}

/// The shipped vehicle file assumes large errors. With these settings, smoothing must lose no fix that the filter has,
/// and must increase no error.
#[test]
fn smoothing_increases_no_error_of_the_shipped_vehicle() {
    for seed in 1..=2 {
        let track = smoothed(&field_with(seed, 40.0, "[heads]", ""), &Silence::default());
        let [was, is] = [&track.filter, &track.dive].map(figures);
        println!("seed {seed}: filter {was:?}\nsmoothed {is:?}");
        assert!(is.fixed >= was.fixed, "seed {seed}: fixes {} of pings, were {}", is.fixed, was.fixed);
        assert!(is.across_m <= was.across_m && is.up_m <= was.up_m, "seed {seed}: {is:?}, was {was:?}");
        assert!(is.yaw_deg <= was.yaw_deg, "seed {seed}: yaw {} degrees, was {}", is.yaw_deg, was.yaw_deg);
    }
}

/// Root mean square of one component of the error between two times, and the largest ratio of this error to its
/// standard deviation.
fn between(epochs: &[Epoch], error: usize, from_s: f64, to_s: f64) -> (f64, f64) {
    let inside = epochs.iter().filter(|epoch| {
        let at_s = epoch.at.since(START).as_secs_f64();
        (from_s..to_s).contains(&at_s)
    });
    let off: Vec<(f64, f64)> =
        inside.map(|epoch| (epoch.errors[error], math::sqrt(epoch.factors.variance(error)))).collect();
    let worst = off.iter().map(|(error, sigma)| error.abs() / sigma).fold(0.0, f64::max);
    (rms(off.iter().map(|(error, _)| *error)), worst)
}

#[test]
fn smoothing_bridges_a_silence_with_readings_from_before_and_after() {
    let scene = field(3, 33.0);
    let from_s = 80.0;
    // The sonars are silent only briefly. Without ranges to the walls, the filter drops its estimate after half a
    // minute, and the smoother then can't use the readings after the silence.
    for (name, sources, errors, to_s) in [
        ("the tether", vec![7], vec![0], from_s + 60.0),
        ("all sonars", vec![0, 1, 2, 3, 4], vec![1, 2], from_s + 10.0),
    ] {
        let silence = Silence { sources, from_s, to_s };
        let track = smoothed(&scene, &silence);
        for error in errors {
            let (was_m, _) = between(&track.filter.epochs, error, from_s, to_s);
            let (is_m, worst) = between(&track.epochs, error, from_s, to_s);
            println!(
                "{name} silent to {to_s} s, error {error}: filter {was_m:.3} m, smoothed {is_m:.3} m, worst {worst:.1} sigma"
            );
            assert!(is_m < 0.7 * was_m, "{name}: {is_m}, was {was_m}");
            assert!(worst < 3.0, "{name}: {worst}");
        }
        let settled = &track.epochs;
        let off = |epoch: &Epoch| POSE.map(|i| epoch.errors[i].abs() / math::sqrt(epoch.factors.variance(i)));
        let within = share(settled.iter().flat_map(off).map(|off| off <= 3.0));
        assert!(within > 0.995, "{name}: {within}");
    }
}

/// Verdicts depend on the displacement during a turn of a head. In this test, the vehicle file says that the cable is
/// taut.
#[test]
fn smoothed_displacements_are_accurate_on_a_taut_cable() {
    let settings = SETTINGS.replace("slack_sd_m = 0.085", "slack_sd_m = 0.001");
    let scene = field_with(1, 40.0, &settings, "tether_slack = { reach_m = 0.15, period_s = 30 }\n");
    let track = smoothed(&scene, &Silence::default());
    let [was, is] = [&track.filter, &track.dive].map(figures);
    println!("taut cable, over a turn: filter {:.4} m, smoothed {:.4} m", was.turn_m, is.turn_m);
    assert!(is.turn_m < 0.5 * was.turn_m && is.turn_m < 2.0 * is.turn_arc_m, "{is:?} {was:?}");
}

#[test]
fn smoothed_track_is_split_at_a_lost_estimate() {
    let scene = field(2, 20.0);
    let sources = (0..8).collect();
    let track = smoothed(&scene, &Silence { sources, from_s: 40.0, to_s: 60.0 });
    let unknown = |at: MonoNs| {
        let at_s = at.since(START).as_secs_f64();
        (42.0..60.0).contains(&at_s)
    };
    let fixed = |inside: bool| {
        let fixes = track.dive.fixes.iter().filter(move |tracked| unknown(tracked.at) == inside);
        share(fixes.map(|tracked| tracked.fix.is_ok()))
    };
    assert_eq!(fixed(true).to_bits(), 0.0_f64.to_bits());
    assert!(fixed(false) > 0.9, "{}", fixed(false));
    assert!(track.epochs.iter().all(|epoch| epoch.factors.is_sound()));
}

/// Simulator effects for a dive three times as long as the usual short dive: sensor noise, steel that disturbs the
/// compass, a drifting pilot, and far more cable slack than the filter assumes.
const NOISE: &str = "
[effects]
imu_noise = { gyro_degps_rthz = 0.01, accel_mps2_rthz = 0.002, attitude_deg = 0.5 }
tether_slack = { reach_m = 0.4, period_s = 8 }
magnetic_disturbance = { per_100m = 20, up_to_deg = 10, length_m = 3 }
pilot_drift = { across_m = 0.5, up_m = 0.3, yaw_deg = 10, pitch_deg = 3, roll_deg = 3, period_s = 20 }
";

fn noisy() -> Folder {
    let folder = Folder::new();
    folder.write("vehicle.toml", headrace_tests::VEHICLE);
    folder.write("scene.toml", headrace_tests::SCENE.replace("distance_m = 4", "distance_m = 12") + NOISE);
    folder.simulate("scene.toml", "dive.mcap");
    folder
}

#[test]
fn replay_reports_changes_by_smoothing() {
    let folder = noisy();
    let answer =
        folder.headrace(&["replay", "dive.mcap", "--smooth", "--target", "0.7", "--report", "r.json"]);
    assert_eq!(answer.code, Some(0), "{}", answer.stderr);
    let about = |line: &&str| ["  smoothed", "  changed:"].iter().any(|words| line.contains(words));
    let said: Vec<&str> = answer.stdout.lines().filter(about).collect();
    insta::assert_snapshot!(said.join("\n"), @r"
      smoothed 591 estimates; with the filter alone: passed 8.00 m   missed 0.00 m   can't say 3.00 m   open 0.00 m   not inspected 1.00 m
      0+003.50 to 0+004.00  changed: can't say to pass, holes 0.544±0.127 to 0.458±0.041 m
      0+009.75 to 0+011.25  changed: can't say to pass, holes 0.664±0.088 to 0.508±0.012 m
      0+012.25 to 0+013.25  changed: can't say to pass, holes 0.587±0.080 to 0.440±0.012 m
      0+015.00 to 0+015.25  changed: not passed to open, holes - to 1.709±0.050 m
    ");
    let report: serde_json::Value = serde_json::from_slice(&folder.read("r.json")).unwrap();
    let smoothing = &report["smoothing"];
    for (side, summary) in [("after", &report["summary"])] {
        for key in ["pass_m", "fail_m", "cannot_say_m", "open_m", "not_inspected_m"] {
            assert_eq!(smoothing[side][key], summary[key], "{side} {key}");
        }
    }
    let changed = smoothing["changed"].as_array().unwrap();
    assert!(!changed.is_empty());
    let (_, plain) = folder.replay("dive.mcap", &["--target", "0.7"]);
    assert_eq!(smoothing["filter_digest"], plain["digest"]);
    assert!(plain["smoothing"].is_null());
    let find = |report: &serde_json::Value, start: &serde_json::Value| {
        let sections = report["sections"].as_array().unwrap();
        sections.iter().find(|section| section["start_m"] == *start).cloned()
    };
    for change in changed {
        for (side, report) in [("before", &plain), ("after", &report)] {
            let section = find(report, &change["start_m"]);
            for key in ["verdict", "hole_m", "hole_sd_m"] {
                assert_eq!(
                    change[side][key],
                    section.as_ref().map_or(serde_json::Value::Null, |s| s[key].clone())
                );
            }
        }
        assert_ne!(change["before"]["verdict"], change["after"]["verdict"]);
    }
}

#[test]
fn tick_length_does_not_change_a_smoothed_replay() {
    let folder = noisy();
    let digest = folder.digest("dive.mcap", &["--smooth"]);
    for tick_ms in ["1", "333", "60000"] {
        assert_eq!(folder.digest("dive.mcap", &["--smooth", "--tick-ms", tick_ms]), digest, "{tick_ms} ms");
    }
    let answer = folder.headrace(&["replay", "dive.mcap", "--smooth", "--report", "golden.json"]);
    assert_eq!(answer.code, Some(0), "{}", answer.stderr);
    let again =
        folder.headrace(&["replay", "dive.mcap", "--smooth", "--expect", "golden.json", "--tick-ms", "7"]);
    assert_eq!((again.code, again.stderr.as_str()), (Some(0), ""));
}

#[test]
fn smoothing_without_a_filter_is_refused() {
    let folder = Folder::with_dive();
    folder.write("direct.toml", headrace_tests::VEHICLE.to_owned() + "\n[navigation]\nway = \"direct\"\n");
    let answer = folder.headrace(&["replay", "dive.mcap", "--smooth", "--vehicle", "direct.toml"]);
    assert_eq!(answer.code, Some(2), "{}", answer.stderr);
    insta::assert_snapshot!(answer.stderr, @r#"headrace: replaying dive.mcap: --smooth needs [navigation] way = "filter"; the vehicle file has way = "direct""#);
}
