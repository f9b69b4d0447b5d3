//! Compares the advised speed with the largest speed at which sections truly pass. Simulated dives find the latter.
//! Prints Markdown.
//!
//! `cargo bench -p headrace_tests --bench advice` runs all parts; `-- truth`, `-- sweep` or `-- planned` runs one part:
//! - truth: ratio of the advised speed to the largest passing speed, over `--dives N` (100) steady and swaying dives
//!   from `--from-seed N`, or over the dives of `--seeds A,B,...`;
//! - sweep: dives with four heads at speeds 1 mm/s apart; first with heads in phase at 0.1 m/s, then with heads in phase
//!   at the driven speed;
//! - planned: each shipped vehicle in each mode at 0.95 of the planned speed.
//!
//! The true hole D_true comes from `headrace_tests::truth`, which shares nothing with the program's coverage.

#![expect(clippy::unwrap_used, clippy::panic, reason = "a failed step ends the benchmark")]

use std::sync::atomic::{AtomicUsize, Ordering};

use headrace_tests::field_table::VEHICLES;
use headrace_tests::passable::{Compared, Outcome, Outing};

/// Smallest allowed ratio of the advised speed to the largest passing speed. The advice may be up to a tenth too slow.
/// `MOST` is the largest allowed ratio, because the advice may never be too fast. Both allow for rounding, because the
/// search for the passing speed uses steps of 2 %.
const LEAST: f64 = 0.899;
const MOST: f64 = 1.005;

fn main() {
    let mut words = std::env::args().skip(1).filter(|word| word != "--bench");
    let (mut only, mut dives, mut from_seed, mut seeds) = (None, 100, 0, Vec::new());
    while let Some(word) = words.next() {
        let mut number = || words.next().and_then(|word| word.parse::<u64>().ok());
        match word.as_str() {
            "--dives" => dives = number().unwrap(),
            "--from-seed" => from_seed = number().unwrap(),
            "--seeds" => seeds = words.next().unwrap().split(',').map(|seed| seed.parse().unwrap()).collect(),
            "truth" | "sweep" | "planned" => only = Some(word),
            _ => panic!(
                "{word}: known are truth, sweep, planned, --dives N, --from-seed N and --seeds A,B,..."
            ),
        }
    }
    let wants = |part: &str| only.as_deref().is_none_or(|only| only == part);
    if wants("truth") {
        truth(if seeds.is_empty() { (from_seed..from_seed + dives).collect() } else { seeds });
    }
    if wants("sweep") {
        sweep();
    }
    if wants("planned") {
        planned();
    }
}

/// Runs the work for all items on all cores. Returns the results in the order of the items.
fn all<T: Sync, R: Send>(of: &[T], run: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let next = AtomicUsize::new(0);
    let work = || {
        let mut done = Vec::new();
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            let Some(item) = of.get(number) else { return done };
            done.push((number, run(item)));
            eprint!("\r{} of {}", number + 1, of.len());
        }
    };
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let mut results: Vec<(usize, R)> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..cores).map(|_| scope.spawn(work)).collect();
        threads.into_iter().flat_map(|thread| thread.join().unwrap()).collect()
    });
    eprintln!();
    results.sort_by_key(|(number, _)| *number);
    results.into_iter().map(|(_, result)| result).collect()
}

