//! Cost of each effect of the simulator, and the time saved by simulating only the effects that a scene calls for.
//! Prints Markdown.
//!
//! `cargo bench -p headrace_tests --bench effects` runs all parts; `-- bare`, `-- cost`, `-- called` or `-- seven`
//! runs one part, and so does `-- mesh` in a build with `--features mesh`. Times are this thread's CPU time, the
//! minimum over several alternating rounds. Other load on the machine hardly affects them.

#![expect(clippy::unwrap_used, clippy::panic, reason = "a failed step ends the benchmark")]

mod bare;
mod called;
#[cfg(feature = "mesh")]
mod mesh;
mod workload;

use headrace_simulator::{Scene, Simulation};
use headrace_tests::scenes;

use workload::{EFFECTS, ROUNDS, SPEED_MPS, best, simulate, text};

fn main() {
    let wanted = std::env::args().nth(1).filter(|word| !word.starts_with('-'));
    let parts: &[(&str, fn())] = &[
        ("bare", bare::bare),
        ("cost", cost),
        ("called", called::called),
        ("seven", seven_kilometres),
        #[cfg(feature = "mesh")]
        ("mesh", mesh::mesh),
    ];
    for (name, part) in parts {
        if wanted.as_deref().is_none_or(|word| word == *name) {
            part();
        }
    }
}

/// Scene in which VITA 2 with four heads moves over `length_m` metres.
fn scene(length_m: f64, layout: &str, rest: &str) -> Scene {
    scenes::scene(&text(length_m, layout, rest))
}

fn named(effects: &[(&str, &str)]) -> String {
    let tables: Vec<String> =
        effects.iter().map(|(name, keys)| format!("[effects.{name}]\n{keys}\n")).collect();
    tables.concat()
}

/// Measures the CPU time of each simulator effect, alone and in addition to all other effects.
fn cost() {
    const LENGTH_M: f64 = 12.0;
    let returns = 4.0 * 50.0 * LENGTH_M / SPEED_MPS;
    let ns = |seconds: f64| seconds * 1e9 / returns;
    let none = scene(LENGTH_M, "sector_offset", "");
    let all = scene(LENGTH_M, "sector_offset", &named(&EFFECTS));
    println!("\n| effect | alone, ns a head's return | in company of all others |\n|---|---|---|");
    for (index, effect) in EFFECTS.iter().enumerate() {
        let alone = scene(LENGTH_M, "sector_offset", &named(&[*effect]));
        let others: Vec<_> =
            EFFECTS.iter().enumerate().filter(|(k, _)| *k != index).map(|(_, e)| *e).collect();
        let without = scene(LENGTH_M, "sector_offset", &named(&others));
        let [none_s, alone_s, without_s, all_s] = best(
            ROUNDS,
            [&mut || simulate(&none), &mut || simulate(&alone), &mut || simulate(&without), &mut || {
                simulate(&all)
            }],
        );
        // A current changes the duration of the dive. CPU times are therefore scaled to equal durations.
        let scale = |scene: &Scene| {
            Simulation::new(scene).map_or(1.0, |simulation| LENGTH_M / SPEED_MPS / simulation.duration_s())
        };
        println!(
            "| {} | {:+.0} | {:+.0} |",
            effect.0,
            ns(alone_s) * scale(&alone) - ns(none_s),
            ns(all_s) * scale(&all) - ns(without_s) * scale(&without)
        );
    }
}

/// Measures the time to simulate a dive through the whole tunnel with all effects.
fn seven_kilometres() {
    let all = scene(6990.0, "sector_offset", &named(&EFFECTS));
    let duration_s = Simulation::new(&all).unwrap().duration_s();
    let took_s = simulate(&all);
    println!(
        "\n7 km, four heads, all effects: {duration_s:.0} s of diving in {took_s:.1} s, {:.0} times real time",
        duration_s / took_s
    );
}
