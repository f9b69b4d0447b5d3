//! Compares the derivatives of returns with central differences.

use super::super::fit::{COMMON, OWN, Problem};
use super::super::scan::gather;
use super::super::still::longest;
use super::stand::{Stand, Wrong, profiles};
use headrace_fusion::filter::settings::Settings;

const N: usize = COMMON + 2 * OWN;
const STEP: f64 = 1e-6;

/// With a narrow beam, derivatives are exact except at a wall's edges. There, the two rays of a central difference may
/// hit different walls. Derivatives with respect to rotations are exact only at zero rotation, because rotations are
/// assumed to be small.
#[test]
fn every_range_derivative_matches_central_differences() {
    for (name, profile) in profiles() {
        let wrong = [Wrong::default(), Wrong { is_mirrored: true, ..Wrong::default() }];
        let stand = Stand::new(profile, &wrong, 1);
        stand.ask(|material| {
            let scan = gather(material, &longest(material).unwrap()).unwrap();
            let settings = Settings { return_beam_rad: 1e-9, ..stand.settings };
            let problem = Problem {
                profile: material.profile,
                settings: &settings,
                heads: &scan.heads,
                echoes: &scan.echoes,
                attitude: scan.attitude,
                mirrored: &[false, true],
                stride: 3,
            };
            let x: [f64; N] = [0.5, 2.2, 0.0, 0.0, 0.0, 0.01, 0.1, 0.02, -0.03, -0.2, 0.04, 0.01];
            let residuals = |i: usize, by: f64| {
                let mut x = x;
                x[i] += by;
                problem.residuals(&x)
            };
            let rows = problem.residuals(&x);
            let (mut compared, mut edges) = (0, 0);
            for i in 0..N {
                let (less, more) = (residuals(i, -STEP), residuals(i, STEP));
                for ((row, less), more) in rows.iter().zip(&less).zip(&more) {
                    let (Some((h, off)), Some((_, less)), Some((_, more))) = (row.row, less.row, more.row)
                    else {
                        continue;
                    };
                    let difference = (less - more) / (2.0 * STEP);
                    let kink = ((more - off) - (off - less)).abs() / STEP;
                    if kink > 1e-3 {
                        edges += 1;
                        continue;
                    }
                    // The derivative with respect to the scale uses the expected range in place of the measured
                    // one. At convergence the two are equal.
                    let expected = if i == 5 { (h[5] + off) / (1.0 + x[5]) } else { h[i] };
                    assert!(
                        (difference - expected).abs() < 1e-4,
                        "{name}, {i}: {difference}, not {expected}"
                    );
                    compared += 1;
                }
            }
            assert!(compared > 1000 && edges < 20, "{name}: {compared}, {edges}");
        });
    }
}
