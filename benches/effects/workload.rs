//! Effects and scenes that the parts of the bench measure, and functions for measuring.

use headrace_oracle::timed;
use headrace_simulator::{Scene, Simulation};

pub(crate) const ROUNDS: usize = 9;

pub(crate) const SPEED_MPS: f64 = 0.11;

/// Every simulator effect with some parameters. Heads sweep sectors, so that `sector_end_slowing` applies.
pub(crate) const EFFECTS: [(&str, &str); 38] = [
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

pub(crate) fn text(length_m: f64, layout: &str, rest: &str) -> String {
    format!(
        "vehicle = \"vita2-4.toml\"\n[vehicle_changes]\nheads.layout = \"{layout}\"\n[trajectory]\nstart_m = 5\n\
         [[trajectory.legs]]\ndistance_m = {length_m}\nspeed_mps = {SPEED_MPS}\n{rest}"
    )
}

/// CPU time to simulate a scene, s.
pub(crate) fn simulate(scene: &Scene) -> f64 {
    let mut simulation = Simulation::new(scene).unwrap_or_else(|why| panic!("{why}"));
    timed(|| while simulation.advance() {}).1
}

/// Shortest time that each piece of work takes in any of the rounds, s. Each round runs every piece once.
pub(crate) fn best<const N: usize>(rounds: usize, mut works: [&mut dyn FnMut() -> f64; N]) -> [f64; N] {
    let mut least = [f64::INFINITY; N];
    for _ in 0..rounds {
        for (least, work) in least.iter_mut().zip(&mut works) {
            *least = least.min(work());
        }
    }
    least
}
