//! Random steps on a factored covariance. The covariance must stay valid, and each measurement must change the
//! variances as the formula for scalars says.

use headrace_fusion::filter::factors::Factors;
use headrace_geometry::math;

use crate::cases::{Case, few, many};

const N: usize = 6;
/// Relative tolerance of variances. The tolerance is large because correlated errors with variances of 1e-10 and 1e+10
/// give factors with a ratio of 1e10. In a run of two million cases, four errors were over 1e-9, and the largest was
/// 3e-8.
const SHARE: f64 = 1e-6;

fn row(case: &mut Case) -> [f64; N] {
    let few = case.below(2) == 0;
    core::array::from_fn(|_| if few && case.below(3) > 0 { 0.0 } else { case.between(-1.0, 1.0) })
}

fn covariance(p: &Factors<N>) -> Result<(), String> {
    if !p.is_sound() {
        return Err(format!("not sound: {p:?}"));
    }
    for i in 0..N {
        let variance = p.variance(i);
        if !(variance >= 0.0 && variance.is_finite()) {
            return Err(format!("variance {i} is {variance}"));
        }
        for j in 0..i {
            let (there, back) = (p.covariance(i, j), p.covariance(j, i));
            let limit = math::sqrt(variance) * math::sqrt(p.variance(j));
            if (there - back).abs() > 1e-14 * limit || there.abs() > limit * (1.0 + 1e-9) {
                return Err(format!("{i}, {j}: {there:e} and {back:e} of {limit:e}"));
            }
        }
    }
    Ok(())
}

fn steps(case: &mut Case) -> Result<(), String> {
    let start: [f64; N] = core::array::from_fn(|_| case.of_any_size(-10, 10).abs());
    let mut p = Factors::independent(start);
    for _ in 0..12 {
        match case.below(5) {
            0 | 1 => {
                let (h, noise) = (row(case), case.of_any_size(-10, 10).abs());
                let before = p.variance_along(&h);
                let gain = p.measure(&h, noise);
                // The innovation variance is the sum of the variances of state and noise. After the measurement, the
                // state's variance v becomes v noise / (v + noise).
                let (sum, left) = (before + noise, before / (1.0 + before / noise));
                let after = p.variance_along(&h);
                let size: f64 = (0..N).map(|i| h[i] * h[i] * p.variance(i)).sum();
                if (gain.variance / sum - 1.0).abs() > SHARE {
                    return Err(format!("innovation {} is not {sum}", gain.variance));
                }
                // The tolerance depends on the terms of the variance h P h^T, because large terms can cancel each
                // other.
                if (after - left).abs() > SHARE * left + SHARE * size {
                    return Err(format!(
                        "{after:e} is left, not {left:e}; before {before:e}, noise {noise:e}"
                    ));
                }
            }
            2 => {
                let (variance, a) = (case.of_any_size(-10, 10).abs(), row(case));
                let h = row(case);
                let along: f64 = a.iter().zip(h).map(|(a, h)| a * h).sum();
                let expected = p.variance_along(&h) + variance * along * along;
                p.add(variance, a, N);
                let size: f64 = (0..N).map(|i| h[i] * h[i] * p.variance(i)).sum();
                if (p.variance_along(&h) - expected).abs() > SHARE * expected + SHARE * size {
                    return Err(format!("{:e}, not {expected:e}", p.variance_along(&h)));
                }
            }
            3 => {
                // In this step, each state error grows by dt times the next state error. A position error grows in the
                // same way by dt times the velocity error.
                let dt = case.of_any_size(-9, 2).abs();
                p.shear(|column, len| {
                    for i in 0..len.saturating_sub(1) {
                        column[i] += dt * column[i + 1];
                    }
                });
            }
            _ => p.scale(case.below(N), case.between(0.1, 2.0)),
        }
        covariance(&p)?;
    }
    Ok(())
}

#[test]
fn measurements_keep_the_covariance_valid_and_equal_to_the_scalar_formula() {
    few("filter", &steps);
}

#[test]
#[ignore = "long; see the module's description"]
fn covariance_stays_valid_in_a_long_run() {
    many("filter", &steps);
}
