use headrace_geometry::math;

use super::*;
use crate::testing::{Dive, assert_share};

fn ten_to(x: f64) -> f64 {
    math::exp(x * core::f64::consts::LN_10)
}

fn square(x: f64) -> f64 {
    x * x
}

/// Compares with the measured absorption of pure water divided by the frequency squared, in units of 1e-15 Np s^2/m.
/// Source: Pinkerton 1949, Proc. Phys. Soc. B 62, 129.
#[test]
fn water_absorption_matches_measurements() {
    for (t_degc, measured) in [(0.0, 56.9), (10.0, 36.1), (20.0, 25.3), (30.0, 19.1)] {
        let measured_dbpm = measured * 1e-15 * 1e12 * 20.0 / core::f64::consts::LN_10;
        let off = water_absorption_dbpm(1000.0, t_degc) / measured_dbpm - 1.0;
        assert!(off.abs() < 0.03, "{t_degc}: {off}");
    }
    assert!((water_absorption_dbpm(1000.0, 10.0) / water_absorption_dbpm(500.0, 10.0) - 4.0).abs() < 1e-12);
}

/// Compares the absorption with the energy lost by a grain in oscillating water. Its motion is integrated in steps.
///
/// The drag is that on an oscillating sphere (Landau and Lifshitz, "Fluid mechanics", §24, problem 5). The sound loses
/// the work done by the drag.
#[test]
fn silt_absorption_matches_the_drag_on_its_grains() {
    let (sound_mps, viscosity) = (1447.0, 1.307e-6);
    for (frequency_khz, grain_m) in [(675.0, 2e-6), (1000.0, 5e-6), (1000.0, 20e-6)] {
        let omega = math::TAU * frequency_khz * 1000.0;
        let depth_m = math::sqrt(2.0 * viscosity / omega);
        // Forces on the grain per unit of displaced mass: the drag, resistance * (u - v) + added * d(u - v)/dt, and the
        // buoyancy in accelerated water, du/dt.
        let resistance = 9.0 * viscosity / (2.0 * grain_m * grain_m) * (1.0 + grain_m / depth_m);
        let added = 0.5 * (1.0 + 9.0 * depth_m / (2.0 * grain_m));
        let (steps, turns) = (4000, 60);
        let dt_s = math::TAU / omega / f64::from(steps);
        let acceleration = |t_s: f64, v: f64| {
            let (sine, cosine) = math::sin_cos(omega * t_s);
            let (u, du) = (sine, omega * cosine);
            (du + resistance * (u - v) + added * du) / (2.65 + added)
        };
        let (mut v, mut work) = (0.0, 0.0);
        for step in 0..steps * turns {
            let t_s = f64::from(step) * dt_s;
            let half = v + acceleration(t_s, v) * dt_s / 2.0;
            let next = v + acceleration(t_s + dt_s / 2.0, half) * dt_s;
            if step >= steps * (turns - 5) {
                let slip = math::sin(omega * (t_s + dt_s / 2.0)) - f64::midpoint(v, next);
                work += resistance * slip * slip * dt_s;
            }
            v = next;
        }
        let power = work / (5.0 * math::TAU / omega);
        // If the amplitude of the water's velocity is 1 m/s, the sound's power per area, divided by the water's
        // density, is c / 2.
        let volume = 1.0 / 2650.0;
        let neper_pm = volume * power / (sound_mps / 2.0) / 2.0;
        let scattering_neper_pm =
            volume * square(square(omega / sound_mps)) * square(grain_m) * grain_m / 6.0;
        let expected_dbpm = (neper_pm + scattering_neper_pm) * 20.0 / core::f64::consts::LN_10;
        let found_dbpm = Silt { gpl: 1.0, grain_m }.absorption_dbpm(frequency_khz, sound_mps);
        assert!((found_dbpm / expected_dbpm - 1.0).abs() < 2e-3, "{grain_m}: {found_dbpm} {expected_dbpm}");
    }
}

