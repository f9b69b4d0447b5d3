//! Repeats dives without their causes, and checks that the program reported those causes without which the failed
//! sections pass. Uses a twentieth of the dives of the bench `causes`.

use headrace_tests::interventions::{Matrix, intervene, kinds, remedies};

const DIVES: u64 = 25;

#[test]
fn section_passes_after_removing_the_reported_cause() {
    let mut matrix = Matrix::default();
    let threads = 2;
    let of_thread = |thread: u64| -> Vec<_> {
        (0..DIVES)
            .filter(|seed| seed % threads == thread)
            .map(|seed| {
                let dive = intervene(10 * seed + seed % 2, &kinds(10 * seed + seed % 2));
                // The displayed remedy is simulated for half of the dives.
                let done = if seed % 4 < 2 { remedies(&dive) } else { Vec::new() };
                (dive, done)
            })
            .collect()
    };
    let dives = std::thread::scope(|scope| {
        let running: Vec<_> = (0..threads).map(|thread| scope.spawn(move || of_thread(thread))).collect();
        running.into_iter().flat_map(|thread| thread.join().unwrap()).collect::<Vec<_>>()
    });
    let (mut runs, mut cleared) = (0, 0);
    for (dive, done) in &dives {
        matrix.add(dive);
        runs += done.len();
        cleared += done.iter().filter(|remedied| remedied.clears).count();
    }
    let text = format!("{}runs cleared by the displayed remedy: {cleared} of {runs}\n", matrix.text());
    println!("{text}");
    assert!(runs >= 10 && 10 * cleared >= 9 * runs, "remedies\n{text}");
    assert!(matrix.sections[0].all > 150 && matrix.stretches[1].all > 10, "too few fails\n{text}");
    assert!(matrix.sections[0].share() >= 0.95, "sections, one cause\n{text}");
    assert!(matrix.stretches[1].share() >= 0.65, "stretches, two causes\n{text}");
    assert!(matrix.pairs.share() >= 0.4, "sets of two\n{text}");
    assert!(matrix.one_run.share() >= 0.95, "runs\n{text}");
}
