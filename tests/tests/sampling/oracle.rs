//! Sampling theory compared with values of 50 digits, which `oracles/sampling.py` computed with mpmath
//! (`oracles/sampling.csv`).
//!
//! The inputs are doubles and count as exact. The tolerance therefore covers only the rounding in the computation,
//! which is some units in the last place. If the computation magnifies the rounding of an intermediate value, the
//! tolerance is multiplied by the condition number.

use headrace_geometry::frames::{Body, Mount, Point3, Pose, Rot, Tunnel, Vec3};
use headrace_geometry::math::{self, FRAC_PI_2, TAU};
use headrace_geometry::tunnel::{Profile, shapes};
use headrace_sampling::head::Turn;
use headrace_sampling::layout::{InSector, Sector, in_step, start_rad, start_reversed_rad};
use headrace_sampling::ring::{Sounding, Standing};
use headrace_sampling::section;
use headrace_sampling::spacing::{self, Spiral};
use headrace_support::hard_cases::found_at;

const ROWS: &str = include_str!("../../oracles/sampling.csv");
/// One unit in the last place of a number near 1.
const ULP: f64 = f64::EPSILON;

struct Row {
    case: String,
    inputs: Vec<f64>,
    value: f64,
    line: usize,
}

impl Row {
    /// Input number `i` of a row of `oracles/sampling.csv`. Inputs are numbered from 1, as in the header of this file.
    fn i(&self, i: usize) -> f64 {
        self.inputs[i - 1]
    }

    fn count(&self, i: usize) -> u32 {
        u32::try_from(math::round_to_i64(self.i(i))).unwrap()
    }

    /// Checks the program's result `got` against the oracle's value with an absolute tolerance.
    fn near(&self, got: f64, tolerance: f64) {
        let off = (got - self.value).abs();
        assert!(
            off <= tolerance,
            "line {}: {} {:?}: {got:e}, not {:e}: off by {off:e}, allowed {tolerance:e}",
            self.line,
            self.case,
            self.inputs,
            self.value
        );
    }

    /// Checks that the program's result `got` equals the oracle's value to some units in the last place.
    fn ulps(&self, got: f64, ulps: f64) {
        self.near(got, ulps * ULP * self.value.abs());
    }

    /// Relative error of the program's result `got`.
    fn share(&self, got: f64) -> f64 {
        (got - self.value).abs() / self.value.abs().max(f64::MIN_POSITIVE)
    }

    /// Checks a position `got` on a circle of circumference `modulus`.
    fn around(&self, got: f64, modulus: f64, tolerance: f64) {
        let off = math::wrap_signed(got - self.value, modulus);
        self.near(self.value + off, tolerance);
    }
}

/// Rows of `oracles/sampling.csv` for the cases with these names. Every case must exist.
fn rows(cases: &[&str]) -> Vec<Row> {
    let mut found = Vec::new();
    for (number, line) in ROWS.lines().enumerate() {
        let fields: Vec<&str> = line.split(',').collect();
        if line.starts_with('#') || !cases.contains(&fields[0]) {
            continue;
        }
        let (value, inputs) = fields[1..].split_last().unwrap();
        found.push(Row {
            case: fields[0].to_owned(),
            inputs: inputs.iter().map_while(|field| field.parse().ok()).collect(),
            value: value.parse().unwrap(),
            line: number + 1,
        });
    }
    for case in cases {
        let count = found.iter().filter(|row| row.case == *case).count();
        assert!(count >= 20 || *case == "perimeter", "{case}: {count} rows");
    }
    found
}

/// Factor by which the tangent of an angle near 90 degrees magnifies the rounding of the angle.
fn condition(angle_rad: f64) -> f64 {
    1.0 + angle_rad / (FRAC_PI_2 - angle_rad).abs()
}

/// Near 90 degrees, tangents are very large, so a formula that subtracts two tangents loses all digits.
#[test]
fn wall_steps_near_90_degrees_match_the_oracle() {
    let (mut worst, mut magnified) = (0.0_f64, 0.0_f64);
    for row in rows(&["eq6"]) {
        worst = worst.max(row.share(section::t_y2_m(row.i(1), row.i(2), row.count(3)).unwrap()));
        magnified = magnified.max(condition(row.i(2) * row.i(3)));
    }
    found_at("sampling.corner", magnified, worst, 8.0 * ULP);
}