fn truth(seeds: Vec<u64>) {
    println!(
        "| seed | vehicle | mode | target | sways | plan | advised | true | advised / true | changes a minute | followed: advised then | passing | can't say | falsely | D_true / T |"
    );
    println!("|{}", "---|".repeat(15));
    let outings: Vec<Outing> = seeds.into_iter().map(Outing::drawn).collect();
    let compared = all(&outings, Outing::compare);
    for (outing, compared) in outings.iter().zip(&compared) {
        println!(
            "| {} | {} | {} | {:.2} | {} | {:.3} | {:.4} | {:.4} | {:.3} | {:.1} | {:.4} | {:.3} | {:.3} | {} | {:.3} |",
            outing.seed,
            outing.vehicle.name,
            outing.mode,
            outing.target_m,
            if outing.effects.is_empty() { "-" } else { outing.effects.trim() },
            compared.plan_mps,
            compared.advised_mps,
            compared.true_mps.unwrap_or(f64::NAN),
            compared.ratio(),
            compared.planned.changes_a_minute(),
            advised(&compared.followed),
            compared.followed.passing,
            compared.followed.unsure,
            compared.followed.falsely,
            compared.followed.true_share
        );
    }
    for (what, sways) in [("steady", false), ("swaying", true)] {
        let of: Vec<&Compared> = outings
            .iter()
            .zip(&compared)
            .filter(|(outing, _)| outing.effects.is_empty() != sways)
            .map(|(_, compared)| compared)
            .collect();
        for (when, ratio) in [
            ("at the planned speed", Compared::ratio as fn(&Compared) -> f64),
            ("once followed", Compared::followed_ratio),
        ] {
            let count = |is: &dyn Fn(f64) -> bool| of.iter().filter(|compared| is(ratio(compared))).count();
            println!(
                "\n{what}, {when}: {} dives, {} between 0.9 and 1.0, {} above, {} below",
                of.len(),
                count(&|ratio| (LEAST..MOST).contains(&ratio)),
                count(&|ratio| ratio >= MOST),
                count(&|ratio| ratio < LEAST)
            );
        }
    }
}

fn sweep() {
    println!(
        "\n| driven | advised, started for 0.1 | from | nearest | passing | advised, started for driven | anew | passing | changes |"
    );
    println!("|{}", "---|".repeat(9));
    let outing = Outing::steady(VEHICLES[3], 1);
    let speeds: Vec<f64> = (60..=125).map(|mm| f64::from(mm) * 1e-3).collect();
    let both = all(&speeds, |speed_mps| [outing.dive(0.1, *speed_mps), outing.dive(*speed_mps, *speed_mps)]);
    for (speed_mps, [fixed, own]) in speeds.iter().zip(&both) {
        let anew =
            |of: &Outcome| of.median(|entry| entry.advice.anew.map_or(0.0, |anew| anew.planned_speed_mps));
        println!(
            "| {speed_mps:.3} | {:.4} | {:.4} | {:.4} | {:.2} | {:.4} | {:.4} | {:.2} | {:.1} |",
            advised(fixed),
            fixed.median(|entry| entry.advice.from_mps),
            fixed.median(|entry| entry.advice.nearest_mps.unwrap_or(0.0)),
            fixed.passing,
            advised(own),
            anew(own),
            own.passing,
            own.changes_a_minute()
        );
    }
    for (what, which) in [("started for 0.1", 0), ("started for the speed driven", 1)] {
        let jump = |pair: &[[Outcome; 2]]| {
            let [a, b] = [advised(&pair[0][which]), advised(&pair[1][which])];
            (a - b).abs() / a.max(b).max(1e-9)
        };
        let largest = both.windows(2).map(jump).fold(0.0, f64::max);
        println!("\n{what}: largest jump {:.1} %", 100.0 * largest);
    }
}

fn advised(outcome: &Outcome) -> f64 {
    outcome.advised_mps()
}

fn planned() {
    println!("\n| vehicle | mode | plan | driven | passing | can't say | falsely | D_true / T | advised |");
    println!("|{}", "---|".repeat(9));
    let mut outings = Vec::new();
    for vehicle in VEHICLES {
        for mode in ["slow", "medium", "fast", "faster", "fastest"] {
            outings.push(Outing { mode, ..Outing::steady(vehicle, 1) });
        }
    }
    let results = all(&outings, |outing| {
        let plan_mps = outing.plan_mps();
        let speed_mps = outing.planned_share * plan_mps;
        (plan_mps, speed_mps, (plan_mps > 0.0).then(|| outing.dive(speed_mps, speed_mps)))
    });
    for (outing, (plan_mps, speed_mps, outcome)) in outings.iter().zip(&results) {
        let Some(outcome) = outcome else {
            println!("| {} | {} | none | | | | | | |", outing.vehicle.name, outing.mode);
            continue;
        };
        println!(
            "| {} | {} | {plan_mps:.3} | {speed_mps:.4} | {:.3} | {:.3} | {} | {:.3} | {:.4} |",
            outing.vehicle.name,
            outing.mode,
            outcome.passing,
            outcome.unsure,
            outcome.falsely,
            outcome.true_share,
            advised(outcome)
        );
    }
}
