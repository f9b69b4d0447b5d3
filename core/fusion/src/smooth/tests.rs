//! Comparison of the smoother with an independent oracle.
//!
//! The oracle is batch least squares over all errors at all times, solved by normal equations.

use nalgebra::{SMatrix, SVector};

use super::rts_step::Gain;
use super::step::{Move, Placed, Step};
use crate::filter::factors::Factors;
use crate::filter::inertial::{InertialSample, Leg};
use crate::filter::settings::Settings;
use crate::filter::state::{ERRORS, State};
use headrace_geometry::frames::{Point3, Rot, Vec3};
use headrace_geometry::time::{DurNs, MonoNs};

/// Number of errors in the test's state: position, speed, sensor bias.
const N: usize = 3;
const TIMES: usize = 12;
const ALL: usize = N * TIMES;
const START: [f64; N] = [4.0, 0.25, 0.09];
const WHITE: [f64; N] = [0.0, 0.01, 1e-4];
/// Time and variance of a simulated jump in position.
const JUMP: (usize, f64) = (7, 30.0);
const FADING: f64 = 0.9;
const NOISE: f64 = 0.04;

fn carry(errors: &mut [f64; N]) {
    errors[0] += errors[1];
    errors[2] *= FADING;
}

fn white(time: usize) -> [f64; N] {
    let [place, speed, bias] = WHITE;
    [place + if time == JUMP.0 { JUMP.1 } else { 1e-3 }, speed, bias]
}

/// Returns the measurement at a time. Its kind alternates: position plus bias, speed, position, none.
fn measured(time: usize) -> Option<([f64; N], f64)> {
    let value = f64::from(u32::try_from((time * 37) % 11).unwrap()) / 4.0;
    match time % 4 {
        0 => Some(([1.0, 0.0, 1.0], value)),
        1 => Some(([0.0, 1.0, 0.0], value / 10.0)),
        2 => Some(([1.0, 0.0, 0.0], value)),
        _ => None,
    }
}

struct Known {
    means: [[f64; N]; TIMES],
    /// Joint covariance of all errors at all times.
    covariance: SMatrix<f64, ALL, ALL>,
}

/// Solves for all times at once. Adds the information matrices of start, steps and measurements, and inverts the sum.
fn all_at_once() -> Known {
    let mut information = SMatrix::<f64, ALL, ALL>::zeros();
    let mut vector = SVector::<f64, ALL>::zeros();
    let mut add = |weights: &[(usize, f64)], value: f64, variance: f64| {
        for (i, a) in weights {
            vector[*i] += a * value / variance;
            for (j, b) in weights {
                information[(*i, *j)] += a * b / variance;
            }
        }
    };
    for (i, variance) in START.iter().enumerate() {
        add(&[(i, 1.0)], 0.0, *variance);
    }
    for time in 0..TIMES {
        if let Some((h, value)) = measured(time) {
            let weights: Vec<_> = h.iter().enumerate().map(|(i, h)| (N * time + i, *h)).collect();
            add(&weights, value, NOISE);
        }
        if time + 1 == TIMES {
            continue;
        }
        for (i, variance) in white(time).iter().enumerate() {
            let mut weights = vec![(N * (time + 1) + i, 1.0)];
            for j in 0..N {
                let mut unit = [0.0; N];
                unit[j] = 1.0;
                carry(&mut unit);
                weights.push((N * time + j, -unit[i]));
            }
            add(&weights, 0.0, *variance);
        }
    }
    let covariance = information.try_inverse().unwrap();
    let mean = covariance * vector;
    let means = core::array::from_fn(|time| core::array::from_fn(|i| mean[N * time + i]));
    Known { means, covariance }
}

struct Filtered {
    mean: [f64; N],
    factors: Factors<N>,
    predicted: [f64; N],
    predicted_factors: Factors<N>,
}

fn disturb(time: usize, factors: &mut Factors<N>) {
    for (i, variance) in white(time).into_iter().enumerate() {
        factors.add_to(i, variance);
    }
}

fn forwards() -> Vec<Filtered> {
    let (mut mean, mut factors) = ([0.0; N], Factors::independent(START));
    (0..TIMES)
        .map(|time| {
            if let Some((h, value)) = measured(time) {
                let expected: f64 = h.iter().zip(&mean).map(|(h, m)| h * m).sum();
                let gain = factors.measure(&h, NOISE);
                for (mean, k) in mean.iter_mut().zip(gain.k) {
                    *mean += k * (value - expected);
                }
            }
            let now = (mean, factors);
            carry(&mut mean);
            factors.shear(|column, len| {
                if len > 1 {
                    column[0] += column[1];
                }
            });
            factors.scale(2, FADING);
            disturb(time, &mut factors);
            Filtered { mean: now.0, factors: now.1, predicted: mean, predicted_factors: factors }
        })
        .collect()
}

