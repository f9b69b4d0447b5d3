//! Dives in a simulated world of faults. The dive of every seed must satisfy all invariants.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a failed step ends the test")]

use std::collections::BTreeMap;

use headrace_tests::Folder;
use headrace_tests::world::fewest::fewest;
use headrace_tests::world::invariants::broken;
use headrace_tests::world::plan::Fault;
use headrace_tests::world::{DiveResult, Sabotage, World, seeds};

/// Default seeds of the simulated worlds.
const SEEDS: std::ops::Range<u64> = 0..300;
/// Number of simulated worlds tried with each sabotage (a deliberate fault of the program). At least one of them must
/// detect the sabotage.
const ENOUGH: u64 = 200;

/// Runs a dive in the world of a seed, with all or some of the world's faults. Returns the invariants that the dive
/// breaks, and its results.
fn lived(
    folder: &Folder,
    seed: u64,
    sabotage: Option<Sabotage>,
    faults: Option<&[Fault]>,
) -> (Vec<String>, DiveResult) {
    let lived = World::with(seed, sabotage, faults).live();
    let replayed = lived.replay(folder, sabotage);
    (broken(&lived, &replayed), lived)
}

/// Finds as few faults as possible with which the world of a seed breaks an invariant. Returns these faults and the
/// broken invariants as text.
fn reduced(folder: &Folder, seed: u64, sabotage: Option<Sabotage>, faults: &[Fault]) -> String {
    let left = fewest(faults, |faults| !lived(folder, seed, sabotage, Some(faults)).0.is_empty());
    let (broken, lived) = lived(folder, seed, sabotage, Some(&left));
    let (all, left) = (faults.len(), left.len());
    format!("seed {seed}, {left} of {all} faults:\n{:?}\n{broken:#?}", lived.plan)
}

#[test]
fn every_loss_caused_by_a_fault_is_reported() {
    let folder = Folder::new();
    let (mut kinds, mut failures, mut skipping) = (BTreeMap::<String, usize>::new(), 0, 0);
    let mut failed = Vec::new();
    for seed in seeds(SEEDS) {
        let (broken, lived) = lived(&folder, seed, None, None);
        let faults = lived.plan.faults();
        if !broken.is_empty() {
            failed.push(reduced(&folder, seed, None, &faults));
            println!("{}", failed[failed.len() - 1]);
        }
        for fault in &faults {
            *kinds.entry(fault.kind()).or_default() += 1;
        }
        failures += lived.disk_failures;
        skipping += usize::from(lived.has_left_out);
    }
    let worlds = seeds(SEEDS).count();
    println!(
        "{worlds} worlds, {failures} operations of the disk failed, {skipping} recorders left packets out, {kinds:#?}"
    );
    assert!(failed.is_empty(), "{} of {worlds} worlds failed:\n{}", failed.len(), failed.join("\n"));
    if worlds >= 100 {
        assert!(skipping > 0, "no recorder's queue was full long enough");
        assert_eq!(kinds.len(), 10 + 4 + 7 + 4 + 2, "kinds of faults: {kinds:#?}");
    }
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
            let (broken, lived) = lived(&folder, seed, Some(sabotage), None);
            (!broken.is_empty()).then(|| (seed, lived.plan.faults()))
        });
        let (seed, faults) =
            found.unwrap_or_else(|| panic!("{sabotage:?} breaks no invariant in {ENOUGH} worlds"));
        println!("{sabotage:?}: {}", reduced(&folder, seed, Some(sabotage), &faults));
    }
}

#[test]
fn blocked_terminal_does_not_change_results() {
    for seed in 0..20 {
        let [taken, stood] = [false, true].map(|is_open| World::new(seed).with_terminal(is_open).live());
        assert_eq!((taken.digest, &taken.consumed), (stood.digest, &stood.consumed), "seed {seed}");
        let bytes = |lived: &DiveResult| lived.left.iter().map(|file| file.bytes.len()).sum::<usize>();
        assert_eq!(bytes(&taken), bytes(&stood), "seed {seed}");
    }
}
