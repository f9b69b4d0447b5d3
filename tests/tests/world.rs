//! Dives in the simulated world of faults.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test stops at what it can't do")]

use headrace_tests::world::World;
use headrace_tests::world::plan::Ending;

#[test]
fn probe() {
    let seeds: u64 = std::env::var("SEEDS").map_or(20, |seeds| seeds.parse().unwrap());
    let mut bad = 0;
    for seed in 0..seeds {
        let lived = World::new(seed).live();
        let finished = lived.plan.ending == Ending::Finished;
        let mut told = Vec::new();
        for (n, line) in lived.lines.iter().enumerate() {
            let h = &line.history;
            if line.untouched && (h.opened, h.lost, h.dropped) != (1, 0, 0) {
                told.push(format!("{n} touched {line:?}"));
            }
            if line.lossless && finished && h.dropped == 0 && line.good != line.whole {
                told.push(format!("{n} lost {line:?}"));
            }
            if finished && !h.last.starts_with("running") {
                told.push(format!("{n} not back {line:?}"));
            }
            if h.dropped > 0 {
                told.push(format!("{n} dropped {line:?}"));
            }
        }
        if !told.is_empty() {
            bad += 1;
            println!("seed {seed}\n{:?}", lived.plan);
            for line in told {
                println!("   {line}");
            }
        }
    }
    println!("{bad} bad");
}
