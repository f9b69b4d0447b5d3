//! Comparison of factored covariances with 100-digit values, which `tests/oracles/fusion.py` computed with mpmath.
//!
//! The inputs in `fusion.csv` are doubles that count as exact, so a tolerance bounds only the rounding of the
//! computation. An element P_ij of a covariance P is compared relative to sqrt(P_ii P_jj), the scale of the errors i
//! and j.

use super::super::factors::{Factors, Gain};
use headrace_geometry::math;
use headrace_support::hard_cases::found_at;

const LINES: &str = include_str!("../../../../../tests/oracles/fusion.csv");

/// A form of a covariance (factored or full) that can execute the operations listed in the oracle file.
trait Covariance<const N: usize> {
    fn start(variances: [f64; N]) -> Self;
    fn element(&self, i: usize, j: usize) -> f64;
    fn measure(&mut self, h: &[f64; N], noise: f64) -> Gain<N>;
    fn add(&mut self, variance: f64, a: [f64; N]);
    /// Transforms the covariance by F, which is unit upper triangular.
    fn shear(&mut self, f: &[[f64; N]; N]);
    fn scale(&mut self, i: usize, factor: f64);
    fn distance(&self, e: &[f64; N]) -> Option<f64>;
}

impl<const N: usize> Covariance<N> for Factors<N> {
    fn start(variances: [f64; N]) -> Self {
        Self::independent(variances)
    }

    fn element(&self, i: usize, j: usize) -> f64 {
        self.covariance(i, j)
    }

    fn measure(&mut self, h: &[f64; N], noise: f64) -> Gain<N> {
        Self::measure(self, h, noise)
    }

    fn add(&mut self, variance: f64, a: [f64; N]) {
        let len = a.iter().rposition(|a| *a != 0.0).map_or(0, |last| last + 1);
        Self::add(self, variance, a, len);
    }

    fn shear(&mut self, f: &[[f64; N]; N]) {
        Self::shear(self, |column, len| {
            let was = *column;
            for (slot, row) in column.iter_mut().zip(f) {
                *slot = row.iter().zip(was).take(len).map(|(f, e)| f * e).sum();
            }
        });
    }

    fn scale(&mut self, i: usize, factor: f64) {
        Self::scale(self, i, factor);
    }

    fn distance(&self, e: &[f64; N]) -> Option<f64> {
        Some(Self::distance(self, e))
    }
}

/// The full covariance. Updates have the Joseph form if `JOSEPH` is true, and otherwise the textbook form.
#[derive(Clone, Copy)]
struct Whole<const N: usize, const JOSEPH: bool>([[f64; N]; N]);

impl<const N: usize, const JOSEPH: bool> Whole<N, JOSEPH> {
    /// Returns the matrix product F P F^T.
    fn carried(&self, f: &[[f64; N]; N]) -> Self {
        let half: [[f64; N]; N] =
            f.map(|row| core::array::from_fn(|j| (0..N).map(|k| row[k] * self.0[k][j]).sum()));
        Self(half.map(|row| f.map(|other| row.iter().zip(other).map(|(a, b)| a * b).sum())))
    }

    fn plus(mut self, variance: f64, a: &[f64; N]) -> Self {
        for (i, row) in self.0.iter_mut().enumerate() {
            for (p, a_j) in row.iter_mut().zip(a) {
                *p += variance * a[i] * a_j;
            }
        }
        self
    }
}

impl<const N: usize, const JOSEPH: bool> Covariance<N> for Whole<N, JOSEPH> {
    fn start(variances: [f64; N]) -> Self {
        Self(core::array::from_fn(|i| core::array::from_fn(|j| if i == j { variances[i] } else { 0.0 })))
    }

    fn element(&self, i: usize, j: usize) -> f64 {
        self.0[i][j]
    }

