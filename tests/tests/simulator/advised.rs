//! A simulated pilot who gets the monitor's advice. The pilot drives too fast, sees the missed stretch on the display,
//! goes back, and leaves no missed section.

use headrace_coverage::Verdict;
use headrace_simulator::{Message, Scene, Simulation};
use headrace_tests::{scenes, truth};

fn scene(keys: &str) -> Scene {
    scenes::scene(&format!(
        "vehicle = \"vita2-4.toml\"\n[trajectory]\nkind = \"advised\"\nstart_m = 5\nto_m = 20\nspeed_mps = 0.2\n{keys}\n\
         [effects]\nmotion_within_turn = {{}}\nrange_noise = {{ sd_m = 0.01 }}\n"
    ))
}

const HURRY: &str = "[[trajectory.hurries]]\nfrom_m = 9\nto_m = 13\nspeed_mps = 0.2";

fn simulation(scene: &Scene) -> Simulation {
    headrace_replay::simulation(scene, false).unwrap()
}

/// True chainage of the vehicle at each second of the dive.
fn way(scene: &Scene) -> Vec<f64> {
    let mut simulation = simulation(scene);
    while simulation.next_message().is_some() {}
    let scenery = simulation.scenery().unwrap();
    let seconds = (0..).map(f64::from).take_while(|second| *second < simulation.duration_s());
    seconds.map(|second| scenery.trajectory.place(second).chainage_m).collect()
}

#[test]
fn dive_of_an_advised_pilot_is_repeatable() {
    let scene = scene(HURRY);
    let all = || {
        let (mut simulation, mut all) = (simulation(&scene), Vec::new());
        while let Some(Message { at, source, bytes, .. }) = simulation.next_message() {
            all.push((at, source, bytes.to_vec()));
        }
        all
    };
    assert_eq!(all(), all());
}

#[test]
fn pilot_goes_back_and_leaves_no_missed_section() {
    let hurried = scene(HURRY);
    let way = way(&hurried);
    let back_m = way.windows(2).map(|pair| (pair[0] - pair[1]).max(0.0)).sum::<f64>();
    assert!(back_m > 4.0, "went back {back_m} m");
    assert!(way.last().unwrap() > &19.5, "{:?}", way.last());
    let [left, made_good] = [scene(&format!("goes_back = false\n{HURRY}")), hurried].map(|scene| {
        let dive = truth::dive(&scene);
        let within = dive.sections.iter().map(|section| &section.report);
        within
            .filter(|section| (8.0..18.0).contains(&section.start_m) && section.verdict == Verdict::Fail)
            .count()
    });
    println!("failed {left} without going back, {made_good} after");
    assert!(left > 8 && made_good == 0, "{left} {made_good}");
}

#[test]
fn pilot_keeps_to_the_advised_speed_within_tolerance() {
    let scene = scene("");
    let way = way(&scene);
    let report = truth::dive(&scene).report;
    let advice = &report.advice;
    // In the seconds 40 to 100 of the dive, the vehicle is moving steadily.
    for (second, pair) in way.windows(2).enumerate().skip(40).take(60) {
        let speed_mps = pair[1] - pair[0];
        let about = advice.iter().filter(|entry| (entry.at_s - second as f64).abs() < 12.0);
        let most_mps = about.map(|entry| entry.v_max_mps).fold(0.0, f64::max);
        assert!(speed_mps < 1.06 * most_mps, "{second} s: {speed_mps} of {most_mps}");
    }
}
