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

use headrace_oracle::timed;
use headrace_simulator::{Scene, Simulation};
use headrace_tests::scenes;

const ROUNDS: usize = 9;

const SPEED_MPS: f64 = 0.11;

/// Every simulator effect with some parameters. Heads sweep sectors, so that `sector_end_slowing` applies.
const EFFECTS: [(&str, &str); 38] = [
    ("mount_error", "angles_sd_deg = 0.2"),
    ("start_phase_error", "max_deg = 20"),
    ("sector_end_slowing", "lag_ms = 60"),
    ("skipped_steps", "per_thousand = 0.2"),
    ("head_stalls", "per_hour = 20\nseconds = [1, 5]"),
    ("motion_within_turn", ""),
    ("beam_cone", "sensors = [\"sonar_0\", \"sonar_1\", \"sonar_2\", \"sonar_3\"]"),
    ("occlusion", ""),
    ("echo_strength", ""),
    ("multipath", "share = 0.1\nsensors = [\"sonar_0\", \"sonar_1\", \"sonar_2\", \"sonar_3\"]"),
    ("side_lobes", "share = 0.02\nsensors = [\"sonar_0\", \"sonar_1\", \"sonar_2\", \"sonar_3\"]"),
    ("interference", "share = 0.01"),
    ("near_returns", "share = 0.02\nmean_run = 3"),
    ("missing_returns", "share = 0.05\nmean_run = 3"),
    ("outliers", "share = 0.02"),
    ("stuck_range", "range_m = 0.55\nto_s = 20\nsensors = [\"sonar_0\"]"),
    ("sound_speed_error", "share = 0.005"),
    ("sound_speed_profile", "per_metre_mps = 0.5"),
    ("range_noise", "sd_m = 0.01"),
    ("range_quantisation", "points = 500\nsensors = [\"sonar_0\", \"sonar_1\", \"sonar_2\", \"sonar_3\"]"),
    ("current", "speed_mps = -0.02\ngust_sd_mps = 0.01"),
    ("pilot_drift", "across_m = 0.5\nup_m = 0.3\nyaw_deg = 5"),
    ("depth_noise", "noise_pa = 150"),
    ("depth_steps", ""),
    ("imu_noise", "gyro_degps_rthz = 0.007\naccel_mps2_rthz = 0.001\nattitude_deg = 0.2"),
    ("imu_bias", "gyro_degps = 0.05"),
    ("imu_vibration", "frequency_hz = 75\naccel_mps2 = 0.3"),
    ("imu_bumps", "per_hour = 20"),
    ("magnetic_disturbance", "per_100m = 4"),
    ("tether_slack", ""),
    ("tether_scale", "share = 0.002\nstiffness_n = 40000"),
    ("tether_slip", "per_100m = 1"),
    ("late_winding", "hold_m = 0.2"),
    ("tether_quantum", ""),
    ("device_faults", "kind = \"stick\"\nfrom_s = 5\nfor_s = 5\nsensors = [\"ping_left\"]"),
    ("clock_drift", "sd_ppm = 20"),
    ("line_delay", "jitter_ms = 2"),
    ("byte_errors", "flipped_per_million = 20"),
];

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

fn text(length_m: f64, layout: &str, rest: &str) -> String {
    format!(
        "vehicle = \"vita2-4.toml\"\n[vehicle_changes]\nheads.layout = \"{layout}\"\n[trajectory]\nstart_m = 5\n\
         [[trajectory.legs]]\ndistance_m = {length_m}\nspeed_mps = {SPEED_MPS}\n{rest}"
    )
}

fn named(effects: &[(&str, &str)]) -> String {
    let tables: Vec<String> =
        effects.iter().map(|(name, keys)| format!("[effects.{name}]\n{keys}\n")).collect();
    tables.concat()
}

/// CPU time to simulate a scene, s.
fn simulate(scene: &Scene) -> f64 {
    let mut simulation = Simulation::new(scene).unwrap_or_else(|why| panic!("{why}"));
    timed(|| while simulation.advance() {}).1
}

/// Minimum time that each piece of work takes over all rounds, s. Each round runs every piece once.
fn best<const N: usize>(rounds: usize, mut works: [&mut dyn FnMut() -> f64; N]) -> [f64; N] {
    let mut least = [f64::INFINITY; N];
    for _ in 0..rounds {
        for (least, work) in least.iter_mut().zip(&mut works) {
            *least = least.min(work());
        }
    }
    least
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
        // A current changes the dive's duration, so times are scaled to equal durations.
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

/// Simulates the whole tunnel with all effects.
fn seven_kilometres() {
    let all = scene(6990.0, "sector_offset", &named(&EFFECTS));
    let duration_s = Simulation::new(&all).unwrap().duration_s();
    let took_s = simulate(&all);
    println!(
        "\n7 km, four heads, all effects: {duration_s:.0} s of diving in {took_s:.1} s, {:.0} times real time",
        duration_s / took_s
    );
}