    fn measure(&mut self, h: &[f64; N], noise: f64) -> Gain<N> {
        let ph = self.0.map(|row| row.iter().zip(h).map(|(p, h)| p * h).sum::<f64>());
        let variance = ph.iter().zip(h).map(|(p, h)| p * h).sum::<f64>() + noise;
        let k = ph.map(|p| p / variance);
        *self = if JOSEPH {
            let left =
                core::array::from_fn(|i| core::array::from_fn(|j| f64::from(u8::from(i == j)) - k[i] * h[j]));
            self.carried(&left).plus(noise, &k)
        } else {
            self.plus(-1.0 / variance, &ph)
        };
        Gain { k, variance }
    }

    fn add(&mut self, variance: f64, a: [f64; N]) {
        *self = self.plus(variance, &a);
    }

    fn shear(&mut self, f: &[[f64; N]; N]) {
        *self = self.carried(f);
    }

    fn scale(&mut self, i: usize, factor: f64) {
        let unit = |r: usize, c: usize| f64::from(u8::from(r == c));
        let f = core::array::from_fn(|r| {
            core::array::from_fn(|c| unit(r, c) * if r == i { factor } else { 1.0 })
        });
        *self = self.carried(&f);
    }

    fn distance(&self, _: &[f64; N]) -> Option<f64> {
        None
    }
}

/// Largest differences between a computed covariance and its 100-digit value, relative to the scale of the errors.
#[derive(Debug, Default, Clone, Copy)]
struct Worst {
    covariance: f64,
    gain: f64,
    distance: f64,
    /// Ratio of the largest variance to the smallest one in the expected covariances.
    spread: f64,
    is_sign_lost: bool,
}

/// Raises `worst` to the difference `off`. NaN counts as the largest difference.
fn note(worst: &mut f64, off: f64) {
    *worst = if off.is_nan() { f64::INFINITY } else { worst.max(off) };
}

fn part<const N: usize>(numbers: &[f64]) -> [f64; N] {
    numbers.try_into().unwrap()
}

fn follow<const N: usize, C: Covariance<N>>(case: &str) -> Worst {
    let mut worst = Worst::default();
    let mut p = C::start([0.0; N]);
    let mut gain = Gain { k: [0.0; N], variance: 0.0 };
    let mut lines = 0;
    for line in LINES.lines().filter(|line| !line.starts_with('#')) {
        let fields: Vec<&str> = line.split(',').collect();
        if fields[0] != case || fields[1].parse() != Ok(N) {
            continue;
        }
        lines += 1;
        let numbers: Vec<f64> = fields[3..].iter().map(|field| field.parse().unwrap()).collect();
        match fields[2] {
            "start" => p = C::start(part(&numbers)),
            "measure" => gain = p.measure(&part(&numbers[1..]), numbers[0]),
            "add" => p.add(numbers[0], part(&numbers[1..])),
            "shear" => {
                let mut entries = numbers.iter();
                p.shear(&core::array::from_fn(|i| {
                    core::array::from_fn(|j| match i.cmp(&j) {
                        core::cmp::Ordering::Less => *entries.next().unwrap(),
                        core::cmp::Ordering::Equal => 1.0,
                        core::cmp::Ordering::Greater => 0.0,
                    })
                }));
            }
            "scale" => p.scale(fields[3].parse().unwrap(), numbers[1]),
            "gain" => {
                note(&mut worst.gain, (gain.variance / numbers[0] - 1.0).abs());
                // The gain is compared relative to its largest element, because all elements together change the
                // estimate.
                let size = numbers[1..].iter().fold(0.0, |size: f64, k| size.max(k.abs()));
                for (k, right) in gain.k.iter().zip(&numbers[1..]) {
                    note(&mut worst.gain, (k - right).abs() / size);
                }
            }
            "distance" => {
                let (e, right) = numbers.split_at(N);
                if let Some(distance) = p.distance(&part(e)) {
                    note(&mut worst.distance, (distance / right[0] - 1.0).abs());
                }
            }
            "is" => {
                let mut right = [[0.0; N]; N];
                let mut elements = numbers.iter();
                for (i, row) in right.iter_mut().enumerate() {
                    for slot in row.iter_mut().skip(i) {
                        *slot = *elements.next().unwrap();
                    }
                }
                let variances = || (0..N).map(|i| right[i][i]);
                let spread = variances().fold(0.0, f64::max) / variances().fold(f64::INFINITY, f64::min);
                worst.spread = worst.spread.max(spread);
                for i in 0..N {
                    worst.is_sign_lost |= p.element(i, i) <= 0.0;
                    for j in i..N {
                        let off = (p.element(i, j) - right[i][j]).abs();
                        note(&mut worst.covariance, off / math::sqrt(right[i][i] * right[j][j]));
                    }
                }
            }
            other => panic!("unknown step {other}"),
        }
    }
    assert!(lines > 0, "no case {case} of {N} errors");
    worst
}

