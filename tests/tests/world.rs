//! Dives in a simulated world of faults. For every seed, they satisfy all invariants.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a failed step ends the test")]

use std::collections::BTreeMap;

use headrace_tests::Folder;
use headrace_tests::world::invariants::broken;
use headrace_tests::world::plan::Plan;
use headrace_tests::world::{DiveResult, Sabotage, World};

/// Default seeds of the simulated worlds. An environment variable can set others: `HEADRACE_WORLD_SEEDS=1000..2000`.
const SEEDS: std::ops::Range<u64> = 0..300;
/// Number of simulated worlds tried with each sabotage (a deliberate fault of the program). At least one of them must
/// detect the sabotage.
const ENOUGH: u64 = 100;

fn seeds() -> std::ops::Range<u64> {
    let Ok(text) = std::env::var("HEADRACE_WORLD_SEEDS") else { return SEEDS };
    let (from, to) = text.split_once("..").unwrap();
    from.parse().unwrap()..to.parse().unwrap()
}

/// Runs a dive in the world of a seed; returns its broken invariants and its results.
fn lived(folder: &Folder, seed: u64, sabotage: Option<Sabotage>) -> (Vec<String>, DiveResult) {
    let lived = World::sabotaged(seed, sabotage).live();
    let replayed = lived.replay(folder);
    (broken(&lived, &replayed), lived)
}

fn count(plan: &Plan, faults: &mut BTreeMap<String, usize>) {
    let cables = plan.cables.iter().flatten().map(|window| format!("cable: {:?}", window.what));
    let machine = plan.machine.iter().map(|window| format!("machine: {:?}", window.what));
    let disk = plan.disk.iter().map(|window| format!("disk: {:?}", window.what));
    for kind in cables.chain(machine).chain(disk).chain([format!("end: {:?}", plan.ending)]) {
        *faults.entry(kind).or_default() += 1;
    }
}

#[test]
fn every_loss_caused_by_a_fault_is_reported() {
    let folder = Folder::new();
    let (mut faults, mut failures, mut skipping) = (BTreeMap::new(), 0, 0);
    for seed in seeds() {
        let (broken, lived) = lived(&folder, seed, None);
        let plan = &lived.plan;
        assert!(broken.is_empty(), "seed {seed}:\n{plan:?}\n{broken:#?}");
        count(plan, &mut faults);
        failures += lived.disk_failures;
        skipping += usize::from(lived.summary.is_some_and(|summary| summary.skipped > 0));
    }
    let worlds = seeds().count();
    println!(
        "{worlds} worlds, {failures} operations of the disk failed, {skipping} recorders left packets out, {faults:#?}"
    );
    assert!(skipping > 0, "no recorder's queue was full long enough");
    assert_eq!(faults.len(), 10 + 4 + 5 + 3, "kinds of faults: {faults:#?}");
}

#[test]
fn same_seed_gives_the_same_world() {
    for seed in 0..5 {
        let [first, second] = [0, 1].map(|_| World::new(seed).live());
        assert_eq!((first.digest, &first.consumed), (second.digest, &second.consumed));
        assert_eq!((first.disk_failures, first.certain), (second.disk_failures, second.certain));
        let bytes = |lived: &DiveResult| {
            lived.left.iter().map(|file| (file.path.clone(), file.bytes.clone())).collect::<Vec<_>>()
        };
        assert_eq!(bytes(&first), bytes(&second));
    }
}

#[test]
fn every_sabotage_breaks_an_invariant() {
    let folder = Folder::new();
    for sabotage in Sabotage::ALL {
        let found = (0..ENOUGH).find_map(|seed| {
            let (broken, ..) = lived(&folder, seed, Some(sabotage));
            (!broken.is_empty()).then_some((seed, broken))
        });
        let (seed, broken) =
            found.unwrap_or_else(|| panic!("{sabotage:?} breaks no invariant in {ENOUGH} worlds"));
        println!("{sabotage:?}: found in world {seed}: {}", broken[0]);
    }
}

#[test]
fn blocked_terminal_does_not_change_results() {
    for seed in 0..20 {
        let [taken, stood] = [false, true].map(|stands| World::new(seed).with_terminal(stands).live());
        assert_eq!((taken.digest, &taken.consumed), (stood.digest, &stood.consumed), "seed {seed}");
        let bytes = |lived: &DiveResult| lived.left.iter().map(|file| file.bytes.len()).sum::<usize>();
        assert_eq!(bytes(&taken), bytes(&stood), "seed {seed}");
    }
}
