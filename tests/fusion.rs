//! The filter against the truth of simulated dives, beside the paper's way of navigating on the same data.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "clippy.toml's leave for tests doesn't reach their helpers; figures are for people, too"
)]

#[path = "common/shipped.rs"]
mod shipped;
#[path = "common/tracking.rs"]
mod tracking;

use headrace_core::frames::{Tunnel, Vec3};
use headrace_core::fusion::Fix;
use headrace_core::fusion::direct::DirectNavigation;
use headrace_core::fusion::filter::sources::Consistency;
use headrace_core::math;
use headrace_core::time::MonoNs;
use headrace_replay::simulate::{START, Scene};
use nalgebra::{SMatrix, SVector};
use tracking::{Silence, Track, dive, filter};

/// Seeds; the bounds below are those of so many dives.
const SEEDS: u64 = 20;
/// A turn of a head in mode SLOW, and how far the vehicle comes in it.
const TURN_S: f64 = 21.6;
const T_X_M: f64 = TURN_S * 0.197;
/// Epochs until the first estimate has settled.
const SETTLED: usize = 50;

/// Root mean squares of a dive's errors.
#[derive(Debug, Default, Clone, Copy)]
struct Figures {
    across_m: f64,
    up_m: f64,
    along_m: f64,
    turn_m: f64,
    turn_sigma_m: f64,
    yaw_deg: f64,
    tilt_deg: f64,
    fixed: f64,
}

fn rms(values: impl IntoIterator<Item = f64>) -> f64 {
    let (mut n, mut sum) = (0.0, 0.0);
    for value in values {
        n += 1.0;
        sum += value * value;
    }
    math::sqrt(sum / f64::max(n, 1.0))
}

fn figures(track: &Track) -> Figures {
    let known: Vec<_> = track.fixes.iter().filter_map(|t| Some((t.at, t.fix.ok()?, t.truth))).collect();
    let off: Vec<Vec3<Tunnel>> =
        known.iter().map(|(_, fix, truth)| fix.pose.position - truth.position).collect();
    let turned = known.iter().map(|(_, fix, truth)| fix.pose.attitude * truth.attitude.inverse());
    let turned: Vec<_> = turned.map(|off| off.roll_pitch_yaw()).collect();
    let turns =
        turns(&known.iter().map(|(at, fix, truth)| (*at, *fix, truth.position.x())).collect::<Vec<_>>());
    Figures {
        across_m: rms(off.iter().map(Vec3::y)),
        up_m: rms(off.iter().map(Vec3::z)),
        along_m: rms(off.iter().map(Vec3::x)),
        turn_m: rms(turns.iter().map(|(error, _)| *error)),
        turn_sigma_m: rms(turns.iter().map(|(_, sigma)| *sigma)),
        yaw_deg: rms(turned.iter().map(|(_, _, yaw)| yaw.to_degrees())),
        tilt_deg: rms(turned.iter().map(|(roll, pitch, _)| math::hypot(*roll, *pitch).to_degrees())),
        fixed: known.len() as f64 / track.fixes.len() as f64,
    }
}

/// Error of the displacement over a turn, and the standard deviation that was given.
fn turns(known: &[(MonoNs, Fix, f64)]) -> Vec<(f64, f64)> {
    let mut before = 0;
    let mut turns = Vec::new();
    for (at, fix, x_m) in known {
        while at.since(known[before].0).as_secs_f64() > TURN_S {
            before += 1;
        }
        if before > 0 {
            let (_, then, x_then_m) = &known[before];
            let moved_m = fix.pose.position.x() - then.pose.position.x();
            turns.push((moved_m - (x_m - x_then_m), fix.relative.sigma_m(Vec3::zero())));
        }
    }
    turns
}

type Pick = fn(&Figures) -> f64;

fn mean_of(all: &[Figures], pick: Pick) -> f64 {
    rms(all.iter().map(pick))
}

