//! Dives in a simulated world of faults. For every seed, the dive must satisfy all invariants.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a failed step ends the test")]

use std::collections::BTreeMap;

use headrace_geometry::time::DurNs;
use headrace_tests::Folder;
use headrace_tests::world::fewest::fewest;
use headrace_tests::world::invariants::broken;
use headrace_tests::world::plan::{BEGIN, CableFault, Fault, MachineFault, Window};
use headrace_tests::world::{
    DiveResult, Position, SENSOR_COUNT, Sabotage, TRUE_SPEED_MPS, World, seeds, true_chainage_m,
};

/// Default seeds of the simulated worlds.
const SEEDS: std::ops::Range<u64> = 0..300;
/// Number of simulated worlds tried with each sabotage (a deliberate fault of the program). At least one of them must
/// detect the sabotage.
const ENOUGH: u64 = 200;

/// Durations of the stalls in the tests, ms. `STALL_BEGINS` is the time at which each stall begins.
const STALLS_MS: [i64; 6] = [100, 250, 500, 1300, 2500, 5000];
const STALL_BEGINS: DurNs = DurNs::from_millis(5_000);
/// Largest error of the estimated speed while the position counts as reliable, m/s.
const SPEED_ERROR_MPS: f64 = 0.05;
/// Largest error of the chainage, and of the change of chainage between two updates. It is the number `SDS` of standard
/// deviations plus `ROUNDED_M`.
const SDS: f64 = 3.0;
const ROUNDED_M: f64 = 0.01;

/// Runs a dive in the world of a seed, with all or some of its faults; returns its broken invariants and its results.
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

/// Reduces the faults of a seed's world to as few as possible with which an invariant is still broken. Returns the
/// remaining faults and the broken invariants as text.
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
        let [taken, stood] =
            [false, true].map(|is_blocked| World::new(seed).with_terminal(is_blocked).live());
        assert_eq!((taken.digest, &taken.consumed), (stood.digest, &stood.consumed), "seed {seed}");
        let bytes = |lived: &DiveResult| lived.left.iter().map(|file| file.bytes.len()).sum::<usize>();
        assert_eq!(bytes(&taken), bytes(&stood), "seed {seed}");
    }
}

/// Faults of a computer that stalls for some milliseconds.
fn computer_stall(ms: i64) -> Vec<Fault> {
    let (from, to) = (BEGIN + STALL_BEGINS, BEGIN + STALL_BEGINS + DurNs::from_millis(ms));
    let all = [MachineFault::PortsStall, MachineFault::LoopStalls, MachineFault::RecorderStalls];
    all.map(|what| Fault::Machine(Window { what, from, to })).to_vec()
}

/// Faults of lines that hold back all data for some milliseconds.
fn line_stall(lines: std::ops::Range<usize>, ms: i64) -> Vec<Fault> {
    let (from, to) = (BEGIN + STALL_BEGINS, BEGIN + STALL_BEGINS + DurNs::from_millis(ms));
    lines.map(|line| Fault::Cable(line, Window { what: CableFault::Held, from, to })).collect()
}

/// Whether a stall of `ms` may raise the alert or cause `kind`. During a stall, the program doesn't ask the heads, so
/// they count as silent after 2 s. In 5 s, the vehicle drives nearly as far as the target.
fn may_be_raised(kind: &str, ms: i64) -> bool {
    matches!(kind, "position_doubtful" | "cannot_say")
        || ms >= 2000 && matches!(kind, "sensor_silent" | "sensor_stalled" | "no_sonar")
        || ms >= 5000 && matches!(kind, "missed" | "head_silent" | "head_stalled" | "position_lost")
}

/// Texts about the properties that a stall broke. Without a stall, the dive raises the alerts `usual`.
fn broken_by_stall(lived: &DiveResult, usual: &[&str], ms: i64) -> Vec<String> {
    let mut broken = Vec::new();
    let mut last: Option<Position> = None;
    for position in &lived.positions {
        let Position { at, chainage_m, sd_m, speed_mps, is_sure } = *position;
        let off_m = chainage_m - true_chainage_m(at);
        let of = |what: &str| {
            format!("{:.2} s: {what}: {position:?}, off by {off_m:.3} m", at.since(BEGIN).as_secs_f64())
        };
        if is_sure && (speed_mps - TRUE_SPEED_MPS).abs() > SPEED_ERROR_MPS {
            broken.push(of("speed"));
        }
        if off_m.abs() > SDS * sd_m + ROUNDED_M {
            broken.push(of("chainage"));
        }
        let step_m = last.map_or(0.0, |last| off_m - (last.chainage_m - true_chainage_m(last.at)));
        if step_m.abs() > SDS * sd_m + ROUNDED_M {
            broken.push(of("step of the chainage"));
        }
        last = Some(*position);
    }
    broken.extend(
        lived
            .alerts
            .iter()
            .filter(|kind| !usual.contains(kind) && !may_be_raised(kind, ms))
            .map(|kind| format!("alert {kind}")),
    );
    broken
}

#[test]
fn stalls_of_the_computer_and_of_lines_do_not_change_speed_or_chainage() {
    let mut failed = Vec::new();
    for seed in 0..5 {
        let lived = |faults: &[Fault]| World::with(seed, None, Some(faults)).live();
        let usual = lived(&[]);
        assert!(usual.positions.iter().any(|position| position.is_sure), "{:?}", usual.positions.last());
        for ms in STALLS_MS {
            let of_line = |line: usize| (format!("line {line}"), line_stall(line..line + 1, ms));
            let all_lines = ("all lines".to_owned(), line_stall(0..SENSOR_COUNT, ms));
            let stalls = [("computer".to_owned(), computer_stall(ms)), all_lines];
            let stalls = stalls.into_iter().chain((0..SENSOR_COUNT).map(of_line));
            for (what, faults) in stalls {
                let broken = broken_by_stall(&lived(&faults), &usual.alerts, ms);
                if !broken.is_empty() {
                    failed.push(format!(
                        "seed {seed}, {what} for {ms} ms: {} broken, e.g. {:#?}",
                        broken.len(),
                        &broken[..broken.len().min(3)]
                    ));
                }
            }
        }
    }
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}
