//! Dives that spend hours in one place: a parked vehicle, and a vehicle that goes back and forth a hundred times.

use headrace_coverage::Verdict;
use std::fmt::Write as _;

use headrace_monitor::run::Loop;
use headrace_support::hard_cases::found;
use headrace_tests::scenes;
use headrace_tests::truth::{self, JudgedDive};

const PARKED_S: u32 = 3600;
/// Number of times that the vehicle goes back and forth.
const ROUNDS: usize = 100;
/// Start of the stretch over which the vehicle goes back and forth, m. The stretch ends at `TO_M`.
const FROM_M: f64 = 5.0;
const TO_M: f64 = 9.0;
/// Chainage of the end of the dive, m.
const END_M: f64 = 16.0;
/// Largest allowed difference between the upper and the lower bound of a hole's diameter, m. The bounds differ if the
/// loop thins out samples in full cells.
const THINNED_M: f64 = 0.04;

fn scene(parked_s: u32, rounds: usize) -> String {
    let mut text = format!(
        "vehicle = \"vita2-2.toml\"\n[effects]\nmotion_within_turn = {{}}\nrange_noise = {{ sd_m = 0.02 }}\n\
         [trajectory]\nkind = \"waypoints\"\n[[trajectory.waypoints]]\nchainage_m = 5\nstay_s = 10\n\
         [[trajectory.waypoints]]\nchainage_m = 7\nspeed_mps = 0.1\nstay_s = {parked_s}\n"
    );
    for _ in 0..rounds {
        for chainage_m in [TO_M, FROM_M] {
            writeln!(text, "[[trajectory.waypoints]]\nchainage_m = {chainage_m}\nspeed_mps = 0.3").unwrap();
        }
    }
    text + &format!("[[trajectory.waypoints]]\nchainage_m = {END_M}\nspeed_mps = 0.1\n")
}

/// Simulates a dive. Returns the dive, and the memory used by samples at the end of each minute, bytes.
fn dive(parked_s: u32, rounds: usize) -> (JudgedDive, Vec<usize>) {
    let scene = scenes::scene(&scene(parked_s, rounds));
    let (mut used, mut ticks) = (Vec::new(), 0_u64);
    let mut note = |dive: &Loop| {
        ticks += 1;
        if ticks.is_multiple_of(3000) {
            used.push(dive.view().coverage().store.usage().bytes);
        }
    };
    (truth::dive_noting(&scene, &scene.vehicle, &mut note), used)
}

#[test]
fn hour_of_parking_and_hundred_trips_back_and_forth_change_no_verdict() {
    let (once, _) = dive(0, 1);
    let (long, used) = dive(PARKED_S, ROUNDS);
    assert_eq!(once.sections.len(), long.sections.len());
    let (mut passed, mut off_m) = (0, [0.0_f64; 2]);
    // The ends of the dive are left out, because not all heads have passed there.
    let pairs = once.sections.iter().zip(&long.sections);
    for (a, b) in pairs.filter(|(a, _)| (FROM_M..END_M - 1.0).contains(&a.report.start_m)) {
        assert_eq!(a.report.verdict, b.report.verdict, "section {}", a.report.start_m);
        passed += u32::from(a.report.verdict == Verdict::Pass);
        let (Some(least_m), Some(most_m)) = (b.report.hole_least_m, b.report.hole_most_m) else {
            panic!("section {}: no bounds", b.report.start_m)
        };
        assert!(most_m - least_m <= THINNED_M, "section {}: {least_m} to {most_m}", b.report.start_m);
        // In sections beyond the rounds and the parking place, holes are as close to the truth as in a dive without
        // rounds and parking.
        if a.report.start_m >= TO_M + 1.0 {
            for (off_m, section) in off_m.iter_mut().zip([a, b]) {
                *off_m = off_m.max((section.report.hole_m.unwrap() - section.true_hole_m).abs());
            }
        }
    }
    assert!(passed > 30, "{passed} sections pass");
    println!("{passed} sections pass; D off by {off_m:?} m; {used:?} bytes");
    assert!(off_m[1] <= off_m[0] + 0.01, "{off_m:?}");
    found("loop.rounds", off_m[1], 0.02);
    // Memory may grow only slightly in the last two thirds of the parked hour, and in the last quarter of the rounds.
    let parked = PARKED_S as usize / 60;
    let rounds = used.len() - 3 - parked;
    let grown = |from: usize, to: usize| used[to] as f64 / used[from] as f64 - 1.0;
    found("loop.parked_memory", grown(parked / 3, parked - 2), 0.05);
    found("loop.rounds_memory", grown(parked + rounds * 3 / 4, parked + rounds), 0.05);
}
