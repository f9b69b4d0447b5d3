//! Speed of the navigation filter's parts, each compared in the same run with a dense filter that has the same number
//! of states. Prints Markdown.
//!
//! `cargo bench -p headrace_tests --bench fusion` runs on one core in some seconds. The measured parts take turns, and
//! the best round of each part counts. Absolute times drift on shared machines, but the ratios hold.

#![expect(clippy::disallowed_methods, reason = "a benchmark reads the clock")]
#![expect(clippy::unwrap_used, reason = "a failed step ends the benchmark")]

mod dense;
mod dive;

use std::hint::black_box;
use std::time::Instant;

use ahrs::{Ahrs as _, Madgwick};
use headrace_fusion::filter::factors::Factors;
use headrace_fusion::filter::inertial::{InertialSample, Leg};
use headrace_fusion::filter::measure;
use headrace_fusion::filter::settings::Settings;
use headrace_geometry::frames::Vec3;
use headrace_geometry::time::DurNs;
use nalgebra_of_peers as peers;

use dense::{Dense, Published};
use dive::{Dive, GRAVITY_MPS2, SAMPLE_S};

const ROUNDS: usize = 200;
/// Number of runs in each round. A round is long enough for the clock's resolution, and short enough to be often
/// undisturbed on a shared machine.
const RUNS: u32 = 500;
/// Number of runs after which the initial state is restored, so that repetition doesn't make the state diverge.
const RUNS_FROM_ONE_START: u32 = 20;
const BETWEEN_CLONES: DurNs = DurNs(2_000_000_000);

fn main() {
    println!(
        "{}, {} {}, {ROUNDS} rounds in turns, best of each\n",
        cpu(),
        std::env::consts::ARCH,
        std::env::consts::OS
    );
    println!("| what | figure | yardstick in the same run | ratio |\n|---|---|---|---|");
    // A part's name as argument runs that part alone: `cargo bench -p headrace_tests --bench fusion -- predict`.
    let wanted = std::env::args().nth(1).filter(|word| !word.starts_with('-'));
    let benches: [(&str, fn()); 4] =
        [("predict", predict), ("update", update), ("sample", sample), ("epoch", epoch)];
    for (name, bench) in benches {
        if wanted.as_deref().is_none_or(|word| word == name) {
            bench();
        }
    }
}

fn cpu() -> String {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model =
        info.lines().find_map(|line| line.strip_prefix("model name")).unwrap_or(": unknown processor");
    model.trim_start_matches(['\t', ' ', ':']).to_owned()
}

/// Work to be timed; the argument is its number of repetitions.
type Work<'a> = &'a mut dyn FnMut(u32);

