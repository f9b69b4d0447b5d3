//! Compares displayed causes with true ones, over random dives with one or two injected causes.
//!
//! `cargo bench -p headrace_tests --bench causes [-- FROM TO [OPTION]]` runs the dives with numbers FROM to TO
//! (default 0 to 500). OPTION is one of:
//! - `wrong`: lists the stretches with a wrong cause;
//! - `sections`: lists all sections;
//! - `remedies`: also simulates the displayed remedy of each missed stretch;
//! - `knowing`: prints how often a reference is right that knows everything about a dive except its noise.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a failed step ends the benchmark")]

use std::sync::atomic::{AtomicU64, Ordering};

use headrace_tests::interventions::{Judged, Matrix, UpperBound, intervene, kinds, remedies};

/// For each injected cause, the ratio of the hole's diameter to the target without this cause: median, and in brackets
/// the maximum, over the sections of a stretch.
fn over_target(sections: &[Judged], target_m: f64) -> String {
    let of_cause = |k: usize| {
        let mut over: Vec<f64> =
            sections.iter().filter_map(|section| Some(section.without_m.get(k)? / target_m)).collect();
        over.sort_by(f64::total_cmp);
        Some(format!("{:.2} ({:.2})", over.get(over.len() / 2)?, over.last()?))
    };
    (0..).map_while(of_cause).collect::<Vec<_>>().join(", ")
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    let number = |k: usize| arguments.get(k).and_then(|word| word.parse::<u64>().ok());
    let (from, to) = (number(0).unwrap_or(0), number(1).unwrap_or(500));
    let wrong = arguments.iter().any(|word| word == "wrong");
    let remedy = arguments.iter().any(|word| word == "remedies");
    let is_knowing = arguments.iter().any(|word| word == "knowing");
    let sections = arguments.iter().any(|word| word == "sections");
    let next = AtomicU64::new(from);
    let work = || {
        let numbers =
            std::iter::repeat_with(|| next.fetch_add(1, Ordering::SeqCst)).take_while(|seed| *seed < to);
        let dive = |seed: u64| {
            let dive = intervene(seed, &kinds(seed));
            let done = if remedy { remedies(&dive) } else { Vec::new() };
            let mut knowing = UpperBound::default();
            if is_knowing {
                knowing.add(&dive);
            }
            (seed, dive, done, knowing)
        };
        numbers.map(dive).collect::<Vec<_>>()
    };
    let mut dives: Vec<_> = std::thread::scope(|scope| {
        let threads = [scope.spawn(work), scope.spawn(work)];
        threads.into_iter().flat_map(|thread| thread.join().unwrap()).collect()
    });
    dives.sort_by_key(|(seed, ..)| *seed);
    let mut matrix = Matrix::default();
    let (mut runs, mut clear) = (0, 0);
    for (seed, dive, done, _) in &dives {
        for remedied in done {
            (runs, clear) = (runs + 1, clear + u32::from(remedied.clears));
            if wrong && !remedied.clears {
                let over = remedied.then_m.iter().filter(|[_, hole_m]| *hole_m > dive.drawn.target_m);
                println!(
                    "dive {seed}: not cleared: {:?}; T {:.3}, then {:.2?}; {:?}",
                    remedied.reported,
                    dive.drawn.target_m,
                    over.collect::<Vec<_>>(),
                    dive.drawn.injected
                );
            }
        }
        matrix.add(dive);
        for section in dive.sections.iter().filter(|_| sections) {
            let e = &section.evidence;
            println!(
                "{seed} {:.2} D {:.3} {:?} displayed {:?} run {:?}: v {:.3} gaps {:.2} {:.2} {:.2} steps {:.3} {:.3} swing {:.3} lost {}",
                section.ends_m[0],
                section.hole_m,
                section.right,
                section.reported,
                section.run,
                e.speed_mps,
                e.pass_gap_s,
                e.even_pass_gap_s,
                e.all_pass_gap_s,
                e.t_y_m,
                e.middle_t_y_m,
                e.swing_m,
                e.lost_in_hole,
            );
        }
        for stretch in dive.stretches() {
            let is_right = stretch.right.iter().any(|set| set == stretch.reported());
            if wrong && (!is_right || stretch.runs() > 1) {
                let [first, last] = [stretch.sections.first().unwrap(), stretch.sections.last().unwrap()];
                println!(
                    "dive {seed}: {:.2} to {:.2}, T {:.3}, right {:?}, displayed {:?}, {} runs, over T without each {}; {:?}",
                    first.ends_m[0],
                    last.ends_m[1],
                    dive.drawn.target_m,
                    stretch.right,
                    stretch.reported(),
                    stretch.runs(),
                    over_target(stretch.sections, dive.drawn.target_m),
                    dive.drawn.injected
                );
            }
        }
    }
    print!("{}", matrix.text());
    if remedy {
        println!("runs cleared by the displayed remedy: {clear} of {runs}");
    }
    if is_knowing {
        let UpperBound { stretches, pairs } =
            dives.iter().fold(UpperBound::default(), |sum, dive| sum.and(dive.3));
        println!("reference that knows all but the noise: stretches, two causes: {}", stretches.text());
        println!("of these, stretches with a true set of two causes: {}", pairs.text());
    }
}