/// If the ping distance T_y is close to the target, a formula that subtracts their squares loses digits.
#[test]
fn speeds_near_the_limit_match_the_oracle() {
    let (mut worst, mut magnified) = (0.0_f64, 0.0_f64);
    for row in rows(&["eq16_speed"]) {
        let [target, t_y, gap_s, ping_s] = [1, 2, 3, 4].map(|i| row.i(i));
        if let Some(got) = spacing::speed_for_target_mps(target, t_y, gap_s, ping_s) {
            worst = worst.max(row.share(got));
            magnified = magnified.max(target * target / ((target - t_y) * (target + t_y)));
        }
    }
    found_at("sampling.speed", magnified, worst, 8.0 * ULP);
}

/// At a very low speed, a head makes very many turns before the vehicle has moved it to the place of another head.
#[test]
fn head_phases_at_very_low_speed_match_the_oracle() {
    let (mut worst_rad, mut turned_most) = (0.0_f64, 0.0_f64);
    for row in rows(&["eq20", "eq21"]) {
        let [phase, rate, x, v] = [1, 2, 3, 4].map(|i| row.i(i));
        let start = if row.case == "eq20" { start_rad } else { start_reversed_rad };
        let turned = (rate * x / v).abs() + phase.abs() + TAU;
        let off = math::wrap_signed(start(phase, rate, x, v).unwrap() - row.value, TAU).abs();
        worst_rad = worst_rad.max(off / turned);
        turned_most = turned_most.max(turned);
    }
    found_at("sampling.phase", turned_most, worst_rad, 4.0 * ULP);
}

#[test]
fn cross_section_matches_the_oracle() {
    for row in rows(&["eq5", "eq6", "eq7", "eq8", "eq10", "eq22"]) {
        match row.case.as_str() {
            "eq5" => row.ulps(section::t_y1_m(row.i(1), row.i(2)).unwrap(), 8.0),
            // The program computes these values with twice a double's precision. Errors are therefore not magnified,
            // even near 90 degrees.
            "eq6" => row.ulps(section::t_y2_m(row.i(1), row.i(2), row.count(3)).unwrap(), 8.0),
            "eq7" => row.ulps(section::t_c_m(row.i(1), row.i(2)).unwrap(), 4.0),
            "eq8" => row.ulps(section::t_y2_mean_m(row.i(1), row.i(2), row.count(3)).unwrap(), 8.0),
            "eq10" => row.ulps(section::t_yp_m(row.i(1), row.count(2)).unwrap(), 1.0),
            _ => row.ulps(section::overlap(row.i(1), row.i(2)).unwrap(), 1.0),
        }
    }
}

#[test]
fn footprint_matches_the_oracle() {
    for row in rows(&["footprint"]) {
        row.ulps(section::footprint_m(row.i(1), row.i(2), row.i(3)).unwrap(), 8.0);
    }
}

#[test]
fn forward_motion_matches_the_oracle() {
    for row in rows(&["eq11", "eq12", "eq13", "eq15", "eq16", "eq17", "eq18", "eq16_speed"]) {
        // A head with one step per turn pings once per turn period.
        let once = |speed, period| Spiral::new(speed, Turn::new(TAU, period).unwrap(), 1.0).unwrap();
        match row.case.as_str() {
            "eq11" => row.ulps(once(row.i(1), row.i(2)).advance_m(), 2.0),
            "eq12" => row.ulps(once(row.i(1), row.i(2)).pitch_m(), 2.0),
            "eq13" => row.ulps(once(row.i(1), 1.0).t_y_max_m(row.i(2)), 4.0),
            "eq15" => {
                let n = row.i(1);
                let turn = Turn::new(TAU / n, n).unwrap();
                row.ulps(Spiral::new(row.i(2), turn, 1.0).unwrap().t_y_mean_printed_m(row.i(3)), 8.0);
            }
            "eq16" | "eq17" | "eq18" => {
                row.ulps(spacing::t_max_m(row.i(1), row.i(2), row.i(3)), 4.0);
            }
            _ => {
                let [target, t_y, gap_s, ping_s] = [1, 2, 3, 4].map(|i| row.i(i));
                let got = spacing::speed_for_target_mps(target, t_y, gap_s, ping_s);
                if t_y >= target {
                    assert!(got.is_none() && row.value <= 0.0, "line {}", row.line);
                } else {
                    row.ulps(got.unwrap(), 8.0);
                }
            }
        }
    }
}