/// What the field scene does to the sensors: rays instead of cones for the echosounders, rounding of cable and depth as
/// noise.
const SETTINGS: &str = "[navigation]
gyro_noise_degps_rthz = 0.007
accel_noise_mps2_rthz = 0.001
accel_bias_mps2 = 0.02
gyro_bias_time_s = 300
tether_sd_m = 0.003
tether_scale_sd = 1e-4
slack_sd_m = 0.085
slack_time_s = 15
deviation_deg = 5
depth_sd_m = 0.009
heading_sd_deg = 0.3
tilt_sd_deg = 0.3
echo_sd_m = 0.02
echo_beam_deg = 0.1
return_sd_m = 0.011

[heads]";

/// The field scene over so many metres.
fn field(seed: u64, length_m: f64) -> Scene {
    let scene = include_str!("../deploy/scenes/vita1-field.toml");
    let length = format!("distance_m = {length_m}");
    let shorter = scene.replace("distance_m = 130", &length).replace("../vehicles/", "");
    assert!(shorter.contains(&length));
    let load = |name: &str| {
        let text = String::from_utf8(shipped::vehicle_file(name)?).map_err(|error| error.to_string())?;
        Ok(text.replace("[heads]", SETTINGS).into_bytes())
    };
    shipped::seeded(&shorter, &load, Some(seed))
}

/// Degrees of freedom of a pose.
const POSE: [usize; 6] = [0, 1, 2, 6, 7, 8];

/// Normalised estimation error squared (NEES) of the pose.
fn nees(epoch: &tracking::Epoch) -> f64 {
    let covariance = SMatrix::<f64, 6, 6>::from_fn(|i, j| epoch.factors.covariance(POSE[i], POSE[j]));
    let error = SVector::<f64, 6>::from_fn(|i, _| epoch.errors[POSE[i]]);
    error.dot(&covariance.cholesky().unwrap().solve(&error))
}

/// One dive with the filter, and what the same returns give without it and with the truth.
struct Dives {
    filter: Track,
    without: Figures,
    /// Error of the hole of each section, m, and its standard deviation as told.
    holes: Vec<(f64, f64)>,
}

fn dives(seed: u64) -> Dives {
    let scene = field(seed, 65.0);
    let vehicle = &scene.vehicle;
    let direct = DirectNavigation::new(vehicle.tunnel.profile.clone(), vehicle.site);
    let without = figures(&dive(&scene, direct, Silence::default()));
    let filter = dive(&scene, filter(&scene), Silence::default());
    let truth = tracking::true_dive(&scene);
    let pairs = filter.report.sections.iter().filter_map(|ours| {
        let same = |other: &f64| (other - ours.start_m).abs() < 1e-6;
        let true_one = truth.report.sections.iter().find(|other| same(&other.start_m))?;
        Some((ours.hole_m? - true_one.hole_m?, ours.hole_sigma_m))
    });
    let holes = pairs.collect();
    Dives { filter, without, holes }
}

#[test]
fn field_dives_are_tracked_and_the_filter_knows_how_well() {
    let all: Vec<Dives> = std::thread::scope(|scope| {
        let half =
            |odd: u64| move || (1..=SEEDS).filter(|seed| seed % 2 == odd).map(dives).collect::<Vec<_>>();
        let [odd, even] = [1, 0].map(|odd| scope.spawn(half(odd)));
        odd.join().unwrap().into_iter().chain(even.join().unwrap()).collect()
    });
    accuracy(&all);
    consistent_estimates(&all);
    consistent_innovations(&all);
    holes_within_their_bounds(&all);
}

