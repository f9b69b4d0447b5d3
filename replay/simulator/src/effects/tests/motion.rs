use headrace_sensor::measurement::{Inertia, Payout, Pressure, Sounding};

use crate::testing_motion::{Bench, same_in_any_slices};

/// All effects on motion, angles, clocks or lines, each with a sensor whose measurements it changes.
const ALONE: [(&str, &str); 18] = [
    ("head_a", "[effects.start_phase_error]\n"),
    ("head_a", "[effects.sector_end_slowing]\n"),
    ("head_a", "[effects.skipped_steps]\nper_thousand = 20\n"),
    ("head_a", "[effects.head_stalls]\nper_hour = 600\nseconds = [0.5, 2]\n"),
    ("", "[effects.current]\nspeed_mps = -0.05\ngust_sd_mps = 0.01\n"),
    ("", "[effects.pilot_drift]\nacross_m = 1.5\nup_m = 1.0\nyaw_deg = 15\n"),
    ("depth", "[effects.depth_steps]\n"),
    ("imu", "[effects.imu_noise]\ngyro_degps_rthz = 0.007\naccel_mps2_rthz = 0.001\nattitude_deg = 0.3\n"),
    ("imu", "[effects.imu_bias]\ngyro_degps = 0.2\naccel_mps2 = 0.02\n"),
    ("imu", "[effects.magnetic_disturbance]\nper_100m = 30\n"),
    ("tether", "[effects.tether_slack]\n"),
    ("tether", "[effects.tether_slip]\nper_100m = 50\n"),
    ("tether", "[effects.late_winding]\n"),
    ("tether", "[effects.tether_quantum]\n"),
    ("depth", "[effects.device_faults]\nkind = \"stick\"\nfrom_s = 5\nfor_s = 10\n"),
    ("imu", "[effects.clock_drift]\nppm = 50\n"),
    ("", "[effects.line_delay]\nlatency_ms = 5\njitter_ms = 2\n"),
    ("", "[effects.byte_errors]\nflipped_per_million = 100\ndropped_per_million = 100\n"),
];

fn measured(effects: &str, sensor: &str) -> Vec<[f64; 9]> {
    let bench = Bench::sectors(effects);
    match sensor {
        "imu" => bench.run(sensor).iter().map(inertia).collect(),
        "depth" => bench.run(sensor).iter().map(|p: &Pressure| row(p.at.0, &[p.pressure_pa])).collect(),
        "tether" => bench.run(sensor).iter().map(|p: &Payout| row(p.at.0, &[p.chainage_m])).collect(),
        _ => bench.run(sensor).iter().map(sounding).collect(),
    }
}

fn inertia(i: &Inertia) -> [f64; 9] {
    let (roll, pitch, yaw) = i.attitude.roll_pitch_yaw();
    row(i.at.0, &[roll, pitch, yaw, i.rate_radps.x(), i.rate_radps.z(), i.force_mps2.x(), i.force_mps2.z()])
}

fn sounding(s: &Sounding) -> [f64; 9] {
    row(s.at.0, &[s.angle_rad, s.reported_rad])
}

fn row(at: u64, values: &[f64]) -> [f64; 9] {
    let mut row = [0.0; 9];
    for (place, value) in row.iter_mut().zip([at as f64].iter().chain(values)) {
        *place = *value;
    }
    row
}

/// Effects on other sensors change neither the random numbers of an effect on one sensor, nor the measurements of
/// sensors without effects.
#[test]
fn adding_an_effect_to_one_sensor_changes_no_other_sensor() {
    for (sensor, alone) in ALONE.iter().filter(|(sensor, _)| !sensor.is_empty()) {
        let touching = ALONE.iter().filter(|(touched, _)| !touched.is_empty() && touched != sensor);
        let others: Vec<String> =
            touching.map(|(touched, effect)| format!("{effect}sensors = [\"{touched}\"]\n")).collect();
        let alone = format!("{alone}sensors = [\"{sensor}\"]\n");
        let (by_itself, among) =
            (measured(&alone, sensor), measured(&format!("{alone}{}", others.concat()), sensor));
        assert_eq!(by_itself, among, "{alone}");
    }
}

#[test]
fn all_motion_effects_together_do_not_depend_on_time_slice_length() {
    let all: String = ALONE.iter().map(|(_, effect)| *effect).collect();
    same_in_any_slices(&Bench::sectors(&all));
}

#[test]
fn effects_run_in_a_fixed_order_whatever_their_order_in_the_scene() {
    let (ahead, back): (String, String) =
        (ALONE.iter().map(|(_, e)| *e).collect(), ALONE.iter().rev().map(|(_, e)| *e).collect());
    assert_eq!(Bench::sectors(&ahead).messages(), Bench::sectors(&back).messages());
}