#[test]
fn phases_of_separately_mounted_heads_match_the_oracle() {
    for row in rows(&["eq20", "eq21"]) {
        let [phase, rate, x, v] = [1, 2, 3, 4].map(|i| row.i(i));
        let start = if row.case == "eq20" { start_rad } else { start_reversed_rad };
        let turned = (rate * x / v).abs();
        row.around(start(phase, rate, x, v).unwrap(), TAU, 4.0 * ULP * (turned + phase.abs() + TAU));
    }
}

#[test]
fn algorithm_1_matches_the_oracle() {
    for row in rows(&["algorithm1"]) {
        let sector = Sector {
            number: row.count(1) as usize,
            of: row.count(2) as usize,
            behind_m: row.i(4),
            reversed: row.i(8) > 0.5,
        };
        let lead = InSector { angle_rad: row.i(6), growing: row.i(7) > 0.0 };
        let got = in_step(lead, &sector, row.i(3), row.i(5)).unwrap().angle_rad;
        let sweeps = row.i(4) / row.i(5) / row.i(3) * f64::from(row.count(2));
        row.around(got, TAU, 16.0 * ULP * (TAU + sweeps));
    }
}

fn shape(number: f64) -> Profile {
    match math::round_to_i64(number) {
        0 => shapes::rectangle(4.0, 3.0).unwrap(),
        1 => shapes::circle(3.0).unwrap(),
        _ => shapes::trimmed_circle(6.05, 10.4).unwrap(),
    }
}

fn sounding(profile: &Profile, row: &Row, angle_rad: f64) -> Sounding {
    let attitude = Rot::<Tunnel, Body>::from_roll_pitch_yaw(0.0, row.i(5), row.i(4));
    let pose = Pose { position: Point3::new(0.0, row.i(2), row.i(3)), attitude };
    let mount = Mount { position: Vec3::zero(), rotation: Rot::identity() };
    Standing::new(profile, &pose, &mount).unwrap().sounding(angle_rad).unwrap()
}

#[test]
fn beam_wall_hits_match_the_oracle() {
    for row in rows(&["cast_x", "cast_y", "cast_z", "cast_sigma"]) {
        let profile = shape(row.i(1));
        let hit = sounding(&profile, &row, row.i(6));
        // The more oblique the incidence, the farther the rounding of a beam's direction moves its end along the wall.
        let tolerance = 64.0 * ULP * (3.0 + hit.range_m()) / hit.squareness;
        match row.case.as_str() {
            "cast_x" => row.near(hit.beam.x(), tolerance),
            "cast_y" => row.near(row.i(2) + hit.beam.y(), tolerance),
            "cast_z" => row.near(row.i(3) + hit.beam.z(), tolerance),
            _ => row.around(hit.arc_m, profile.perimeter_m(), 4.0 * tolerance),
        }
    }
}

#[test]
fn steps_on_any_wall_match_the_oracle() {
    for row in rows(&["step", "perimeter"]) {
        let profile = shape(row.i(1));
        if row.case == "perimeter" {
            row.ulps(profile.perimeter_m(), 4.0);
            continue;
        }
        let (from, to) = (sounding(&profile, &row, row.i(6)), sounding(&profile, &row, row.i(6) + row.i(7)));
        let squareness = from.squareness.min(to.squareness);
        let tolerance = 256.0 * ULP * (3.0 + from.range_m().max(to.range_m())) / squareness;
        row.near(from.step_m(&to, profile.perimeter_m()), tolerance);
    }
}

#[test]
fn cancellation_in_plain_subtraction_exceeds_the_tolerance() {
    let lost = rows(&["eq6"]).iter().any(|row| {
        let [h, step] = [row.i(1), row.i(2)];
        let m = f64::from(row.count(3));
        let naive = h * (math::tan(m * step) - math::tan((m - 1.0) * step));
        (naive - row.value).abs() > 8.0 * ULP * row.value.abs() * condition(m * step).min(1e3)
    });
    assert!(lost);
}