/// Means, covariances, and cross-covariances between any two times equal those of the batch solution.
#[test]
fn smoother_equals_batch_least_squares() {
    let known = all_at_once();
    let filtered = forwards();
    let near = |is: f64, should: f64, what: &str| {
        assert!((is - should).abs() < 1e-9 * should.abs().max(1e-2), "{what}: {is}, not {should}");
    };
    let last = filtered.last().unwrap();
    let (mut mean, mut factors) = (last.mean, last.factors);
    // For each later time, the columns of the cross-covariance between the errors at that time and at the current time.
    let unit = |m: usize| core::array::from_fn(|i| if i == m { 1.0 } else { 0.0 });
    let mut later = vec![(TIMES - 1, core::array::from_fn::<[f64; N], N, _>(|m| factors.along(&unit(m))))];
    for time in (0..TIMES - 1).rev() {
        let Filtered { mean: was, factors: before, predicted, predicted_factors } = &filtered[time];
        let gain = Gain::new(before, carry, predicted_factors);
        let off = core::array::from_fn(|i| mean[i] - predicted[i]);
        let back = gain.back(&off);
        mean = core::array::from_fn(|i| was[i] + back[i]);
        disturb(time, &mut factors);
        factors = gain.smoothed(before, &factors);
        for (_, columns) in &mut later {
            *columns = columns.map(|column| gain.back(&column));
        }
        later.push((time, core::array::from_fn(|m| factors.along(&unit(m)))));
        for i in 0..N {
            near(mean[i], known.means[time][i], "mean");
            for (then, columns) in &later {
                for (m, column) in columns.iter().enumerate() {
                    let should = known.covariance[(N * time + i, N * then + m)];
                    near(column[i], should, &format!("covariance of {time}, {i} and {then}, {m}"));
                }
            }
        }
    }
}

/// A step and near-exact measurements follow a poor prior, with and without process noise.
///
/// No variance becomes negative, and no variance grows.
#[test]
fn smoothed_variances_are_never_negative_and_never_grow() {
    let before = Factors::independent([1e8, 1e-12, 1.0]);
    for noise in [0.0, 1e-14, 1e6] {
        let mut predicted = before;
        predicted.shear(|column, len| {
            if len > 1 {
                column[0] += column[1];
            }
        });
        predicted.scale(2, FADING);
        predicted.add_to(0, noise);
        let gain = Gain::new(&before, carry, &predicted);
        let mut end = predicted;
        end.measure(&[1.0, 0.0, 1.0], 1e-18);
        end.measure(&[0.0, 1.0, 0.0], 1e-18);
        end.add_to(0, noise);
        let smoothed = gain.smoothed(&before, &end);
        assert!(smoothed.is_sound(), "{noise}: {smoothed:?}");
        for i in 0..N {
            let (is, was) = (smoothed.variance(i), before.variance(i));
            assert!(is >= 0.0 && is <= was * (1.0 + 1e-12), "{noise}: {is}, was {was}");
        }
    }
}

#[test]
fn navigation_step_encoded_as_a_record_parses_unchanged() {
    let mut state = State::at_rest(Point3::new(1.0, -2.0, 3.0), Rot::from_roll_pitch_yaw(0.1, 0.2, 0.3));
    let mut leg = Leg::default();
    let felt = InertialSample {
        rate_radps: Some(Vec3::new(0.1, -0.2, 0.3)),
        force_mps2: Some(Vec3::new(0.5, 0.1, 9.7)),
    };
    let before = state;
    state.go_on(&felt, 0.07, 9.81, &mut leg);
    state.go_on(&InertialSample { rate_radps: None, force_mps2: None }, 0.03, 9.81, &mut leg);
    let by = Move::Leg(leg);
    let settings = Settings::default();
    let factors = by.predict(&settings, &Factors::independent(core::array::from_fn(|i| 0.1 + i as f64)));
    for by in [by, Move::Widened(core::array::from_fn(|i| i as f64)), Move::End] {
        let step = Step { at: MonoNs(5), to: MonoNs(7), state: before, factors, by, predicted: state };
        let unit_at = Vec3::new(0.1, 0.2, 0.3);
        let placed = Placed { step, unit_at, gap: DurNs(-3), piece: 4, clock: 6 };
        let again = Placed::of_words(&placed.words()).unwrap();
        assert_eq!((again.step.by, again.step.factors), (by, factors));
        assert_eq!((again.step.at, again.step.to, again.gap), (MonoNs(5), MonoNs(7), DurNs(-3)));
        assert_eq!((again.piece, again.clock, again.unit_at), (4, 6, unit_at));
        for (is, was) in [(again.step.state, before), (again.step.predicted, state)] {
            let off = is.errors_to(&was).iter().fold(0.0_f64, |most, e| most.max(e.abs()));
            assert!(off < 1e-15, "{off}");
        }
    }
    assert_eq!(ERRORS, 22);
}