/// Returns the largest errors of the factored form, of the textbook form and of the Joseph form.
fn all(case: &str, n: usize) -> [Worst; 3] {
    fn of<const N: usize>(case: &str) -> [Worst; 3] {
        [follow::<N, Factors<N>>(case), follow::<N, Whole<N, false>>(case), follow::<N, Whole<N, true>>(case)]
    }
    if n == 4 { of::<4>(case) } else { of::<6>(case) }
}

/// Name of each oracle case, number of errors, and tolerance of the factored form.
///
/// The tolerance is about ten times the error of this form. Its rounding error is a few units in the last place, times
/// the ratio of the largest to the smallest standard deviation over all directions. After ten hours, this ratio is
/// 1e12.
const CASES: [(&str, usize, f64); 13] = [
    ("mild", 4, 1e-14),
    ("mild", 6, 1e-14),
    ("ill_scaled", 4, 1e-12),
    ("ill_scaled", 6, 1e-12),
    ("exact_prior", 4, 1e-14),
    ("drift", 4, 1e-8),
    ("drift", 6, 1e-6),
    ("unknown_then_known", 4, 1e-13),
    ("unknown_then_known", 6, 1e-13),
    ("nearly_parallel", 4, 2e-7),
    ("nearly_parallel", 6, 1e-10),
    ("swinging", 4, 1e-9),
    ("swinging", 6, 1e-5),
];
/// A full covariance form counts as failed if its error exceeds this multiple of the factored form's tolerance.
const FAILS: f64 = 30.0;

#[test]
fn covariance_factors_agree_with_100_digit_values() {
    for (case, n, tolerance) in CASES {
        let [factors, _, _] = all(case, n);
        assert!(!factors.is_sign_lost, "{case} {n}: {factors:?}");
        let worst = factors.covariance.max(factors.gain).max(factors.distance);
        assert!(worst <= tolerance, "{case} {n}: {factors:?}, allowed {tolerance:e}");
        if n == 4 {
            found_at(&format!("filter.{case}"), factors.spread, worst, tolerance);
        }
    }
}

#[test]
fn full_covariance_form_fails_where_the_factored_form_is_accurate() {
    for (case, n, tolerance) in CASES {
        let is_hard = !matches!(case, "mild" | "ill_scaled");
        let [_, plain, joseph] = all(case, n);
        let fails = |worst: Worst| worst.is_sign_lost || worst.covariance > FAILS * tolerance;
        if is_hard {
            assert!(fails(plain), "{case} {n}: {plain:?}");
            assert!(fails(joseph), "{case} {n}: {joseph:?}");
        }
        // Both full covariance forms are also accurate in an easy case.
        if case == "mild" {
            assert!(plain.covariance.max(joseph.covariance) < 1e-13, "{plain:?} {joseph:?}");
        }
    }
    let sign_lost =
        |which: usize| CASES.iter().filter(|(case, n, _)| all(case, *n)[which].is_sign_lost).count();
    assert!(sign_lost(1) >= 5, "the plain form is expected to lose its sign in 5 cases or more");
    assert!(sign_lost(2) >= 2, "Joseph's form is expected to lose its sign in 2 cases or more");
}