/// Across the tunnel within 5 cm, a turn's way within 2 % of T_x, three times better than without a filter.
fn accuracy(all: &[Dives]) {
    let ours: Vec<Figures> = all.iter().map(|dives| figures(&dives.filter)).collect();
    let theirs: Vec<Figures> = all.iter().map(|dives| dives.without).collect();
    println!("| rms over {SEEDS} dives | filter | without |\n|---|---|---|");
    let rows: [(&str, Pick); 8] = [
        ("across, m", |f| f.across_m),
        ("up, m", |f| f.up_m),
        ("along, m", |f| f.along_m),
        ("displacement over a turn, m", |f| f.turn_m),
        ("its sigma as told, m", |f| f.turn_sigma_m),
        ("yaw, deg", |f| f.yaw_deg),
        ("roll and pitch, deg", |f| f.tilt_deg),
        ("share of pings with a fix", |f| f.fixed),
    ];
    for (name, pick) in rows {
        println!("| {name} | {:.4} | {:.4} |", mean_of(&ours, pick), mean_of(&theirs, pick));
    }
    for (ours, theirs) in ours.iter().zip(&theirs) {
        assert!(ours.across_m < 0.05 && ours.up_m < 0.05, "{ours:?}");
        assert!(3.0 * ours.across_m < theirs.across_m, "{ours:?} {theirs:?}");
        assert!(ours.fixed > 0.99, "{ours:?}");
    }
    let limit_m = f64::max(0.02 * T_X_M, 0.03);
    assert!(mean_of(&ours, |f| f.turn_m) < limit_m, "{:.4} m a turn", mean_of(&ours, |f| f.turn_m));
}

/// NEES of the pose, meaned over the dives epoch by epoch, lies within its 95 % bounds nine times out of ten.
fn consistent_estimates(all: &[Dives]) {
    let epochs = all.iter().map(|dives| dives.filter.epochs.len()).min().unwrap();
    let runs = all.len() as f64;
    let means: Vec<f64> = (SETTLED..epochs)
        .map(|epoch| all.iter().map(|dives| nees(&dives.filter.epochs[epoch])).sum::<f64>() / runs)
        .collect();
    // Wilson and Hilferty's cube: close to chi-square's own bounds with so many degrees of freedom.
    let freedom = runs * POSE.len() as f64;
    let bound = |z: f64| {
        let cube = 1.0 - 2.0 / (9.0 * freedom) + z * math::sqrt(2.0 / (9.0 * freedom));
        cube * cube * cube * POSE.len() as f64
    };
    let within = share(means.iter().map(|mean| (bound(-1.96)..=bound(1.96)).contains(mean)));
    let mean = means.iter().sum::<f64>() / means.len() as f64;
    println!(
        "NEES of 6: mean {mean:.2}, within {:.2} to {:.2} at {within:.3} of times",
        bound(-1.96),
        bound(1.96)
    );
    assert!(within > 0.9, "{within}");
}

/// NIS of each kind of sensor, meaned over ten seconds and all dives, lies within its 95 % bounds; that of sensors whose noise
/// is less than what they are trusted for (rounding taken for noise, a compass without steel near) doesn't lie above.
fn consistent_innovations(all: &[Dives]) {
    for (name, sources, both_sides) in [
        ("head", 0..1, true),
        ("echosounders", 1..5, true),
        ("depth", 5..6, false),
        ("attitude", 6..7, false),
        ("tether", 7..8, false),
    ] {
        let mut bins = vec![(0.0, 0_u64); 40];
        for dives in all {
            for source in sources.clone() {
                add_to_bins(&mut bins, &dives.filter, source);
            }
        }
        bins.retain(|(_, count)| *count > 0);
        let normal = |(sum, count): &(f64, u64)| {
            let expected = *count as f64 * GATED_MEAN;
            (sum - expected) / math::sqrt(2.0 * expected)
        };
        let z: Vec<f64> = bins.iter().map(normal).collect();
        let within = share(z.iter().map(|z| *z < 1.96 && (*z > -1.96 || !both_sides)));
        let (sum, count) = bins.iter().fold((0.0, 0), |(sum, n), (s, c)| (sum + s, n + c));
        println!("NIS of {name}: mean {:.3}, within bounds at {within:.2} of times", sum / count as f64);
        assert!(within > 0.7, "{name}: {z:.1?}");
    }
}