/// Shortest time that one run of each piece of work takes, ns.
fn in_turns<const K: usize>(mut works: [Work<'_>; K]) -> [f64; K] {
    let mut best = [f64::INFINITY; K];
    for _ in 0..ROUNDS {
        for (work, best) in works.iter_mut().zip(&mut best) {
            let started = Instant::now();
            work(RUNS);
            *best = best.min(started.elapsed().as_secs_f64() * 1e9 / f64::from(RUNS));
        }
    }
    best
}

/// Runs `step` repeatedly on a copy of `start`. After every [`RUNS_FROM_ONE_START`] runs, a new copy is made.
fn from_a_start<T: Clone>(start: &T, runs: u32, mut step: impl FnMut(&mut T)) {
    for _ in 0..runs / RUNS_FROM_ONE_START {
        let mut value = start.clone();
        for _ in 0..RUNS_FROM_ONE_START {
            step(black_box(&mut value));
        }
        black_box(&value);
    }
}

fn row(what: &str, ns: f64, yardstick: &str, yardstick_ns: f64) {
    println!("| {what} | {ns:.0} ns | {yardstick}: {yardstick_ns:.0} ns | {:.2} |", ns / yardstick_ns);
}

/// Measures the filter's prediction from one epoch to the next, without sensor readings.
fn predict() {
    let dive = Dive::under_way();
    let settings = Settings::default();
    let (leg, factors) = (dive.leg(), dive.factors());
    let transition = leg.transition(&settings);
    let (dense20, dense18, dense15) = (Dense::<20>::new(), Dense::<18>::new(), Dense::<15>::new());
    let published = Published::<20>::new();
    let [ours, joseph20, joseph18, joseph15, kfilter] = in_turns([
        &mut |runs| {
            from_a_start(&factors, runs, |factors| {
                transition.carry(factors);
                leg.disturb(&settings, &transition, factors);
            });
        },
        &mut |runs| from_a_start(&dense20, runs, Dense::predict),
        &mut |runs| from_a_start(&dense18, runs, Dense::predict),
        &mut |runs| from_a_start(&dense15, runs, Dense::predict),
        &mut |runs| from_a_start(&published, runs, Published::predict),
    ]);
    let what = "predict, 20 states";
    row(what, ours, "dense F P F' + Q, 20 states", joseph20);
    row(what, ours, "the same, 18 states", joseph18);
    row(what, ours, "the same, 15 states", joseph15);
    row(what, ours, "`kfilter`, 20 states", kfilter);
}

/// The three measurement rows of an attitude reading, for a filter with `N` states.
fn attitude_rows<const N: usize>() -> [([f64; N], f64, f64); 3] {
    let dive = Dive::under_way();
    let rows = measure::attitude(&dive.state(), dive.state().attitude, 0.03, 0.02);
    rows.map(|row| (core::array::from_fn(|i| row.h[i]), row.residual, row.noise))
}

fn three_rows<const N: usize>(factors: &mut Factors<N>, rows: &[([f64; N], f64, f64); 3]) {
    let mut errors = [0.0; N];
    for (h, residual, noise) in rows {
        let expected: f64 = h.iter().zip(&errors).map(|(h, e)| h * e).sum();
        let gain = factors.measure(h, *noise);
        for (error, k) in errors.iter_mut().zip(&gain.k) {
            *error += k * (residual - expected);
        }
    }
    black_box(errors);
}

/// Measures the filter's update of estimate and covariance by three measured numbers.
fn update() {
    let (rows20, rows18, rows15) = (attitude_rows::<20>(), attitude_rows::<18>(), attitude_rows::<15>());
    let (factors20, factors18, factors15) =
        (dense::factors::<20>(), dense::factors::<18>(), dense::factors::<15>());
    let (dense20, dense18, dense15) = (Dense::<20>::new(), Dense::<18>::new(), Dense::<15>::new());
    let published = Published::<20>::new();
    let [ours20, ours18, ours15, joseph20, joseph18, joseph15, kfilter] = in_turns([
        &mut |runs| from_a_start(&factors20, runs, |factors| three_rows(factors, &rows20)),
        &mut |runs| from_a_start(&factors18, runs, |factors| three_rows(factors, &rows18)),
        &mut |runs| from_a_start(&factors15, runs, |factors| three_rows(factors, &rows15)),
        &mut |runs| from_a_start(&dense20, runs, Dense::update),
        &mut |runs| from_a_start(&dense18, runs, Dense::update),
        &mut |runs| from_a_start(&dense15, runs, Dense::update),
        &mut |runs| from_a_start(&published, runs, Published::update),
    ]);
    row("3-row update, 20 states", ours20, "dense Joseph form, 20 states", joseph20);
    row("3-row update, 18 states", ours18, "dense Joseph form, 18 states", joseph18);
    row("3-row update, 15 states", ours15, "dense Joseph form, 15 states", joseph15);
    row("3-row update, 20 states", ours20, "`kfilter`, 20 states, not Joseph's form", kfilter);
}

/// Measures the time to process an inertial sample of a turning vehicle.
fn sample() {
    let state = Dive::under_way().state();
    let (rate, force) = ([0.02, -0.01, 0.03], [0.3, 0.2, 9.8]);
    let felt =
        InertialSample { rate_radps: Some(Vec3::of(rate.into())), force_mps2: Some(Vec3::of(force.into())) };
    let madgwick = Madgwick::new(SAMPLE_S, 0.1);
    let (rate, force) = (peers::Vector3::from(rate), peers::Vector3::from(force));
    let [ours, peer] = in_turns([
        &mut |runs| {
            from_a_start(&(state, Leg::default()), runs, |(state, leg)| {
                state.go_on(black_box(&felt), SAMPLE_S, GRAVITY_MPS2, leg);
            });
        },
        &mut |runs| {
            from_a_start(&madgwick, runs, |madgwick| {
                madgwick.update_imu(black_box(&rate), black_box(&force)).unwrap();
            });
        },
    ]);
    row(
        "an inertial sample: place, attitude, what it does to errors",
        ours,
        "attitude by `ahrs` Madgwick",
        peer,
    );
}

/// Measures the time of a complete epoch of the filter.
fn epoch() {
    let mut dive = Dive::under_way();
    let ((mut clones, mut at), factors) = (dive.clones(), dive.factors());
    let dense = Dense::<20>::new();
    let [epoch, rows9, note] = in_turns([
        &mut |runs| (0..runs).for_each(|_| dive.epoch()),
        &mut |runs| {
            from_a_start(&dense, runs, |dense| {
                dense.predict();
                (0..3).for_each(|_| dense.update());
            });
        },
        &mut |runs| {
            for _ in 0..runs {
                at = at + BETWEEN_CLONES;
                clones.note(at, black_box(&factors));
            }
        },
    ]);
    let what = "an epoch: 10 inertial samples, 8 measured numbers, the clones";
    row(what, epoch, "dense predict and 9 rows alone", rows9);
    row("of it, a clone of a full clones every 20 epochs", note, "those epochs", 20.0 * epoch);
}
