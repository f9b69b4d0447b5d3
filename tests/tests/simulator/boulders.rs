//! If the largest hole is D, beams hit every boulder of size D at least once, and every boulder of size 2 D at least
//! twice.
//!
//! A thousand boulders lie on the wall of a simulated tunnel. D is the hole that the loop reports for the same section
//! of the bare wall.

use std::fmt::Write as _;

use headrace_simulator::environment::What;
use headrace_simulator::{Scene, Simulation};
use headrace_tests::scenes;

/// Distance between neighbouring boulders, m. It is so large that no beam across the tunnel can meet two of them.
const SPACING_M: f64 = 2.5;
const COUNT: usize = 1000;
/// VITA 2 with four heads in the fastest mode. The scene has no effects, so nothing is occluded.
const SCENE: &str = "vehicle = \"vita2-4.toml\"\n[vehicle_changes]\nsensors.all.mode = \"fastest\"\n\
    heads.planned_speed_mps = 0.5\ntarget_m = 3.0\n[trajectory]\nstart_m = 10\n[[trajectory.legs]]\n\
    distance_m = 2520\nspeed_mps = 0.5\n[effects]\nmotion_within_turn = {}\n";

fn scene(rest: &str) -> Scene {
    scenes::scene(&format!("{SCENE}{rest}"))
}

/// Sections of the bare tunnel: chainage of the start, and hole diameter D, m.
fn holes() -> Vec<(f64, f64)> {
    let report = scenes::report(&scene(""));
    report.sections.iter().filter_map(|section| Some((section.start_m, section.hole_m?))).collect()
}

/// Pseudorandom numbers from 0 to 1 with a fixed sequence.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Returns the number of hits on each boulder. Boulders are anywhere round the wall, half sunk in it. Their sizes are
/// the hole diameter D times a random factor from `times`.
fn hits(holes: &[(f64, f64)], seed: u64, times: std::ops::Range<f64>) -> Vec<usize> {
    let mut numbers = Numbers(seed);
    let perimeter_m = scene("").vehicle.tunnel.profile.perimeter_m();
    let mut features = String::new();
    for number in 0..COUNT {
        let chainage_m = 15.0 + SPACING_M * number as f64 + 0.4 * numbers.next();
        let at = holes.partition_point(|(start_m, _)| *start_m <= chainage_m) - 1;
        let (start_m, hole_m) = holes[at];
        assert!(chainage_m < start_m + 0.25 && hole_m < 1.0, "{chainage_m}: {hole_m} m");
        let size_m = hole_m * (times.start + (times.end - times.start) * numbers.next());
        let arc_m = perimeter_m * numbers.next();
        writeln!(
            features,
            "[[tunnel.features]]\nkind = \"boulder\"\nchainage_m = {chainage_m}\narc_m = {arc_m}\nsize_m = {size_m}\nsunk = 0.5"
        )
        .unwrap();
    }
    let mut simulation = Simulation::with_truth(&scene(&features)).unwrap();
    let mut hits = vec![0; COUNT];
    while simulation.advance() {
        for wall in simulation.take_truth().iter().filter_map(|row| row.sounding?.wall) {
            if let What::Feature(boulder) = wall.0.what {
                hits[usize::from(boulder)] += 1;
            }
        }
    }
    hits
}

#[test]
fn boulders_of_size_d_are_hit_at_least_once_and_of_size_2_d_at_least_twice() {
    let holes = holes();
    let least = |hits: &[usize]| *hits.iter().min().unwrap();
    let of_d = hits(&holes, 1, 1.01..1.3);
    assert!(least(&of_d) >= 1, "{} boulders of D missed", of_d.iter().filter(|hits| **hits == 0).count());
    let of_two_d = hits(&holes, 2, 2.02..2.2);
    assert!(least(&of_two_d) >= 2, "a boulder of 2 D was hit {} times", least(&of_two_d));
    // Boulders that are much smaller than the holes are missed, which proves that the tests above can fail.
    let small = hits(&holes, 3, 0.3..0.4);
    assert!(small.iter().filter(|hits| **hits == 0).count() > COUNT / 20, "the reported holes are too large");
}