/// Compares the share of detected echoes with the sonar equation, which is computed here in powers instead of decibels.
/// The comparison covers bands of range and incidence, in water with silt.
#[test]
fn detected_share_matches_the_sonar_equation() {
    let mut dive = Dive { seconds: 1500.0, speed_mps: 0.01, ..Dive::with_head() };
    dive.tunnel = "profile = \"rectangle\"\nwidth_m = 14\nheight_m = 4";
    dive.sensors[0].2 = "mode = \"medium\"\nrange_m = 10\nfrequency_khz = 675".to_owned();
    let effects = "[effects.echo_strength]\nsilt_gpl = 0.5\ngrain_um = 5\nwall_db = -6\ngain_db = 12";
    let silt = Silt { gpl: 0.5, grain_m: 5e-6 }.absorption_dbpm(675.0, 1447.0);
    let absorbed_dbpm = silt + water_absorption_dbpm(675.0, 10.0);
    let power = |range_m: f64, cosine: f64, beam_rad: f64, absorbed_dbpm: f64, pulse_s: f64| {
        let sine = math::sqrt(1.0 - cosine * cosine).max(1e-9);
        let patch_m2 = (math::TAU / 8.0 * square(beam_rad * range_m) / cosine)
            .min(beam_rad * range_m * 1447.0 * pulse_s / 2.0 / sine);
        patch_m2 * square(cosine) / square(square(range_m)) * ten_to(-0.2 * absorbed_dbpm * range_m)
    };
    let beam_rad = f64::to_radians(2.2125);
    let mut bands = [(0, 0, 0.0); 8];
    for row in &dive.dive(effects).rows {
        let (hit, _) = row.wall().unwrap();
        let sounding = row.sounding.unwrap();
        let (sine, cosine) = math::sin_cos(sounding.measured.angle_rad);
        let incidence = if hit.normal.z().abs() > 0.5 { cosine.abs() } else { sine.abs() };
        let wall = ten_to(-0.6);
        let echo = wall * power(hit.range_m, incidence, beam_rad, absorbed_dbpm, 60e-6);
        let noise = power(100.0, 1.0, beam_rad, 0.2, 540e-6) * 540.0 / 60.0;
        let amplified = ten_to((12.0 - 20.0 + 20.0 + 0.4 * hit.range_m) / 10.0) * square(hit.range_m);
        let threshold = power(1.0, 1.0, beam_rad, 0.0, 60e-6) / amplified;
        let expected = math::exp(-noise.max(threshold) / echo);
        let band = &mut bands[usize::try_from(math::floor_to_i64(hit.range_m)).unwrap().min(7)];
        *band = (band.0 + usize::from(sounding.measured.range_m.is_some()), band.1 + 1, band.2 + expected);
    }
    let shares: Vec<f64> =
        bands.iter().filter(|(_, of, _)| *of > 100).map(|(_, of, p)| p / *of as f64).collect();
    assert!(shares.len() > 3, "{bands:?}");
    let (least, most) =
        (shares.iter().copied().fold(1.0, f64::min), shares.iter().copied().fold(0.0, f64::max));
    assert!(least < 0.2 && most > 0.6, "{shares:?}");
    for (heard, of, expected) in bands.into_iter().filter(|(_, of, _)| *of > 100) {
        assert_share(heard, of, expected / of as f64);
    }
}

/// Checks that parts of the vehicle are detected even if the wall's echoes are too weak.
#[test]
fn echoes_of_vehicle_parts_are_always_detected() {
    let hull = "[[hull]]\nleast_m = [-1, -0.3, -1]\nmost_m = [1, 0.3, -0.5]";
    let dive = Dive { vehicle: hull, ..Dive::with_head() };
    let plain = dive.dive("[effects.occlusion]").ranges_m(0);
    let deaf =
        dive.dive("[effects.occlusion]\n[effects.echo_strength]\nwall_db = -60\ngain_db = 0").ranges_m(0);
    let near = |range_m: &Option<f64>| range_m.is_some_and(|range_m| range_m < 2.0);
    let hidden = plain.iter().filter(|range_m| near(range_m)).count();
    assert!(hidden > 10 && hidden < plain.len() / 2, "{hidden} of {}", plain.len());
    for (was, is) in plain.iter().zip(&deaf) {
        assert_eq!(*is, was.filter(|_| near(was)));
    }
}

#[test]
fn sound_absorption_follows_water_temperature() {
    let head = Dive::with_head().scene("").unwrap().facts.sensors[0].head.unwrap();
    for temperature_degc in [4.0, 25.0] {
        let parameters = Parameters {
            temperature_degc,
            silt: Silt { gpl: 0.0, grain_m: 1e-5 },
            wall_db: 0.0,
            frequency_khz: Some(1000.0),
            pulse_us: None,
            gain_db: 20.0,
            log_gain_db: 20.0,
            absorption_dbpm: None,
        };
        let off =
            parameters.sonar(&head, 1447.0).absorbed_dbpm / water_absorption_dbpm(1000.0, temperature_degc);
        assert!((off - 1.0).abs() < 1e-12, "{temperature_degc}: {off}");
    }
}

#[test]
fn head_with_usual_settings_detects_surrounding_rock() {
    let dive = Dive { seconds: 200.0, ..Dive::with_head() };
    let ranges = dive.dive("[effects.echo_strength]").ranges_m(0);
    let lost = ranges.iter().filter(|range_m| range_m.is_none()).count();
    assert!(lost * 20 < ranges.len(), "{lost} of {}", ranges.len());
}

#[test]
fn time_slice_length_does_not_change_results() {
    Dive::with_head().assert_slices_dont_matter("[effects.echo_strength]\nwall_db = -20\ngain_db = 0");
    let refusal = |keys: &str| Dive::with_head().refusal(&format!("[effects.echo_strength]\n{keys}"));
    assert!(refusal("frequency_khz = 100").contains("from 600 to 1000"));
    assert!(Dive::with_sounder().refusal("[effects.echo_strength]").contains("has nothing to act on"));
}
