//! The paper's equations with random arguments. Each result is either a named error, or a finite number that the
//! inverse equation confirms.

use headrace_geometry::math::{self, FRAC_PI_2, TAU};
use headrace_sampling::head::Turn;
use headrace_sampling::layout::{start_rad, start_reversed_rad};
use headrace_sampling::section;
use headrace_sampling::spacing::{self, Spiral};

use crate::cases::{Case, few, many, within};

/// A random argument of an equation. It is often zero, negative, extreme, infinite or not a number.
fn any(case: &mut Case) -> f64 {
    match case.below(12) {
        0 => 0.0,
        1 => f64::NAN,
        2 => f64::INFINITY,
        3 => -case.between(0.0, 3.0),
        4 => 1e-9,
        5 => case.of_any_size(-300, 300),
        _ => case.between(1e-3, 10.0),
    }
}

fn off(got: f64, expected: f64) -> f64 {
    (got - expected).abs() / expected.abs().max(f64::MIN_POSITIVE)
}

fn equations(case: &mut Case) -> Result<(), String> {
    let (a, b, c) = (any(case), any(case), any(case));
    let m = case.count_below(2000);
    let results = [
        section::t_y1_m(a, b),
        section::t_y2_m(a, b, m),
        section::t_y2_mean_m(a, b, m),
        section::t_c_m(a, b),
        section::t_yp_m(a, m),
        section::overlap(a, b),
        section::footprint_m(a, b, c),
        start_rad(a, b, c, any(case)),
        start_reversed_rad(a, b, c, any(case)),
    ];
    for (number, result) in results.into_iter().enumerate() {
        match result {
            // An equation may return infinity only if an argument is extremely large or small.
            Ok(value)
                if value.is_finite() || [a, b, c].iter().any(|x| x.abs() > 1e100 || x.abs() < 1e-100) => {}
            Ok(value) => return Err(format!("equation {number} of {a:e} {b:e} {c:e} {m}: {value}")),
            Err(why) if why.to_string().is_empty() => return Err("no reason".to_owned()),
            Err(_) => {}
        }
    }
    if Turn::new(a, b).is_ok_and(|turn| !(turn.ping_period_s() > 0.0 || b < 1e-100)) {
        return Err(format!("a turn of {a:e} {b:e}"));
    }

    // The steps T_y along the wall add up to the distance along the wall, even if the last step ends near 90 degrees.
    let last = 1 + case.count_below(400);
    let end_rad = FRAC_PI_2 * (1.0 - case.power_of_ten(-9.0, -0.1));
    let theta = end_rad / f64::from(last);
    let h = case.between(0.1, 20.0);
    let sum: f64 = (1..=last).map(|m| section::t_y2_m(h, theta, m).unwrap_or(f64::NAN)).sum();
    let mean = section::t_y2_mean_m(h, theta, last).map_err(|why| why.to_string())?;
    if !within(off(mean * f64::from(last), sum), 1e-12) {
        return Err(format!("{last} steps of {theta:e} at {h}: {sum} is not {}", mean * f64::from(last)));
    }
    let tangent = section::t_y2_m(h, theta, last).map_err(|why| why.to_string())?;
    let footprint = section::footprint_m(h, end_rad - theta / 2.0, theta).map_err(|why| why.to_string())?;
    let condition = 1.0 + end_rad / (FRAC_PI_2 - end_rad);
    if !within(off(tangent, footprint), 1e-14 * condition) {
        return Err(format!("step {last} of {theta:e} at {h}: {tangent} is not the footprint {footprint}"));
    }

    // At the speed that is computed for a target, the spacing T equals the target, even if the ping distance T_y is
    // close to the target.
    let target = case.between(0.1, 3.0);
    let t_y = target * (1.0 - case.power_of_ten(-15.0, 0.0));
    let (gap_s, ping_s) = (case.between(0.1, 30.0), case.between(0.001, 0.1));
    let speed = spacing::speed_for_target_mps(target, t_y, gap_s, ping_s);
    let Some(speed) = speed else {
        return if t_y >= target { Ok(()) } else { Err(format!("no speed for {target} and {t_y}")) };
    };
    if !within(off(spacing::t_max_m(speed * gap_s, speed * ping_s, t_y), target), 4e-15) {
        return Err(format!("{speed} m/s for {target} and {t_y}"));
    }
    if spacing::speed_for_target_mps(target, target, gap_s, ping_s).is_some()
        || spacing::speed_for_target_mps(target, f64::NAN, gap_s, ping_s).is_some()
        || spacing::speed_for_target_mps(target, t_y, 0.0, 0.0).is_some()
    {
        return Err("a speed where there is none".to_owned());
    }

    // The vehicle's advance in a turn is the sum of its advances in the turn's pings, whether the turn has one step or
    // thousands.
    let steps = 1 + case.count_below(3000);
    let turn = Turn::new(TAU / f64::from(steps), ping_s).map_err(|why| why.to_string())?;
    let spiral = Spiral::new(speed, turn, 1.0).map_err(|why| why.to_string())?;
    if off(spiral.pitch_m(), spiral.advance_m() * f64::from(steps)) > 1e-12 || speed.is_nan() {
        return Err(format!("{steps} steps: {} and {}", spiral.pitch_m(), spiral.advance_m()));
    }

    // A start angle lies within one turn. If the head turns back by this angle at the same rate, the phase results
    // again.
    let (phase, rate) = (case.between(0.0, TAU), case.between(0.1, 3.0));
    let (x, v) = (case.between(-2.0, 2.0), case.power_of_ten(-9.0, 1.0));
    if let Ok(start) = start_rad(phase, rate, x, v) {
        let turned = (rate * x / v).abs();
        let back = start_rad(start, -rate, x, v).map_err(|why| why.to_string())?;
        let apart = math::wrap_signed(back - phase, TAU).abs();
        if !(0.0..TAU).contains(&start) || apart > 8.0 * f64::EPSILON * (turned + 10.0) {
            return Err(format!("phase {phase} rate {rate} x {x} v {v:e}: {start}, back {back}"));
        }
    }
    Ok(())
}

#[test]
fn random_inputs_give_an_error_or_a_result_that_inverts_to_the_input() {
    few("sampling", &equations);
}

#[test]
#[ignore = "long; see the module's description"]
fn random_inputs_give_an_error_or_a_result_that_inverts_to_the_input_in_a_long_run() {
    many("sampling", &equations);
}