/// Mean of chi-square with one degree of freedom below the gate of 99.9 %.
const GATED_MEAN: f64 = 0.988;
const BIN_S: f64 = 10.0;

fn add_to_bins(bins: &mut [(f64, u64)], track: &Track, source: usize) {
    let mut before = Consistency::default();
    for (at, _, counted) in track.consistency.iter().filter(|(_, number, _)| *number == source) {
        let bin = math::floor_to_i64(at.since(START).as_secs_f64() / BIN_S);
        if let Some((sum, count)) = usize::try_from(bin).ok().and_then(|bin| bins.get_mut(bin)) {
            *sum += counted.nis_sum - before.nis_sum;
            *count += counted.used - before.used;
        }
        before = *counted;
    }
}

/// D is within two of its standard deviations of what the same returns give at their true places, 90 to 99 % of the time.
fn holes_within_their_bounds(all: &[Dives]) {
    let holes: Vec<(f64, f64)> = all.iter().flat_map(|dives| dives.holes.iter().copied()).collect();
    let within = share(holes.iter().map(|(error, sigma)| error.abs() <= 2.0 * sigma));
    let [error_m, sigma_m] = [rms(holes.iter().map(|h| h.0)), rms(holes.iter().map(|h| h.1))];
    println!(
        "D of {} sections: error {error_m:.4} m, sigma {sigma_m:.4} m, within two: {within:.3}",
        holes.len()
    );
    assert!((0.9..=0.99).contains(&within), "{within}");
}

fn share(of: impl Iterator<Item = bool>) -> f64 {
    let (mut n, mut yes) = (0.0, 0.0);
    for is in of {
        n += 1.0;
        yes += f64::from(u8::from(is));
    }
    yes / f64::max(n, 1.0)
}

/// Each sensor lost for a while, and for good: the error stays within what is told of it, and grows no faster.
#[test]
fn whatever_falls_silent_the_error_stays_within_its_bounds() {
    let scene = field(3, 40.0);
    for (name, sources) in [
        ("the head", vec![0]),
        ("the left echosounder", vec![1]),
        ("all echosounders", vec![1, 2, 3, 4]),
        ("depth", vec![5]),
        ("the inertial unit", vec![6]),
        ("the tether", vec![7]),
        ("all but the inertial unit", vec![0, 1, 2, 3, 4, 5, 7]),
        ("everything", vec![0, 1, 2, 3, 4, 5, 6, 7]),
    ] {
        for to_s in [70.0, 120.0, f64::INFINITY] {
            let silence = Silence { sources: sources.clone(), from_s: 60.0, to_s };
            let track = dive(&scene, filter(&scene), silence);
            let off = |epoch: &tracking::Epoch| {
                POSE.map(|i| epoch.errors[i].abs() / math::sqrt(epoch.factors.variance(i)))
            };
            let settled = &track.epochs[SETTLED..];
            let within = share(settled.iter().flat_map(off).map(|off| off <= 3.0));
            let worst = settled.iter().flat_map(off).fold(0.0, f64::max);
            let lost = share(track.fixes.iter().map(|tracked| tracked.fix.is_err()));
            println!(
                "{name} from 60 to {to_s} s: within 3 sigma {within:.4}, worst {worst:.1}, no fix {lost:.2}"
            );
            // Of normal errors 0.3 % are beyond.
            assert!(within > 0.995, "{name} to {to_s}: {within}");
            let is_needed = sources.contains(&7) && !sources.contains(&6) && to_s > 100.0;
            assert_eq!(
                lost > 0.1,
                is_needed || (sources.len() == 8 && to_s > 100.0),
                "{name} to {to_s}: {lost}"
            );
        }
    }
}
